from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest

from geomotion.config import FolderDataset, PandaPouringDataset
from geomotion.demos.generators.panda_pouring import (
    BOTTLES_M,
    CROSSING_M,
    CUP_OF_BOTTLE,
    CUPS_M,
    NECK_M,
    UPRIGHT_WXYZ,
    grasp_pose,
    pour_pose,
)
from geomotion.demos.readers import read
from geomotion.demos.selection import split

SHIPPED = Path(__file__).resolve().parents[2] / "datasets/panda/pouring_3x3"
GROUPS = range(3)
MEETING_M, MEETING_RAD = 0.012, np.radians(5)  # how near the bundles come to each other
LEVER_M = 0.2


def pouring(**settings):
    return read(PandaPouringDataset(name="panda/pouring_3x3", **settings))


def channel(demonstrations, name):
    return np.array([trajectory.channels[name] for trajectory in demonstrations.trajectories])


def angles(a, b):
    """Angles between rotations [rad], for quaternions of shape (…, 4)."""
    return 2 * np.arccos(np.clip(np.abs((a * b).sum(axis=-1)), 0, 1))


def nearest_poses(one, other):
    """Rows of two trajectories at which their poses are nearest, and what lies between them [m], [rad]."""
    (x, q), (y, r) = ([t.channels[name] for name in ("position_m", "orientation_wxyz")] for t in (one, other))
    distance = np.linalg.norm(x[:, None] - y, axis=2)
    angle = angles(q[:, None], r)
    row, column = np.unravel_index((distance + LEVER_M * angle).argmin(), distance.shape)
    return row, column, distance[row, column], angle[row, column]


@pytest.fixture(scope="module")
def demonstrations():
    return pouring()


@pytest.fixture(scope="module")
def groups(demonstrations):
    """The demonstrations of each bottle."""
    return [demonstrations.trajectories[bottle::3] for bottle in GROUPS]


def test_three_groups_of_six_demonstrations_are_labelled_by_bottle_and_cup(groups):
    for bottle, group in enumerate(groups):
        assert [trajectory.label for trajectory in group] == [f"bottle {bottle} to cup {CUP_OF_BOTTLE[bottle]}"] * 6
        assert {len(trajectory) for trajectory in group} == {150}
    assert sorted(CUP_OF_BOTTLE) == list(GROUPS)


def test_one_demonstration_of_every_group_is_held_out(demonstrations):
    train, test = split(PandaPouringDataset(name="x"), demonstrations)
    assert sorted(demonstrations[number].label for number in test) == [f"bottle {i} to cup {2 - i}" for i in GROUPS]
    assert len(train) == 15
    assert split(PandaPouringDataset(name="x", train_demos=[0]), demonstrations)[0] == (0,)


def test_every_demonstration_starts_at_its_bottle_and_ends_with_the_mouth_over_its_cup(groups):
    for bottle, group in enumerate(groups):
        for trajectory in group:
            position, q = trajectory.channels["position_m"], trajectory.channels["orientation_wxyz"]
            assert np.linalg.norm(position[0] - BOTTLES_M[bottle]) < 0.02
            w, x, y, z = q[-1]
            up = np.array(
                [1 - 2 * (y**2 + z**2), 2 * (x * y + w * z), 2 * (x * z - w * y)]
            )  # the bottle's, once upright
            aside = position[-1] + NECK_M * up - CUPS_M[CUP_OF_BOTTLE[bottle]]
            assert np.linalg.norm(aside[:2]) < 0.04
            assert 0.02 < aside[2] < 0.10


def test_starts_and_ends_spread_like_those_of_people(groups):
    for group in groups:
        for row, low, high in ((0, 0.001, 0.03), (-1, 0.002, 0.03)):
            spread = np.std([trajectory.channels["position_m"][row] for trajectory in group], axis=0)
            assert np.linalg.norm(spread) < high
            assert np.linalg.norm(spread) > low


def test_bottles_stay_upright_until_they_are_near_their_cups(demonstrations):
    tilt = np.degrees(angles(channel(demonstrations, "orientation_wxyz"), np.array(UPRIGHT_WXYZ)))
    position = channel(demonstrations, "position_m")
    for number, cup in enumerate(CUP_OF_BOTTLE * 6):
        place, _ = pour_pose(cup)
        far = np.linalg.norm(position[number] - place, axis=1) > 0.2
        assert tilt[number, far].max() < 15
    np.testing.assert_allclose(tilt[:, -1], 95, atol=12)


def test_all_demonstrations_pass_one_pose_half_way(demonstrations):
    for trajectory in demonstrations.trajectories:
        away = np.linalg.norm(trajectory.channels["position_m"] - CROSSING_M, axis=1)
        row = away.argmin()
        assert away[row] < 0.04
        assert np.degrees(angles(trajectory.channels["orientation_wxyz"][row], np.array(UPRIGHT_WXYZ))) < 9
        assert 50 < row < 100


@pytest.mark.parametrize(("one", "other"), combinations(GROUPS, 2))
def test_groups_cross_each_other_in_position_and_orientation_and_are_apart_at_their_ends(groups, one, other):
    meetings = [(a, b, *nearest_poses(a, b)) for a, b in product(groups[one], groups[other])]
    a, b, row, column, distance, angle = min(meetings, key=lambda found: found[4] + LEVER_M * found[5])
    assert distance < MEETING_M
    assert angle < MEETING_RAD
    x, y = a.channels["position_m"], b.channels["position_m"]
    ways = np.stack([x[row + 2] - x[row - 2], y[column + 2] - y[column - 2]])
    first, second = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    assert np.degrees(np.arccos(first @ second)) > 15  # they cross, they do not merge
    for end in (0, -1):
        assert (
            min(np.linalg.norm(a.channels["position_m"][end] - b.channels["position_m"][end]) for a, b, *_ in meetings)
            > 0.08
        )


def test_all_nine_pairs_of_bottle_and_cup_are_feasible_by_changing_groups_at_the_crossing(groups):
    for bottle, cup in product(GROUPS, GROUPS):
        begun, ended = groups[bottle], groups[CUP_OF_BOTTLE.index(cup)]
        gaps = [nearest_poses(a, b)[2:] for a, b in product(begun, ended) if a is not b]
        assert any(distance < MEETING_M and angle < MEETING_RAD for distance, angle in gaps)


def test_orientations_are_unit_and_continuous_in_sign_and_alike(demonstrations):
    q = channel(demonstrations, "orientation_wxyz")
    np.testing.assert_allclose(np.linalg.norm(q, axis=2), 1, atol=1e-12)
    assert np.einsum("dti,dti->dt", q[:, 1:], q[:, :-1]).min() > 0.999
    assert np.einsum("di,i->d", q[:, 0], q[0, 0]).min() > 0.99


def test_the_simulated_arm_reaches_every_pose_within_its_joint_limits(demonstrations, simulated_panda):
    for trajectory in demonstrations.trajectories:
        position, orientation = trajectory.channels["position_m"], trajectory.channels["orientation_wxyz"]
        assert simulated_panda.reaches(trajectory.channels["joints_rad"][0], position, orientation)


def test_recorded_joints_are_those_of_the_recorded_poses_with_the_elbow_on_one_side(demonstrations, simulated_panda):
    for trajectory in demonstrations.trajectories:
        joints, *poses = (trajectory.channels[name] for name in ("joints_rad", "position_m", "orientation_wxyz"))
        assert simulated_panda.takes(joints, *poses)
    assert np.ptp(channel(demonstrations, "joints_rad")[:, 65], axis=0).max() < 0.9  # at the crossing [rad]


@pytest.mark.parametrize("pair", product(GROUPS, GROUPS))
def test_every_start_and_goal_can_be_reached(pair, simulated_panda, demonstrations):
    bottle, cup = pair
    for (place, orientation), number, row in (
        (grasp_pose(bottle), bottle, 0),
        (pour_pose(cup), CUP_OF_BOTTLE.index(cup), -1),
    ):
        near = demonstrations[number].channels["joints_rad"][row]
        assert simulated_panda.reaches(near, np.array([place]), np.array([orientation]))


def test_the_same_seed_gives_the_same_demonstrations_and_another_seed_others(same):
    same(pouring(demos=2, points=20, seed=4), pouring(demos=2, points=20, seed=4))
    one, other = (channel(pouring(demos=1, points=20, seed=seed), "position_m") for seed in (4, 5))
    assert not np.array_equal(one, other)


def test_a_demonstration_does_not_depend_on_how_many_follow(demonstrations):
    np.testing.assert_array_equal(
        channel(pouring(demos=2), "orientation_wxyz")[1], channel(demonstrations, "orientation_wxyz")[1]
    )


def test_without_variation_demonstrations_of_a_group_are_equal():
    demonstrations = pouring(demos=4, points=20, variation=0.0)
    for name, values in demonstrations[0].channels.items():
        np.testing.assert_array_equal(demonstrations[3].channels[name], values)
        assert not np.array_equal(demonstrations[1].channels[name], values)


def test_the_dataset_says_that_it_is_generated(demonstrations):
    assert "generated" in demonstrations.source
    assert "not recorded from people" in demonstrations.source


def test_the_files_that_ship_are_what_the_generator_makes(demonstrations, close):
    close(read(FolderDataset(name="folder", root=str(SHIPPED))), demonstrations)
