"""Conditions of demonstrations: where they come from, how they are kept, and how sets with them are split."""

import json
from dataclasses import replace

import numpy as np
import pytest

from geomotion import config as schema
from geomotion.config import Condition
from geomotion.demos import storage
from geomotion.demos.conditions import carried, condition_names
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.preprocessing import preprocess
from geomotion.demos.readers import folder, lasa, read
from geomotion.demos.selection import split
from geomotion.demos.summary import summarise, summary_table
from geomotion.errors import DatasetError, InvalidSetting


@pytest.fixture
def letters() -> Demonstrations:
    return read(
        schema.LettersDataset(
            name="letters/two", letter="l", further_letters=["v"], condition=Condition.shape, demos=3, points=30
        )
    )


@pytest.fixture
def lasa_config(lasa_folder) -> schema.LasaDataset:
    return schema.LasaDataset(
        name="lasa/two_shapes", shapes=["Angle", "Line"], condition=Condition.shape, root=str(lasa_folder)
    )


def write_csv(path, condition, rows=4):
    values = condition if np.ndim(condition[0]) else [condition] * rows
    lines = [f"{0.1 * row},{row},0,{values[row][0]},{values[row][1]}" for row in range(rows)]
    path.write_text("time_s,x,y,condition_mass_kg,condition_height_m\n" + "\n".join(lines) + "\n")


def test_each_letter_has_its_own_condition(letters):
    assert letters.condition_names == ("l", "v")
    assert [one.condition for one in letters.trajectories] == [(1.0, 0.0)] * 3 + [(0.0, 1.0)] * 3
    assert [one.label for one in letters.trajectories] == ["l"] * 3 + ["v"] * 3
    assert condition_names(letters) == {"l": (1.0, 0.0), "v": (0.0, 1.0)}


def test_conditions_survive_preprocessing_and_storage(letters, tmp_path):
    done = preprocess(letters, schema.PreprocessConfig(trim_start_points=2, resample_points=20, align_end=True))
    storage.save(done, tmp_path)
    loaded = storage.load(tmp_path)
    assert loaded.condition_names == letters.condition_names
    assert [one.condition for one in loaded.trajectories] == [one.condition for one in letters.trajectories]
    info = json.loads((tmp_path / storage.INFO).read_text())
    del info[storage.OWN_KEY]["condition_names"]  # as in sets written before there were conditions


def test_ends_are_aligned_within_each_condition():
    config = schema.LettersDataset(
        name="l", letter="l", condition=Condition.target, targets_m=[[0.0, 0.0], [0.02, 0.01]], demos=3, points=30
    )
    apart = read(config)
    moved = [
        replace(one, channels={"position_m": one.channels["position_m"] + 0.001 * number})
        for number, one in enumerate(apart.trajectories)
    ]
    aligned = preprocess(replace(apart, trajectories=tuple(moved)), schema.PreprocessConfig(align_end=True))
    ends = np.array([one.channels["position_m"][-1] for one in aligned.trajectories])
    np.testing.assert_allclose(ends, np.repeat([[0.001, 0.001], [0.024, 0.014]], 3, axis=0), atol=1e-9)
    assert any("of the same condition" in step for step in aligned.steps)


def test_a_carried_motion_keeps_its_start_and_ends_at_the_target(letters):
    one = letters[0]
    target = np.array([0.03, -0.01])
    time_s, positions = one.time_s, one.channels["position_m"]
    recorded = replace(one, channels={**one.channels, "velocity_m_per_s": np.gradient(positions, time_s, axis=0)})
    found = carried(recorded, target)
    np.testing.assert_allclose(found.channels["position_m"][[0, -1]], [positions[0], target], atol=1e-12)
    differences = np.gradient(found.channels["position_m"], time_s, axis=0)
    np.testing.assert_allclose(found.channels["velocity_m_per_s"][2:-2], differences[2:-2], atol=1e-9)


def test_lasa_shapes_stand_beside_each_other_instead_of_being_stacked(lasa_config):
    found = lasa.read(lasa_config)
    assert (len(found), found.space, found.condition_names) == (14, "R2", ("Angle", "Line"))
    assert split(lasa_config, found) == ((0, 1, 2, 3, 4, 7, 8, 9, 10, 11), (5, 6, 12, 13))
    labelled = lasa.read(replace(lasa_config, condition=Condition.label))
    assert labelled.condition_names == ("label",)
    assert {one.condition for one in labelled.trajectories} == {(0.0,), (1.0,)}


def test_lasa_motions_are_carried_to_targets(lasa_config):
    targets = [[0.0, 0.0], [0.03, 0.01]]
    config = replace(lasa_config, shapes=["Angle"], condition=Condition.target, targets_m=targets)
    found = lasa.read(config)
    ends = [one.channels["position_m"][-1] for one in found.trajectories]
    np.testing.assert_allclose(ends, np.repeat(targets, 7, axis=0), atol=1e-12)
    assert [one.condition for one in found.trajectories] == [(0.0, 0.0)] * 7 + [(0.03, 0.01)] * 7
    (start,) = {tuple(found[number].channels["position_m"][0]) for number in (0, 7)}
    assert np.isfinite(start).all()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"condition": Condition.shape}, "two shapes or more"),
        ({"condition": Condition.target}, "two targets"),
        ({"condition": Condition.target, "targets_m": [[0, 0], [1, 2, 3]]}, "targets in the plane"),
        ({"targets_m": [[0, 0], [1, 2]]}, "a single target"),
        ({"further_letters": ["v"]}, "dataset.condition"),
    ],
)
def test_settings_that_do_not_go_together_are_refused(settings, words):
    with pytest.raises(InvalidSetting, match=words):
        schema.LettersDataset(name="l", letter="l", **settings)


def test_without_repeated_conditions_the_last_demonstrations_are_held_out():
    line = Trajectory(np.arange(3.0), {"position_m": np.zeros((3, 2))})
    each = [replace(line, condition=(float(number),)) for number in range(6)]
    alone = Demonstrations("alone", tuple(each), "R2", condition_names=("c",))
    assert split(schema.DatasetConfig(name="alone"), alone) == ((0, 1, 2, 3), (4, 5))
    assert condition_names(alone)["c=2"] == (2.0,)


def test_columns_of_a_folder_give_conditions(tmp_path):
    write_csv(tmp_path / "a.csv", (0.5, 0.1))
    write_csv(tmp_path / "b.csv", (1.5, 0.2))
    found = folder.read(schema.FolderDataset(name="folder", root=str(tmp_path)))
    assert found.condition_names == ("mass_kg", "height_m")
    assert [one.condition for one in found.trajectories] == [(0.5, 0.1), (1.5, 0.2)]
    assert set(found.channel_names) == {"position_m"}
    assert "(0.500, 0.100)" in summary_table(summarise(found, schema.DatasetConfig(name="folder")))


def test_a_condition_that_changes_on_the_way_is_refused(tmp_path):
    write_csv(tmp_path / "a.csv", [(0.5, 0.1), (0.5, 0.1), (0.6, 0.1), (0.5, 0.1)])
    with pytest.raises(DatasetError, match=r"row 2: condition is \[0\.6, 0\.1\] after \[0\.5, 0\.1\]"):
        folder.read(schema.FolderDataset(name="folder", root=str(tmp_path)))


def test_a_file_without_the_condition_of_the_others_is_refused(tmp_path):
    write_csv(tmp_path / "a.csv", (0.5, 0.1))
    (tmp_path / "b.csv").write_text("time_s,x,y\n0,0,0\n0.1,1,0\n")
    with pytest.raises(DatasetError, match=r"b\.csv: names conditions none; expected mass_kg, height_m as in a\.csv"):
        folder.read(schema.FolderDataset(name="folder", root=str(tmp_path)))


def test_conditions_alone_are_no_recording(tmp_path):
    (tmp_path / "a.csv").write_text("time_s,condition_c\n0,0\n0.1,0\n")
    with pytest.raises(DatasetError, match="nothing that moves"):
        folder.read(schema.FolderDataset(name="folder", root=str(tmp_path)))


def test_a_demonstration_without_its_condition_is_refused(letters):
    bare = replace(letters[0], condition=())
    with pytest.raises(DatasetError, match=r"demonstration 0 has the condition \[\]; expected 2 finite numbers"):
        replace(letters, trajectories=(bare,))
