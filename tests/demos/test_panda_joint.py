from pathlib import Path

import numpy as np
import pytest

from geomotion.config import (
    ElbowConfig,
    FolderDataset,
    Overlap,
    PandaCircleJointDataset,
    PandaPouringJointDataset,
    PandaReachJointDataset,
)
from geomotion.demos.generators.elbow import swivels_rad
from geomotion.demos.generators.panda_joint import CENTRE_M
from geomotion.demos.readers import read
from geomotion.demos.selection import split
from geomotion.errors import InvalidSetting
from geomotion.robot.chain import panda_chain
from geomotion.robot.panda import JOINTS, LIMITS
from geomotion.robot.swivel import ELBOW_JOINT, WRIST_JOINT, swivel_rad

SHIPPED = Path(__file__).resolve().parents[2] / "datasets/panda/reach_to_grasp_joint"


def reach(**settings):
    return read(PandaReachJointDataset(name="panda/reach_to_grasp_joint", **settings))


def channel(demonstrations, name):
    return np.array([trajectory.channels[name] for trajectory in demonstrations])


def forearm_m(joints_rad):
    """Middle of the forearm, between elbow and wrist [m]."""
    frames = panda_chain("flange").frames(joints_rad)
    return (frames[ELBOW_JOINT, :3, 3] + frames[WRIST_JOINT, :3, 3]) / 2


def apart(one, other, row):
    """Smallest distance between the forearms of two families [m]."""
    places = [[forearm_m(t.channels["joints_rad"][row]) for t in family] for family in (one, other)]
    return min(np.linalg.norm(a - b) for a in places[0] for b in places[1])


@pytest.fixture(scope="module")
def demonstrations():
    """As shipped; another test compares it with the generator."""
    return read(FolderDataset(name="folder", root=str(SHIPPED)))


@pytest.fixture(scope="module")
def families(demonstrations):
    return [demonstrations.trajectories[solution::3] for solution in range(3)]


def test_three_families_of_five_are_named_by_their_swivel(demonstrations, families):
    assert [len(family) for family in families] == [5, 5, 5]
    assert len(set(demonstrations.groups)) == 3
    for family, name in zip(families, ("elbow -74 deg", "elbow +0 deg", "elbow +74 deg"), strict=True):
        assert {trajectory.label for trajectory in family} == {f"to target 0, {name}"}
    assert (demonstrations.space, demonstrations.joint_names) == ("joint", JOINTS)


def test_the_last_of_every_family_is_held_out(demonstrations):
    train, test = split(PandaReachJointDataset(name="x"), demonstrations)
    assert (len(train), test) == (12, (12, 13, 14))
    assert len({demonstrations[number].label for number in test}) == 3


def test_forearms_pass_at_clearly_different_places(families):
    assert min(apart(families[0], families[1], 100), apart(families[1], families[2], 100)) > 0.12


def test_families_stay_apart_at_the_elbow_and_hands_move_alike(families):
    for row in (0, 100, -1):
        swivels = [swivel_rad(channel(family, "joints_rad")[:, row]) for family in families]
        assert swivels[0].max() < -1.1 and np.abs(swivels[1]).max() < 0.2 and swivels[2].min() > 1.1
    hands = [channel(family, "position_m").mean(axis=0) for family in families]
    assert np.linalg.norm(hands[0] - hands[2], axis=1).max() < 0.03


def test_joints_keep_away_from_their_limits_of_position_and_speed(demonstrations):
    for trajectory in demonstrations.trajectories:
        joints = trajectory.channels["joints_rad"]
        assert LIMITS.margin_rad(joints).min() > 0.2
        assert (np.abs(np.gradient(joints, trajectory.time_s, axis=0)) < 0.9 * LIMITS.velocity_rad_per_s).all()


def test_recorded_poses_are_those_of_the_joints(demonstrations, simulated_panda):
    for trajectory in demonstrations.trajectories[:3]:
        joints, *poses = (trajectory.channels[name][::10] for name in ("joints_rad", "position_m", "orientation_wxyz"))
        assert simulated_panda.takes(joints, *poses)


def test_families_that_overlap_meet_at_start_and_goal_and_pass_apart():
    families = reach(demos=6, points=60, elbow=ElbowConfig(overlap=Overlap.both))
    joints = channel(families.trajectories, "joints_rad")
    for row in (0, -1):
        assert np.ptp(swivel_rad(joints[:, row])) < 0.3
        assert np.ptp(joints[:, row], axis=0).max() < 0.5
    middle = swivel_rad(joints[:, 30]).reshape(2, 3).T
    assert middle[0].max() < -1.1 and np.abs(middle[1]).max() < 0.2 and middle[2].min() > 1.1
    passed = [[forearm_m(one) for one in joints[family::3, 30]] for family in range(3)]
    pairs = [(a, b) for one, other in ((0, 1), (1, 2)) for a in passed[one] for b in passed[other]]
    assert min(np.linalg.norm(a - b) for a, b in pairs) > 0.12


def test_solutions_may_overlap_at_the_start_only_or_nowhere():
    for overlap, row in ((Overlap.start, -1), (Overlap.none, 0)):
        config = ElbowConfig(solutions=2, spread_rad=0.8, overlap=overlap)
        pair = reach(demos=2, points=12, variation=0.0, elbow=config)
        swivels = swivel_rad(channel(pair.trajectories, "joints_rad"))
        np.testing.assert_allclose(swivels[:, row], [-0.8, 0.8], atol=1e-6)
        if overlap is Overlap.start:
            np.testing.assert_allclose(swivels[:, 0], 0, atol=1e-6)


def test_one_solution_has_the_middle_angle():
    np.testing.assert_array_equal(swivels_rad(ElbowConfig(solutions=1, swivel_rad=0.3)), [0.3])


def test_angles_that_joint_limits_forbid_are_refused():
    with pytest.raises(InvalidSetting, match=r"elbow\.spread_rad=2\.5 .* joint limits keep the elbow"):
        reach(demos=3, points=30, elbow=ElbowConfig(spread_rad=2.5))


def test_unknown_targets_are_refused():
    with pytest.raises(InvalidSetting, match=r"dataset\.targets=\[3\] .* 0 to 2"):
        PandaReachJointDataset(name="x", targets=[3])


def test_a_demonstration_does_not_depend_on_how_many_follow(same):
    few, more = (reach(demos=demos, points=10) for demos in (2, 4))
    same(few, more.select([0, 1]))


def test_bottles_in_turn_share_their_joints_half_way():
    pouring = read(PandaPouringJointDataset(name="panda/pouring_joint", demos=3, points=30))
    assert [trajectory.label[:8] for trajectory in pouring.trajectories] == ["bottle 0", "bottle 1", "bottle 2"]
    joints = channel(pouring.trajectories, "joints_rad")
    assert LIMITS.margin_rad(joints).min() > 0.3
    ends = [np.linalg.norm(joints[0, row] - joints[2, row]) for row in (0, -1)]
    nearest = np.linalg.norm(joints[0][:, None] - joints[2], axis=2).min()
    assert nearest < 0.25 < min(ends)
    assert PandaPouringJointDataset(name="x").held_out == 3  # one of each bottle


def test_a_circle_ends_where_it_began_and_solutions_stay_apart():
    circle = read(PandaCircleJointDataset(name="panda/circle_joint", demos=3, points=40, variation=0.0))
    for trajectory in circle.trajectories:
        position = trajectory.channels["position_m"]
        np.testing.assert_allclose(position[0], position[-1], atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm((position - CENTRE_M)[:, :2], axis=1), 0.12, atol=2e-3)
    families = [[trajectory] for trajectory in circle.trajectories]
    for row in (0, 20, -1):
        assert min(apart(families[0], families[1], row), apart(families[1], families[2], row)) > 0.12


def test_the_files_that_ship_are_what_the_generator_makes(demonstrations, close):
    close(demonstrations.select([0]), reach(demos=1))  # 2 s
