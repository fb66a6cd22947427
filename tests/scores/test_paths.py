"""Scores of paths of poses: invariances, closed forms, and the baseline on real recordings."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.scores.curves import dtwd_per_point
from geomotion.scores.paths import (
    LEVER_M,
    MotionPath,
    PosePath,
    dimensionless_jerk,
    dtwd_ratio,
    mean_path_with_blended_ends,
    of_one_sign,
    orientation_angles,
    path_length_m,
    pose_dtwd,
    turning_rad,
)

TASKS = ("wineglass", "bottle2shelf", "pouring", "openbox", "scoop", "matfolding")


def smooth(seed: int, count: int, dim: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    shares = np.linspace(0, 1, count)[:, None]
    return generator.normal(size=dim) + shares * generator.normal(size=dim) + np.sin(3 * shares + seed) * 0.3


def pose_path(seed: int, count: int = 30, coordinates: int = 4) -> PosePath:
    orientation = smooth(seed + 50, count, coordinates)
    return PosePath(smooth(seed, count, 3), orientation / np.linalg.norm(orientation, axis=1, keepdims=True))


def with_random_signs(path: PosePath) -> PosePath:
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(len(path), 1))
    return PosePath(path.position_m, signs * path.orientation)


def rigidly_moved(path: PosePath) -> PosePath:
    motion = Rotation.from_rotvec([0.3, -1.2, 2.0])
    turned = motion * Rotation.from_quat(path.orientation, scalar_first=True)
    return PosePath(motion.apply(path.position_m) + np.array([1.0, 2.0, 3.0]), turned.as_quat(scalar_first=True))


@pytest.mark.parametrize("coordinates", [3, 4])
def test_dtwd_is_symmetric_positive_and_zero_on_itself(coordinates):
    one, other = pose_path(1, 30, coordinates), pose_path(2, 17, coordinates)
    assert pose_dtwd(one, one).position == pose_dtwd(one, one).orientation == 0
    forth, back = pose_dtwd(one, other), pose_dtwd(other, one)
    assert forth.position > 0 and forth.orientation > 0
    np.testing.assert_allclose([forth.position, forth.orientation], [back.position, back.orientation])
    assert forth.position == dtwd_per_point(one.position_m, other.position_m)


def test_a_rigid_motion_of_both_paths_and_signs_of_quaternions_change_nothing():
    one, other = pose_path(1), pose_path(2, 17)
    expected = pose_dtwd(one, other)
    moved = pose_dtwd(rigidly_moved(one), rigidly_moved(other))
    np.testing.assert_allclose([moved.position, moved.orientation], [expected.position, expected.orientation])
    flipped = pose_dtwd(with_random_signs(one), other)
    assert flipped.orientation == pytest.approx(expected.orientation, abs=1e-14)


def test_the_angle_between_quaternions_is_that_of_the_rotation_between_them():
    axes = np.random.default_rng(4).normal(size=(2, 40, 3))
    first, second = (Rotation.from_rotvec(axis) for axis in axes)
    found = orientation_angles(first.as_quat(scalar_first=True), -second.as_quat(scalar_first=True))
    expected = [[(one.inv() * other).magnitude() for other in second] for one in first]
    np.testing.assert_allclose(found, expected, atol=1e-7)
    tiny = Rotation.from_rotvec([[0.0, 0, 0], [1e-9, 0, 0]]).as_quat(scalar_first=True)
    np.testing.assert_allclose(orientation_angles(tiny[:1], tiny[1:]), 1e-9)


def test_the_angle_between_directions_is_that_between_the_vectors():
    angles = np.array([0.0, 1e-9, 0.4, 2.0, np.pi])
    directions = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    np.testing.assert_allclose(orientation_angles(directions[:1], directions)[0], angles, atol=1e-14)


# ---------------------------------------------------------------- poses as vectors
@pytest.mark.parametrize("coordinates", [3, 4])
def test_vectors_are_the_same_poses_whatever_the_length_of_their_orientations(coordinates):
    path = pose_path(1, 20, coordinates)
    assert isinstance(path, MotionPath)
    assert path.vectors.shape == (20, 3 + coordinates)
    lengths = np.random.default_rng(0).uniform(0.5, 2, size=(20, 1))
    longer = np.column_stack([path.position_m, lengths * path.orientation])
    for values in (path.vectors, longer):
        again = path.with_vectors(values)
        np.testing.assert_array_equal(again.position_m, path.position_m)
        np.testing.assert_allclose(again.orientation, path.orientation, atol=1e-15)
    assert len(path.with_vectors(path.vectors[3:8])) == 5


def test_signs_are_those_of_known_quaternions_and_directions_have_none():
    path = pose_path(1)
    found = with_random_signs(path).with_signs_of(path)
    np.testing.assert_array_equal(found.vectors, path.vectors)
    direction = PosePath(np.zeros((1, 3)), np.array([[0.0, 0, 1]]))
    opposite = PosePath(np.zeros((1, 3)), np.array([[0.0, 0, -1]]))
    np.testing.assert_array_equal(opposite.with_signs_of(direction).vectors, opposite.vectors)


@pytest.mark.parametrize("coordinates", [3, 4])
def test_residuals_are_the_distances_and_angles_of_one_pose_to_one(coordinates):
    one, other = pose_path(1, 30, coordinates), pose_path(2, 30, coordinates)
    apart_m, apart_rad = one.residuals(other)
    np.testing.assert_allclose(apart_m, np.linalg.norm(one.position_m - other.position_m, axis=1))
    np.testing.assert_allclose(apart_rad, np.diag(orientation_angles(one.orientation, other.orientation)))
    if coordinates == 4:
        np.testing.assert_allclose(with_random_signs(one).residuals(other)[1], apart_rad, atol=1e-14)
    for values in one.residuals(one):
        np.testing.assert_array_equal(values, 0)


def test_steps_count_turning_by_a_lever():
    angles = np.linspace(0, 1, 200)
    turning = Rotation.from_rotvec(np.stack([0 * angles, angles, 0 * angles], axis=1)).as_quat(scalar_first=True)
    still, along = np.zeros((200, 3)), np.linspace([0.0, 0, 0], [0, 0, 0.3], 200)
    one_way = np.tile(turning[:1], (200, 1))
    np.testing.assert_allclose(PosePath(still, turning).steps_m().sum(), LEVER_M, rtol=1e-5)
    np.testing.assert_allclose(PosePath(along, one_way).steps_m().sum(), 0.3)
    np.testing.assert_allclose(PosePath(along, turning).steps_m().sum(), np.hypot(0.3, LEVER_M), rtol=1e-5)


# ---------------------------------------------------------------- distances
def test_a_path_that_stays_a_distance_aside_scores_that_distance_twice():
    one = PosePath(np.linspace([0.0, 0, 0], [1, 0, 0], 20), np.tile([1.0, 0, 0, 0], (20, 1)))
    turned = np.tile(Rotation.from_rotvec([0, 0.2, 0]).as_quat(scalar_first=True), (20, 1))
    distance = pose_dtwd(one, PosePath(one.position_m + np.array([0, 0, 0.1]), turned))
    np.testing.assert_allclose([distance.position, distance.orientation], [0.2, 0.4])


def test_the_ratio_is_zero_for_the_demonstration_itself_and_one_for_its_only_neighbour():
    demo, other = pose_path(1), pose_path(2)
    itself, neighbour = dtwd_ratio(demo, demo, [other]), dtwd_ratio(other, demo, [other])
    assert (itself.position, itself.orientation) == (0, 0)
    np.testing.assert_allclose([neighbour.position, neighbour.orientation], [1, 1])


@pytest.mark.parametrize("coordinates", [3, 4])
def test_the_baseline_has_the_wanted_ends_and_returns_a_single_demonstration(coordinates):
    demos = [pose_path(seed, 30 + seed, coordinates) for seed in range(3)]
    ends = pose_path(7, 12, coordinates)
    path = mean_path_with_blended_ends(demos, ends, ends, count=50)
    np.testing.assert_allclose(path.position_m[[0, -1]], ends.position_m[[0, -1]])
    angles = orientation_angles(path.orientation[[0, -1]], ends.orientation[[0, -1]])
    np.testing.assert_allclose(np.diag(angles), 0, atol=1e-7)
    only = mean_path_with_blended_ends(demos[:1], demos[0], demos[0], count=len(demos[0]))
    distance = pose_dtwd(only, demos[0])
    assert distance.position < 1e-12 and distance.orientation < 1e-7


def test_signs_of_quaternions_change_no_baseline():
    demos = [pose_path(seed) for seed in range(3)]
    path = mean_path_with_blended_ends(demos, demos[0], demos[1])
    flipped = mean_path_with_blended_ends([with_random_signs(demo) for demo in demos], demos[0], demos[1])
    np.testing.assert_allclose(np.diag(orientation_angles(path.orientation, flipped.orientation)), 0, atol=1e-12)
    assert ((path.orientation[1:] * path.orientation[:-1]).sum(axis=1) > 0).all()


def test_signs_are_mended_along_a_path_but_directions_left_alone():
    path = pose_path(1, 100)
    mended = of_one_sign(with_random_signs(path).orientation)
    np.testing.assert_allclose(np.abs(mended), np.abs(path.orientation))
    assert ((mended[1:] * mended[:-1]).sum(axis=1) > 0).all()
    there_and_back = np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    np.testing.assert_array_equal(of_one_sign(there_and_back), there_and_back)


def test_length_and_turning_of_a_circle_and_of_a_line():
    angles = np.linspace(0, 2 * np.pi, 400)
    circle = 0.3 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    np.testing.assert_allclose(path_length_m(circle), 0.6 * np.pi, rtol=1e-4)
    pieces = round(0.6 * np.pi / 0.01)
    np.testing.assert_allclose(turning_rad(circle), 2 * np.pi * (pieces - 1) / pieces, rtol=1e-3)
    assert turning_rad(np.linspace([0.0, 0, 0], [1, 1, 1], 50)) < 1e-6
    corner = np.array([[0.0, 0], [0.5, 0], [0.5, 0.5]])
    np.testing.assert_allclose(turning_rad(corner), np.pi / 2)


def test_turning_ignores_wiggles_below_the_spacing_and_points_passed_twice():
    line = np.linspace([0.0, 0], [1, 0], 2001)
    wiggly = line + np.stack([np.zeros(2001), 1e-4 * (-1.0) ** np.arange(2001)], axis=1)
    assert turning_rad(wiggly) < 3 < turning_rad(wiggly, 1e-3)
    corner = np.array([[0.0, 0], [0.5, 0], [0.5, 0], [0.5, 0.5]])
    np.testing.assert_allclose(turning_rad(corner), np.pi / 2)
    assert turning_rad(np.zeros((5, 3))) == 0


def test_a_straight_motion_of_minimum_jerk_has_the_smallest_jerk_whatever_its_size():
    s = np.linspace(0, 1, 2001)[:, None]
    best = (10 * s**3 - 15 * s**4 + 6 * s**5) * np.array([0.3, -0.1, 0.2])
    np.testing.assert_allclose(dimensionless_jerk(best), 720, rtol=1e-2)
    np.testing.assert_allclose(dimensionless_jerk(7 * best + 1), dimensionless_jerk(best), rtol=1e-6)
    wavy = best + 0.01 * np.sin(6 * np.pi * s)
    assert dimensionless_jerk(wavy) > 2 * dimensionless_jerk(best)


@pytest.fixture
def task(robotasks9_folder: Path) -> Callable[[str], list[PosePath]]:
    """Nine demonstrations of a task, thinned to 200 poses."""

    def read(name: str) -> list[PosePath]:
        poses = np.load(robotasks9_folder / f"{name}.npy")
        poses = poses[:, np.linspace(0, poses.shape[1] - 1, 200).astype(int)]
        quaternions = poses[..., 3:] / np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True)
        return [PosePath(0.01 * x, q) for x, q in zip(poses[..., :3], quaternions, strict=True)]

    return read


def test_the_baseline_is_half_as_far_from_held_out_recordings_as_the_recordings_from_each_other(task):
    ratios = []
    for name in TASKS:
        demos = task(name)
        for held_out in demos[7:]:
            path = mean_path_with_blended_ends(demos[:7], held_out, held_out)
            ratio = dtwd_ratio(path, held_out, demos[:7])
            ratios.append([ratio.position, ratio.orientation])
    np.testing.assert_allclose(np.mean(ratios, axis=0), [0.519, 0.532], atol=1e-3)


def test_what_makes_no_path_is_refused():
    identity = np.array([[1.0, 0, 0, 0]])
    with pytest.raises(ShapeMismatch, match="orientations of a path"):
        PosePath(np.zeros((2, 3)), identity)
    with pytest.raises(ShapeMismatch, match="3 or 4, found 2"):
        PosePath(np.zeros((1, 3)), identity[:, :2])
    with pytest.raises(InvalidSetting, match="no pose"):
        PosePath(np.zeros((0, 3)), np.zeros((0, 4)))
    for broken in (2 * identity, np.nan * identity):
        with pytest.raises(InvalidSetting, match="unit vectors"):
            PosePath(np.zeros((1, 3)), broken)
    with pytest.raises(InvalidSetting, match="spacing_m"):
        turning_rad(np.zeros((2, 3)), 0.0)
    with pytest.raises(ShapeMismatch, match="4 or more"):
        dimensionless_jerk(np.zeros((3, 3)))
    with pytest.raises(InvalidSetting, match="a path that moves"):
        dimensionless_jerk(np.zeros((9, 3)))
