"""Configurations as states: against an arm in the plane whose kinematics are in closed form."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from geomotion.errors import InvalidSetting
from geomotion.scores.configurations import (
    ConfigurationPath,
    ConfigurationSupport,
    joint_dtwd,
    mean_configurations_with_blended_ends,
)
from geomotion.scores.curves import dtwd_per_point
from geomotion.scores.paths import LEVER_M, MotionPath
from geomotion.scores.pose_support import leave_one_out

LINKS_M = np.array([0.3, 0.25])


def kinematics(joints_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """End effector of two links in the plane."""
    angles = np.cumsum(joints_rad, axis=-1)
    position = np.stack(
        [(LINKS_M * np.cos(angles)).sum(-1), (LINKS_M * np.sin(angles)).sum(-1), 0 * angles[..., 0]], -1
    )
    half, none = angles[..., -1] / 2, np.zeros(angles.shape[:-1])
    return position, np.stack([np.cos(half), none, none, np.sin(half)], axis=-1)


def path(seed: int = 0, count: int = 30) -> ConfigurationPath:
    """Both joints swing, smoothly."""
    generator, shares = np.random.default_rng(seed), np.linspace(0, 1, count)[:, None]
    joints = generator.normal(size=2) + shares * generator.normal(size=2) + 0.3 * np.sin(3 * shares + seed)
    return ConfigurationPath(joints, kinematics)


def both_solutions(shoulder_rad: np.ndarray, bend_rad: float) -> tuple[ConfigurationPath, ConfigurationPath]:
    """Elbow on one side and on the other, for the same places of the end effector."""
    aside = 2 * np.arctan2(LINKS_M[1] * np.sin(bend_rad), LINKS_M[0] + LINKS_M[1] * np.cos(bend_rad))
    bends = np.full(len(shoulder_rad), bend_rad)
    joints = (shoulder_rad, bends), (shoulder_rad + aside, -bends)
    one, other = (ConfigurationPath(np.stack(each, axis=1), kinematics) for each in joints)
    np.testing.assert_allclose(one.position_m, other.position_m, atol=1e-12)
    return one, other


def test_a_configuration_path_is_a_motion_of_its_end_effector():
    found = path()
    assert isinstance(found, MotionPath) and len(found) == 30
    position_m, orientation = kinematics(found.joints_rad)
    np.testing.assert_array_equal(found.position_m, position_m)
    np.testing.assert_array_equal(found.orientation, orientation)
    np.testing.assert_array_equal(found[3:7].position_m, position_m[3:7])
    np.testing.assert_array_equal(found.vectors, found.joints_rad)
    np.testing.assert_array_equal(found.with_vectors(found.vectors[:5] + 1).joints_rad, found.joints_rad[:5] + 1)
    assert found.with_signs_of(path(1)) is found
    with pytest.raises(InvalidSetting, match="no configuration"):
        ConfigurationPath(np.zeros((0, 2)), kinematics)


def test_the_arm_is_asked_for_its_end_effector_only_once_and_only_if_needed():
    asked = []

    def counting(joints_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked.append(len(joints_rad))
        return kinematics(joints_rad)

    found = ConfigurationPath(path().joints_rad, counting)
    moved = found.with_vectors(found.vectors + 0.1)
    assert asked == []
    assert moved.position_m.shape == (30, 3) and moved.orientation.shape == (30, 4)
    assert asked == [30]


# ---------------------------------------------------------------- resampling, steps, residuals
@pytest.mark.parametrize("count", [2, 7, 59, 400])
def test_resampling_keeps_the_ends_and_what_is_linear(count):
    bent = path().resampled(count)
    np.testing.assert_allclose(bent.joints_rad[[0, -1]], path().joints_rad[[0, -1]])
    line = ConfigurationPath(np.linspace([0.0, 1], [2, -3], 10), kinematics).resampled(count)
    np.testing.assert_allclose(line.joints_rad, np.linspace([0.0, 1], [2, -3], count), atol=1e-15)


def test_resampling_at_every_second_state_is_to_leave_states_out():
    np.testing.assert_allclose(path(count=31).resampled(16).joints_rad, path(count=31).joints_rad[::2], atol=1e-14)


def test_steps_are_those_of_the_end_effector_and_of_the_joints_by_a_lever():
    found = path()
    in_m = np.linalg.norm(np.diff(kinematics(found.joints_rad)[0], axis=0), axis=1)
    in_rad = np.linalg.norm(np.diff(found.joints_rad, axis=0), axis=1)
    np.testing.assert_allclose(found.steps_m(), np.sqrt(in_m**2 + (LEVER_M * in_rad) ** 2))


def test_a_self_motion_has_a_length_although_the_end_effector_stays():
    one, other = both_solutions(np.array([0.4]), 1.2)
    apart_m, apart_rad = one.residuals(other)
    turned = np.linalg.norm(one.joints_rad - other.joints_rad)
    assert turned > 2.4
    np.testing.assert_allclose(apart_m, 0, atol=1e-12)
    np.testing.assert_allclose(apart_rad, turned)
    there = one.with_vectors(np.concatenate([one.joints_rad, other.joints_rad]))
    np.testing.assert_allclose(there.steps_m(), LEVER_M * turned)


def test_residuals_are_those_of_one_configuration_to_one():
    one, other = path(1), path(2)
    apart_m, apart_rad = one.residuals(other)
    np.testing.assert_allclose(apart_m, np.linalg.norm(one.position_m - other.position_m, axis=1))
    np.testing.assert_allclose(apart_rad, np.linalg.norm(one.joints_rad - other.joints_rad, axis=1))
    for values in one.residuals(one):
        np.testing.assert_array_equal(values, 0)


def test_distances_of_whole_paths_are_those_of_their_joints():
    one, other = path(1), path(2, 17)
    assert joint_dtwd(one, other) == joint_dtwd(other, one) == dtwd_per_point(one.joints_rad, other.joints_rad) > 0
    assert joint_dtwd(one, one) == 0


# ---------------------------------------------------------------- support
@pytest.mark.parametrize("count", [5, 300])
def test_support_is_that_of_brute_force(count):
    demonstrations, asked = [path(0, count), path(1, count)], path(2, 50)
    found_m, found_rad = ConfigurationSupport.of(demonstrations).distances(asked)
    known = np.concatenate([one.joints_rad for one in demonstrations])
    np.testing.assert_allclose(found_rad, cdist(asked.joints_rad, known).min(axis=1))
    np.testing.assert_allclose(found_m, cdist(asked.position_m, kinematics(known)[0]).min(axis=1))


def test_demonstrated_configurations_are_at_distance_zero():
    for apart in ConfigurationSupport.of([path(0), path(1)]).distances(path(1)):
        np.testing.assert_array_equal(apart, 0)


def test_another_solution_for_a_demonstrated_place_is_away_from_the_demonstrations():
    shown, other = both_solutions(np.linspace(0, 0.5, 60), 1.2)
    support = ConfigurationSupport.of([shown])
    apart_m, apart_rad = support.distances(other)
    assert apart_m.max() < 1e-12 and apart_rad.min() >= 2.4
    assert support.share_within(other.position_m, 1e-9) == 1.0
    assert support.share_within(other.position_m + np.array([0, 0, 0.1]), 0.09) == 0.0


def test_leave_one_out_takes_the_support_of_configurations():
    one, other = both_solutions(np.linspace(0, 0.5, 60), 1.2)
    near = one.with_vectors(one.joints_rad + np.array([0, 0.001]))
    in_m, in_rad = leave_one_out([one, near, other], ConfigurationSupport.of)
    np.testing.assert_allclose(in_rad[:2], 0.001)
    assert in_m.max() < 1e-3 and in_rad[2] > 2.4  # the end effector does the same, the arm does not


# ---------------------------------------------------------------- the baseline
def test_the_baseline_meets_its_ends_exactly_and_returns_a_single_demonstration():
    demonstrations = [path(seed, 30 + seed) for seed in range(3)]
    start, goal = path(7)[:1], path(8)[-1:]
    found = mean_configurations_with_blended_ends(demonstrations, start, goal, count=50)
    assert len(found) == 50
    np.testing.assert_allclose(found.joints_rad[[0, -1]], [start.joints_rad[0], goal.joints_rad[0]], atol=1e-15)
    np.testing.assert_allclose(found.position_m[0], start.position_m[0], atol=1e-15)
    only = mean_configurations_with_blended_ends(demonstrations[:1], demonstrations[0], demonstrations[0], count=30)
    np.testing.assert_allclose(only.joints_rad, demonstrations[0].joints_rad, atol=1e-14)


def test_the_baseline_between_the_mean_ends_is_the_mean():
    demonstrations = [path(seed) for seed in range(4)]
    mean = np.mean([one.joints_rad for one in demonstrations], axis=0)
    ends = ConfigurationPath(mean, kinematics)
    found = mean_configurations_with_blended_ends(demonstrations, ends, ends, count=30)
    np.testing.assert_allclose(found.joints_rad, mean, atol=1e-14)
