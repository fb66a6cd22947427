import numpy as np
import pytest

from geomotion.config import ElbowConfig, RoboTasks9JointDataset
from geomotion.demos.readers import read
from geomotion.demos.selection import split
from geomotion.errors import DatasetError
from geomotion.robot.panda import LIMITS
from geomotion.robot.swivel import swivel_rad

POINTS = 12
KEPT = (0, 1, 7, 8)  # of the recordings, to be quick
ONE_SOLUTION = ElbowConfig(solutions=1, swivel_rad=-0.8)


def config(folder, task="wineglass", **settings):
    return RoboTasks9JointDataset(name="x", task=task, root=str(folder), **{"points": POINTS, **settings})


@pytest.fixture(scope="module")
def poses(robotasks9_folder):
    return np.load(robotasks9_folder / "wineglass.npy")[list(KEPT)]


@pytest.fixture(scope="module")
def wineglass(poses, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    np.save(folder / "wineglass.npy", poses)
    return read(config(folder))


def test_every_recording_is_solved_with_every_way_of_the_elbow(wineglass):
    assert (wineglass.name, len(wineglass), wineglass.space) == ("robotasks9_joint/wineglass", 12, "joint")
    assert list(wineglass.groups[:3]) == ["elbow -74 deg", "elbow -23 deg", "elbow +29 deg"]
    for solution, wanted in enumerate((-1.3, -0.4, 0.5)):
        for trajectory in wineglass.trajectories[solution::3]:
            assert np.abs(swivel_rad(trajectory.channels["joints_rad"]) - wanted).max() < 0.35
            assert LIMITS.margin_rad(trajectory.channels["joints_rad"]).min() > 0.1


def test_the_hand_is_where_it_was_recorded(wineglass, poses):
    for recording in range(len(KEPT)):
        for trajectory in wineglass.trajectories[3 * recording : 3 * recording + 3]:
            for row, sample in ((0, 0), (-1, 999)):
                place, q = (trajectory.channels[name][row] for name in ("position_m", "orientation_wxyz"))
                np.testing.assert_allclose(place, poses[recording, sample, :3] / 100, atol=1e-8)
                assert abs(q @ poses[recording, sample, 3:]) == pytest.approx(1, abs=1e-9)
            assert trajectory.duration_s == pytest.approx(999 / 60)


def test_the_last_two_recordings_are_held_out_in_every_family(wineglass):
    assert split(config("."), wineglass) == (tuple(range(6)), tuple(range(6, 12)))


def test_recordings_that_the_arm_cannot_follow_are_left_out_and_named(robotasks9_folder, tmp_path):
    np.save(tmp_path / "openbox.npy", np.load(robotasks9_folder / "openbox.npy")[[1, 2], 500::20])
    found = read(config(tmp_path, "openbox", elbow=ONE_SOLUTION))
    assert len(found) == 1
    assert any(step.startswith("left out recordings that the arm cannot follow, missing 1 by") for step in found.steps)


def test_what_it_is_derived_from_and_how_is_said(wineglass):
    assert "RoboTasks9" in wineglass.source and "derived from recorded poses" in wineglass.source
    assert wineglass.steps[0] == f"resampled to {POINTS} poses, even in time"
    assert "swivel angles of -74, -23, +29 deg" in wineglass.steps[1]


def test_where_nothing_can_be_followed_there_is_no_dataset(robotasks9_folder, tmp_path):
    poses = np.load(robotasks9_folder / "scoop.npy")[:1, ::100]
    poses[..., 0] += 200
    np.save(tmp_path / "scoop.npy", poses)
    with pytest.raises(DatasetError, match=r"the arm can follow no recording .* misses 0 by \d+\.\d mm"):
        read(config(tmp_path, "scoop", elbow=ONE_SOLUTION))
