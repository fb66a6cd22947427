import numpy as np
import pytest
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from geomotion.config import FolderDataset, JCDataset, LettersDataset
from geomotion.demos import storage
from geomotion.demos.generators.jc import C_HEIGHT, C_MIDDLE
from geomotion.demos.readers import read
from geomotion.errors import DatasetError, InvalidSetting


def jc(**settings):
    return read(JCDataset(name="generated/jc", **settings))


def channel(demonstrations, name):
    return np.array([trajectory.channels[name] for trajectory in demonstrations.trajectories])


def test_the_default_is_ten_repetitions_of_a_hundred_points_on_r2_x_s2():
    demonstrations = jc()
    assert channel(demonstrations, "position_m").shape == (10, 100, 2)
    assert channel(demonstrations, "direction_xyz").shape == (10, 100, 3)
    assert demonstrations.space == "R2xS2"


def test_positions_are_the_letter_j_and_directions_the_letter_c_seen_from_the_centre_of_the_sphere():
    def letter(name, size_m):
        config = LettersDataset(name="x", letter=name, size_m=size_m, points=100, variation=0.0, demos=1)
        return read(config)[0].channels["position_m"]

    demonstrations = jc(variation=0.0, size_m=0.3)
    x, y, z = channel(demonstrations, "direction_xyz")[0].T
    np.testing.assert_array_equal(channel(demonstrations, "position_m")[0], letter("j", 0.3))
    np.testing.assert_allclose(np.stack([x / z, y / z], axis=1), letter("c", C_HEIGHT) - C_MIDDLE, atol=1e-14)


def test_directions_are_unit_and_smooth_and_open_to_one_side():
    directions = channel(jc(demos=20), "direction_xyz")
    np.testing.assert_allclose(np.linalg.norm(directions, axis=2), 1, atol=1e-15)
    assert np.degrees(np.arccos(np.einsum("dti,dti->dt", directions[:, 1:], directions[:, :-1]))).max() < 10
    assert (directions[:, :, 2] > 0.5).all()  # within 60 degrees of the pole
    ends = directions[:, [0, -1], 0]
    assert (ends > 0.2).all() and (directions[:, :, 0].min(axis=1) < -0.3).all()  # a C: starts and ends on the right


def test_repetitions_differ_about_as_much_as_those_of_people():
    demonstrations = jc(demos=50)
    for name in ("position_m", "direction_xyz"):
        values = channel(demonstrations, name)
        extent = np.ptp(values, axis=1).max(axis=1).mean()
        assert 0.02 < np.linalg.norm(values[:, 0].std(axis=0)) / extent < 0.13  # as for letters, and as in LASA
    durations = [trajectory.duration_s for trajectory in demonstrations.trajectories]
    assert 0.05 < np.std(durations) / 3 < 0.25


def test_positions_and_directions_vary_on_their_own():
    demonstrations = jc(demos=50)
    position, direction = (channel(demonstrations, name)[:, 0] for name in ("position_m", "direction_xyz"))
    assert np.abs(np.corrcoef(position[:, 0], direction[:, 0])[0, 1]) < 0.4


def test_the_same_seed_gives_the_same_demonstrations_and_another_seed_others(same):
    same(jc(seed=4), jc(seed=4))
    for name in ("position_m", "direction_xyz"):
        assert not np.array_equal(channel(jc(seed=4), name), channel(jc(seed=5), name))


def test_a_demonstration_does_not_depend_on_how_many_follow():
    for name in ("position_m", "direction_xyz"):
        np.testing.assert_array_equal(channel(jc(demos=2), name)[1], channel(jc(demos=9), name)[1])


def test_without_variation_all_repetitions_are_equal():
    for name in ("position_m", "direction_xyz"):
        first, *others = channel(jc(variation=0.0), name)
        np.testing.assert_array_equal(others, np.broadcast_to(first, (9, *first.shape)))


def test_the_dataset_says_that_it_is_generated_and_can_be_chosen():
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        config = OmegaConf.to_object(compose("gms", ["dataset=generated/jc", "dataset.demos=2"]).dataset)
    demonstrations = read(config)
    assert demonstrations.name == "generated/jc"
    assert "generated" in demonstrations.source


def test_settings_that_make_no_sense_are_refused():
    with pytest.raises(InvalidSetting, match=r"dataset\.size_m=-1.* above 0"):
        JCDataset(name="x", size_m=-1.0)
    with pytest.raises(InvalidSetting, match="0 to 3"):
        JCDataset(name="x", variation=4.0)


def test_directions_are_stored_bit_by_bit_and_read_from_files_of_others(tmp_path, same):
    demonstrations = jc(demos=2)
    storage.save(demonstrations, tmp_path / "own")
    same(storage.load(tmp_path / "own"), demonstrations)
    (tmp_path / "csv").mkdir()
    rows = np.column_stack([demonstrations[0].time_s, demonstrations[0].state(["position_m", "direction_xyz"])])
    names = "time_s,x,y,direction_x,direction_y,direction_z"
    np.savetxt(tmp_path / "csv/one.csv", rows, delimiter=",", header=names, comments="", fmt="%.17g")
    found = read(FolderDataset(name="mine", root=str(tmp_path / "csv")))
    assert found.space == "R2xS2"
    np.testing.assert_array_equal(found[0].channels["direction_xyz"], demonstrations[0].channels["direction_xyz"])


@pytest.mark.parametrize(
    ("file", "columns", "words"),
    [
        ("one.csv", {"direction_x": 1.0, "direction_y": 0.0}, "direction has axes x, y; expected x, y, z"),
        (
            "one.csv",
            {"direction_x": 1.0, "direction_y": 0.2, "direction_z": 0.0},
            "direction of norm 1.0198.*expected 1",
        ),
        ("one.npz", {"direction_xyz": np.ones((3, 2))}, "direction_xyz has 2 axes; expected x, y, z"),
    ],
)
def test_directions_that_are_none_are_refused(tmp_path, file, columns, words):
    table = {
        "time_s": np.arange(3.0),
        **{name: np.ones(3) * value if np.isscalar(value) else value for name, value in columns.items()},
    }
    if file.endswith("npz"):
        np.savez(tmp_path / file, **table)
    else:
        np.savetxt(
            tmp_path / file, np.stack(list(table.values()), 1), delimiter=",", header=",".join(table), comments=""
        )
    with pytest.raises(DatasetError, match=words):
        read(FolderDataset(name="mine", root=str(tmp_path)))
