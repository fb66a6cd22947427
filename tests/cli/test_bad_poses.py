"""Poses that cannot be learned meet one clear line; those of odd conventions are read as what they say they are."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

TOY = ("chart.layers=2", "chart.features=8", "training.steps=5")
TIME_S = np.linspace(0, 1, 30)


def turning(most_rad: float) -> np.ndarray:
    half = most_rad * (1 - TIME_S) ** 2 / 2
    return np.stack([np.cos(half), 0 * half, np.sin(half), 0 * half], axis=1)


def write(folder: Path, *orientations: np.ndarray | None) -> None:
    for number, orientation in enumerate(orientations):
        channels = {"position_m": (1 + 0.01 * number) * np.stack([TIME_S**2, TIME_S, 1 - TIME_S], axis=1)}
        if orientation is not None:
            channels["orientation_wxyz"] = orientation
        np.savez(folder / f"{number}.npz", time_s=TIME_S, **channels)


def scalar_last(folder: Path) -> None:
    good = [turning(one) for one in (1.0, 1.1, 1.2)]
    write(folder, *good, np.roll(good[0], -1, axis=1))


RECORDINGS: dict[str, tuple[Callable[[Path], None], str, str]] = {
    "no orientations": (lambda folder: write(folder, None, None), "poses need orientation_wxyz as well", "train"),
    "no rotations": (
        lambda folder: write(folder, np.full((30, 4), 0.1), turning(1.0)), "norm 0.2; expected 1", "ingest",
    ),
    "Euler angles and a zero": (
        lambda folder: write(folder, turning(1.0), np.zeros((30, 4))), "quaternion of norm 0; expected 1", "ingest",
    ),
    "mixed orders": (scalar_last, "only if they are in the order x, y, z, w", "ingest"),
    "beyond the cover": (
        lambda folder: write(folder, turning(2 * np.pi), turning(1.9 * np.pi)), "coordinates cover 175", "train",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", RECORDINGS)
def test_poses_that_cannot_be_learned_are_refused(what, tmp_path, refused):
    make, words, stage = RECORDINGS[what]
    make(tmp_path)
    refused(("ncds", "train", "dataset=folder", f"dataset.root={tmp_path}", "space=R3xSO3", *TOY), words, stage)


def test_a_skill_of_more_dimensions_than_its_states_is_refused(tmp_path, refused):
    write(tmp_path, turning(1.0), turning(1.1))
    command = ("ncds", "train", "dataset=folder", f"dataset.root={tmp_path}", "space=R3xSO3", "field.skill_dim=7", *TOY)
    refused(command, "at most 6, the number of coordinates of a state", "train", 2)


def test_poses_are_exported_with_an_example_that_turns_them_to_their_goal(tmp_path, here, without_shape_checks):
    write(tmp_path, turning(1.0), turning(1.1))
    command = ("ncds", "export", "dataset=folder", f"dataset.root={tmp_path}", "space=R3xSO3", "field.skill_dim=2")
    answer = here(*command, *TOY, "output=json").done()
    policy = answer.document["policy"]
    assert policy["max_difference_to_torch"].keys() == policy["outputs"].keys() - {"status"}
    assert max(policy["max_difference_to_torch"].values()) < 1e-5
    assert policy["query_time_ms"] < 5
    np.testing.assert_allclose(policy["goal"]["position_m"], [1.005, 1.005, 0], atol=1e-4)
    script = answer.artefact("export", "policy_example.py")
    told = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True).stdout
    assert "worst status 0" in told


def test_44_joints_can_be_learned_and_exported(tmp_path, here, without_shape_checks):
    joints = np.linspace(0.2, 1.0, 44)
    for number in range(3):
        values = (1 + 0.1 * number) * joints * (1 - TIME_S[:, None]) ** 2
        np.savez(tmp_path / f"{number}.npz", time_s=TIME_S, joints_rad=values)
    answer = here(
        "ncds", "export", "dataset=folder", f"dataset.root={tmp_path}", "field.skill_dim=2", "time_law=none", *TOY,
        "output=json",
    ).done()  # fmt: skip
    policy = answer.document["policy"]
    assert policy["inputs"]["joints_rad"]["shape"] == ["batch", 44]
    assert policy["max_difference_to_torch"]["joint_velocity_rad_per_s"] < 1e-5
