import numpy as np
import pytest

from geomotion.config import PlanarSCurveDataset
from geomotion.demos.generators.planar import JOINTS, LINKS_M, joints_rad
from geomotion.demos.readers import read
from geomotion.demos.selection import split
from geomotion.errors import InvalidSetting


def s_curve(**settings):
    return read(PlanarSCurveDataset(name="planar/s_curve", **settings))


def tip_m(joints):
    shoulder, both = joints[:, 0], joints.sum(axis=1)
    a, b = LINKS_M
    return np.stack([a * np.cos(shoulder) + b * np.cos(both), a * np.sin(shoulder) + b * np.sin(both)], axis=1)


def test_both_branches_bring_the_tip_to_the_same_places():
    demonstrations = s_curve()
    for up, down in zip(demonstrations.trajectories[::2], demonstrations.trajectories[1::2], strict=True):
        assert (up.label, down.label) == ("elbow up", "elbow down")
        np.testing.assert_array_equal(up.channels["position_m"], down.channels["position_m"])
        for branch in (up, down):
            np.testing.assert_allclose(tip_m(branch.channels["joints_rad"]), branch.channels["position_m"], atol=1e-12)
        assert up.channels["joints_rad"][:, 1].max() < -0.5 and down.channels["joints_rad"][:, 1].min() > 0.5


def test_the_arm_stays_away_from_being_straight_and_its_joints_do_not_jump():
    for trajectory in s_curve().trajectories:
        reach = np.linalg.norm(trajectory.channels["position_m"], axis=1)
        assert reach.min() > 0.1 and reach.max() < 0.95 * sum(LINKS_M)
        assert np.abs(np.diff(trajectory.channels["joints_rad"], axis=0)).max() < 0.1
        assert np.abs(trajectory.channels["joints_rad"]).max() < 2.8


def test_the_last_of_each_branch_is_held_out():
    demonstrations = s_curve(demos=8, points=20)
    assert split(PlanarSCurveDataset(name="x"), demonstrations) == (tuple(range(6)), (6, 7))
    assert demonstrations.joint_names == JOINTS and demonstrations.space == "joint"


def test_what_is_too_large_for_the_arm_is_refused():
    with pytest.raises(InvalidSetting, match="less: the arm reaches"):
        s_curve(size_m=0.6)


def test_beyond_reach_there_is_no_solution():
    assert np.isnan(joints_rad(np.array([[0.6, 0.0]]), 1.0)).any()


def test_its_numbers_are_those_of_the_arm_that_ships():
    from pathlib import Path

    import geomotion.robot
    from geomotion.robot.chain import read_chain

    chain = read_chain(Path(geomotion.robot.__file__).parent / "urdf/planar_2dof.urdf", "base", "tip")
    q = np.array([[0.3, -1.1], [0.9, 1.4]])
    np.testing.assert_allclose(chain.pose(q)[0][:, :2], tip_m(q), atol=1e-12)
