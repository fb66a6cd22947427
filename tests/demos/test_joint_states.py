"""Logs of joint states in the layouts that people export, and files with a column for each joint."""

import numpy as np
import pandas as pd
import pytest

from geomotion.config import AngleUnit, FolderDataset, PreprocessConfig, VelocitySource
from geomotion.demos.preprocessing import preprocess
from geomotion.demos.readers import read
from geomotion.errors import DatasetError

NAMES = ["panda_joint1", "panda_joint2", "panda_finger_joint1"]
TIMES_S = np.array([0.0, 0.1, 0.25])
JOINTS = np.array([[0.1, -0.2, 0.04], [0.2, -0.3, 0.04], [0.3, -0.5, 0.04]])
STAMPS_NS = 1_700_000_000_000_000_000 + (1e9 * TIMES_S).astype(np.int64)


def lists(rows):
    return [str(list(map(float, row))) for row in rows]


def echoed():
    """As `rostopic echo -p` prints it."""
    numbered = {f"field.name{i}": [name] * 3 for i, name in enumerate(NAMES)}
    numbered |= {f"field.position{i}": JOINTS[:, i] for i in range(3)}
    numbered |= {f"field.velocity{i}": JOINTS[:, i] / 2 for i in range(3)}
    return {"%time": STAMPS_NS, "field.header.seq": range(3), "field.header.stamp": STAMPS_NS, **numbered}


def with_lists():
    """As bagpy writes it."""
    stamps = {"header.stamp.secs": STAMPS_NS // 10**9, "header.stamp.nsecs": STAMPS_NS % 10**9}
    fields = {"name": [str(NAMES)] * 3, "position": lists(JOINTS), "velocity": ["[]"] * 3, "effort": ["[]"] * 3}
    return {"Time": TIMES_S + 5.0, "header.seq": range(3), **stamps, "header.frame_id": [""] * 3, **fields}


def by_topic():
    """As PlotJuggler exports it."""
    return {
        "__time": TIMES_S + 1.7e9,
        **{f"/joint_states/{name}/position": JOINTS[:, i] for i, name in enumerate(NAMES)},
    }


def indexed():
    names = {f"/joint_states/name[{i}]": [name] * 3 for i, name in enumerate(NAMES)}
    return {"Time": TIMES_S, **names, **{f"/joint_states/position[{i}]": JOINTS[:, i] for i in range(3)}}


def by_name():
    return {"time_s": TIMES_S, **{name: JOINTS[:, i] for i, name in enumerate(NAMES)}}


def folder(path, columns, **settings):
    pd.DataFrame(columns).to_csv(path / "a.csv", index=False)
    return FolderDataset(name="folder", root=str(path), **settings)


@pytest.mark.parametrize("layout", [echoed, with_lists, by_topic, indexed, by_name])
def test_joints_names_and_times_are_read_from_every_layout(layout, tmp_path):
    found = preprocess(read(folder(tmp_path, layout())), PreprocessConfig())
    assert found.joint_names == tuple(NAMES) and found.space == "joint"
    np.testing.assert_allclose(found[0].channels["joints_rad"], JOINTS, atol=1e-12)
    np.testing.assert_allclose(found[0].time_s, TIMES_S, atol=1e-6)


def test_lists_in_parquet_are_read_too(tmp_path):
    columns = {"timestamp": TIMES_S, "name": [NAMES] * 3, "position": list(JOINTS)}
    pd.DataFrame(columns).to_parquet(tmp_path / "a.parquet")
    found = read(FolderDataset(name="folder", root=str(tmp_path)))
    assert found.joint_names == tuple(NAMES)
    np.testing.assert_array_equal(found[0].channels["joints_rad"], JOINTS)


def test_recorded_velocities_are_kept(tmp_path):
    found = preprocess(read(folder(tmp_path, echoed())), PreprocessConfig(velocity=VelocitySource.recorded))
    np.testing.assert_allclose(found[0].channels["joint_velocity_rad_per_s"], JOINTS / 2)


def test_degrees_are_turned_into_radians_by_setting_or_by_name(tmp_path):
    degrees = {name: np.degrees(values) for name, values in by_name().items() if name != "time_s"}
    named = {f"{name}_deg": values for name, values in degrees.items()}
    for columns, settings in ((degrees, {"angle_unit": AngleUnit.deg}), (named, {})):
        found = read(folder(tmp_path, {"time_s": TIMES_S, **columns}, **settings))
        np.testing.assert_allclose(found[0].channels["joints_rad"], JOINTS)
        assert found.joint_names == tuple(NAMES)


def test_columns_whose_names_do_not_say_that_they_are_joints_can_be_named(tmp_path):
    columns = {"time_s": TIMES_S, "shoulder": JOINTS[:, 0], "elbow": JOINTS[:, 1]}
    assert read(folder(tmp_path, columns, joint_columns=["shoulder", "elbow"])).joint_names == ("shoulder", "elbow")
    with pytest.raises(DatasetError, match=r"unknown column 'elbow'.*dataset\.joint_columns"):
        read(folder(tmp_path, columns))


def test_numbered_joints_have_no_names(tmp_path):
    found = read(folder(tmp_path, {"time_s": TIMES_S, "q1": JOINTS[:, 0], "q2": JOINTS[:, 1]}))
    assert found.joint_names == () and found[0].channels["joints_rad"].shape == (3, 2)


def test_files_that_name_different_joints_are_refused(tmp_path):
    folder(tmp_path, by_name())
    pd.DataFrame({"time_s": TIMES_S, **dict.fromkeys(reversed(NAMES), JOINTS[:, 0])}).to_csv(tmp_path / "b.csv")
    columns = {name: values for name, values in by_name().items() if name != "time_s"}
    swapped = {"time_s": TIMES_S, **dict(reversed(columns.items()))}
    pd.DataFrame(swapped).to_csv(tmp_path / "b.csv", index=False)
    with pytest.raises(DatasetError, match=r"b\.csv: names joints panda_finger_joint1, .* as in a\.csv"):
        read(FolderDataset(name="folder", root=str(tmp_path)))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"field.name0": ["panda_joint1", "other", "other"]}, "joint 0 is named other and panda_joint1"),
        ({"field.position3": [1.0, 2.0, 3.0]}, "names and positions do not fit together: only one of them has 3"),
    ],
)
def test_logs_that_contradict_themselves_are_refused(tmp_path, change, words):
    with pytest.raises(DatasetError, match=words):
        read(folder(tmp_path, {**echoed(), **change}))


def test_cells_that_are_no_lists_of_one_length_are_refused(tmp_path):
    for position, words in ((["[1, 2"] * 3, "row 0: position is"), (["[1]", "[1]", "[1, 2]"], "different lengths")):
        with pytest.raises(DatasetError, match=words):
            read(folder(tmp_path, {**with_lists(), "position": position}))
