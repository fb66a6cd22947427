from pathlib import Path

import numpy as np
import pytest

from geomotion.config import FolderDataset, PandaReachDataset
from geomotion.demos.generators import human
from geomotion.demos.generators.panda_reach import APPROACH_M, HABITS, START_M, TARGETS, approach
from geomotion.demos.readers import read
from geomotion.errors import InvalidSetting

SHIPPED = Path(__file__).resolve().parents[2] / "datasets/panda/reach_to_grasp"


def reach(**settings):
    return read(PandaReachDataset(name="panda/reach_to_grasp", **settings))


def channel(demonstrations, name):
    return np.array([trajectory.channels[name] for trajectory in demonstrations.trajectories])


def hand_axis(q, axis):
    """An axis of the hand in the base frame, for quaternions wxyz."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    columns = {
        "x": (1 - 2 * (y**2 + z**2), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        "z": (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x**2 + y**2)),
    }
    return np.stack(columns[axis], axis=-1)


def degrees_between(a, b):
    return np.degrees(np.arccos(np.clip((a * b).sum(axis=-1), -1, 1)))


@pytest.fixture(scope="module")
def demonstrations():
    return reach()


@pytest.fixture(scope="module")
def repetitions():
    """Sixty repetitions of one intent, before the arm is led: times, positions, orientations."""
    config = PandaReachDataset(name="x", points=50)
    return [human.repeat(straight(), HABITS, config, number) for number in range(60)]


def straight(end_m=(0.4, 0.0, 0.3)):
    places = np.array([[0.4, -0.4, 0.3], [0.45, -0.2, 0.35], end_m])
    return human.Intent(places[0], places, (1.0, 0.0, 0.0, 0.0), (0.5, 0.5, 0.5, 0.5), (0.2, 0.8), "straight")


def test_nine_demonstrations_of_two_hundred_poses_reach_for_three_targets_in_turn(demonstrations):
    assert channel(demonstrations, "position_m").shape == (9, 200, 3)
    assert [trajectory.label for trajectory in demonstrations.trajectories[:4]] == [
        "to target 0", "to target 1", "to target 2", "to target 0",
    ]  # fmt: skip
    assert demonstrations.space == "R3xS3"


def test_orientations_are_unit_and_continuous_in_sign_and_alike(demonstrations):
    q = channel(demonstrations, "orientation_wxyz")
    np.testing.assert_allclose(np.linalg.norm(q, axis=2), 1, atol=1e-12)
    assert np.einsum("dti,dti->dt", q[:, 1:], q[:, :-1]).min() > 0.999
    assert np.einsum("di,i->d", q[:, 0], q[0, 0]).min() > 0.99


def test_the_hand_starts_pointing_down_and_turns_by_a_right_angle_to_the_side(demonstrations):
    q = channel(demonstrations, "orientation_wxyz")
    pointing = hand_axis(q, "z")
    assert degrees_between(pointing[:, 0], np.array([0, 0, -1.0])).max() < 5
    for number, end in enumerate(pointing[:, -1]):
        assert degrees_between(end, approach(TARGETS[number % 3])) < 8
    turns = np.degrees(2 * np.arccos(np.abs(np.einsum("di,di->d", q[:, 0], q[:, -1]))))
    np.testing.assert_allclose(turns, 91, atol=9)


def test_the_hand_closes_in_on_its_target_horizontally(demonstrations):
    for number, trajectory in enumerate(demonstrations.trajectories):
        target, path = TARGETS[number % 3], trajectory.channels["position_m"]
        assert np.linalg.norm(path[-1] - target.place_m) < 0.015
        left = np.linalg.norm(path - path[-1], axis=1)
        before = path[np.flatnonzero(left > APPROACH_M / 2)[-1]]
        towards = (path[-1] - before) / np.linalg.norm(path[-1] - before)
        assert degrees_between(towards, approach(target)) < 20


def test_starts_spread_like_those_of_people_around_one_place(demonstrations):
    starts = channel(demonstrations, "position_m")[:, 0]
    np.testing.assert_allclose(starts.mean(axis=0), START_M, atol=0.015)
    assert ((starts.std(axis=0) > 0.002) & (starts.std(axis=0) < 0.030)).all()  # recorded tasks: 2 to 28 mm


def test_repetitions_differ_about_as_much_as_recorded_ones(repetitions):
    middle = np.array([position[25] for _, position, _ in repetitions])
    ends = np.array([orientation[-1] for _, _, orientation in repetitions])
    durations = np.array([time_s[-1] for time_s, _, _ in repetitions])
    assert ((middle.std(axis=0) > 0.008) & (middle.std(axis=0) < 0.058)).all()  # recorded: 8 to 58 mm
    angles = np.degrees(2 * np.arccos(np.clip(np.abs(ends @ ends.mean(axis=0)), 0, 1)))
    assert 1 < angles.mean() < 8  # recorded: 3 to 8 degrees
    assert 0.08 < durations.std() / 4 < 0.16


def test_the_hand_is_at_rest_at_both_ends_and_fastest_between(demonstrations):
    for trajectory in demonstrations.trajectories:
        speed = np.linalg.norm(np.diff(trajectory.channels["position_m"], axis=0), axis=1)
        assert max(speed[0], speed[-1]) < 0.02 * speed.max()
        assert 40 < speed.argmax() < 160
        assert speed.max() < 0.01  # no jumps


def test_hands_follow_the_two_thirds_power_law_where_the_way_is_curved():
    phase = np.linspace(0, 2 * np.pi, 2000)
    ellipse = np.stack([0.03 * np.cos(phase), 0.015 * np.sin(phase), np.zeros_like(phase)], axis=1)
    np.testing.assert_allclose(human.effort(ellipse), phase / (2 * np.pi), atol=3e-3)  # which it does when harmonic


def test_hands_slow_down_to_turn():
    still = human.effort(np.outer(np.linspace(0, 1, 101), [1.0, 0, 0, 0, 0, 0]))
    turning = np.outer(np.linspace(0, 1, 101), [1.0, 0, 0, 0, 0, 0])
    turning[50:, 3] = np.minimum(np.linspace(0, 2, 51), 1)
    assert still[75] - still[50] == pytest.approx(0.25)
    assert human.effort(turning)[75] - human.effort(turning)[50] > 0.3


def test_the_simulated_arm_reaches_every_pose_within_its_joint_limits(demonstrations, simulated_panda):
    for trajectory in demonstrations.trajectories:
        position, orientation = trajectory.channels["position_m"], trajectory.channels["orientation_wxyz"]
        assert simulated_panda.reaches(trajectory.channels["joints_rad"][0], position, orientation)


def test_recorded_joints_are_those_of_the_recorded_poses(demonstrations, simulated_panda):
    for trajectory in demonstrations.trajectories:
        joints, *poses = (trajectory.channels[name] for name in ("joints_rad", "position_m", "orientation_wxyz"))
        assert simulated_panda.takes(joints, *poses)
        speeds = np.abs(np.diff(joints, axis=0)) / np.diff(trajectory.time_s)[:, None]
        assert speeds.max() < 2.175  # the slowest joint's limit [rad/s]


def test_a_motion_out_of_reach_is_refused_with_its_number():
    config = PandaReachDataset(name="x", points=20)
    with pytest.raises(InvalidSetting, match=r"dataset\.variation=1\.0 .*demonstration 3 leads out of the arm's reach"):
        human.lead_the_arm(straight(end_m=(1.2, 0.0, 0.3)), HABITS, config, 3)


def test_the_same_seed_gives_the_same_demonstrations_and_another_seed_others(same):
    same(reach(demos=2, points=20, seed=4), reach(demos=2, points=20, seed=4))
    one, other = (channel(reach(demos=1, points=20, seed=seed), "position_m") for seed in (4, 5))
    assert not np.array_equal(one, other)


def test_a_demonstration_does_not_depend_on_how_many_follow(demonstrations):
    np.testing.assert_array_equal(
        channel(reach(demos=2), "orientation_wxyz")[1], channel(demonstrations, "orientation_wxyz")[1]
    )


def test_without_variation_motions_to_the_same_target_are_equal():
    demonstrations = reach(demos=4, points=20, variation=0.0)
    np.testing.assert_array_equal(demonstrations[3].time_s, demonstrations[0].time_s)
    for name, values in demonstrations[0].channels.items():
        np.testing.assert_array_equal(demonstrations[3].channels[name], values)


def test_the_dataset_says_that_it_is_generated_and_which_channel_is_derived(demonstrations):
    assert "generated" in demonstrations.source
    assert "joints_rad are derived" in demonstrations.steps[0]


def test_the_files_that_ship_are_what_the_generator_makes(demonstrations, close):
    close(read(FolderDataset(name="folder", root=str(SHIPPED))), demonstrations)
