"""Demonstrated states as a training set."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from geomotion.config import Antipodal, ManifoldConfig
from geomotion.scores.paths import PosePath
from geomotion.training.kinds import Kind, kind_of
from geomotion.training.poses import PoseSpace, both_signs
from geomotion.training.states import TrainingSet

POINTS = 40
SHARES = np.linspace(0, 1, POINTS)


def path(offset_m: float = 0.0, angle_rad: float = 0.0, slow: float = 0.0) -> PosePath:
    """An arc beside others, turning on the way, slow at first."""
    done = SHARES - slow * np.sin(2 * np.pi * SHARES) / (2 * np.pi)
    position = np.stack([done, np.sin(3 * done) + offset_m, np.full(POINTS, 0.5)], axis=1)
    turns = Rotation.from_rotvec(np.stack([0 * done, 0 * done, done + angle_rad], axis=1))
    return PosePath(position, turns.as_quat(scalar_first=True))


PATHS = [path(-0.1, -0.2, 0.3), path(0.0, 0.0), path(0.1, 0.2, -0.3), path(3.0, 1.0), path(3.2, 1.1)]
GROUPS = ["left", "left", "left", "right", "right"]


def training_set(carry: bool = False) -> TrainingSet:
    return TrainingSet.of(PoseSpace.of(PATHS), PATHS, GROUPS, carry)


def test_directions_in_the_plane_are_taken_too():
    flat = PosePath(SHARES[:, None] * np.array([1.0, 2.0]), np.tile([0.0, 0, 1], (POINTS, 1)))
    data = TrainingSet.of(PoseSpace.of([flat]), [flat], [""], carry=True)
    assert data.space == PoseSpace.of([flat]) and (data.space.position_dim, data.space.orientation_dim) == (2, 3)
    poses, progress = data.tensors(3, 0)
    assert poses.shape == (POINTS, 5) and len(progress) == POINTS  # nothing to mix with


def test_demonstrations_are_registered_within_their_groups():
    data = training_set()
    assert data.groups == (0, 0, 0, 1, 1)
    for progress in data.progress:
        assert (progress[0], progress[-1]) == (0, 1) and (np.diff(progress) > 0).all()
    slow, even, fast = data.progress[:3]
    assert slow[POINTS // 4] < even[POINTS // 4] - 0.02 and fast[POINTS // 4] > even[POINTS // 4] + 0.02
    np.testing.assert_allclose(data.progress[3], SHARES, atol=0.02)
    alone = TrainingSet.of(PoseSpace.of(PATHS[3:]), PATHS[3:], GROUPS[3:], carry=False)
    np.testing.assert_allclose(data.progress[3], alone.progress[0], atol=1e-6)


def test_carried_demonstrations_share_the_ends_of_their_group_and_keep_their_originals():
    data = training_set(carry=True)
    for group in (0, 1):
        members = [one for number, one in enumerate(data.paths) if data.groups[number] == group]
        for end in (0, -1):
            positions = np.stack([one.position_m[end] for one in members])
            wanted = np.mean(
                [one.position_m[end] for one, g in zip(PATHS, data.groups, strict=True) if g == group], axis=0
            )
            np.testing.assert_allclose(positions, np.tile(wanted, (len(members), 1)), atol=1e-12)
            orientations = np.stack([one.orientation[end] for one in members])
            np.testing.assert_allclose(orientations, orientations[[0] * len(members)], atol=1e-12)
    for original, one in zip(data.originals, PATHS, strict=True):
        np.testing.assert_array_equal(original.position_m, one.position_m)
    as_they_are = training_set(carry=False)
    np.testing.assert_array_equal(as_they_are.paths[2].position_m, PATHS[2].position_m)


def test_tensors_hold_every_state_with_its_progress():
    data = training_set()
    poses, progress = data.tensors(0, 0)
    assert poses.dtype is progress.dtype is torch.float32
    np.testing.assert_allclose(poses.numpy(), np.concatenate([data.space.scaled(one) for one in PATHS]), atol=1e-6)
    np.testing.assert_allclose(progress.numpy(), np.concatenate(data.progress), atol=1e-6)


@pytest.mark.parametrize("antipodal", list(Antipodal))
def test_both_signs_are_shown_unless_they_are_aligned(antipodal):
    data = training_set()
    kind = kind_of(data, ManifoldConfig(antipodal=antipodal))
    assert isinstance(kind, Kind)
    found, shown = kind.samples(2, 0), data.tensors(2, 0)
    expected = shown if antipodal is Antipodal.aligned else both_signs(*shown, position_dim=3)
    for one, other in zip(found, expected, strict=True):
        assert torch.equal(one, other)
    assert kind.orientation_at == (3 if antipodal is Antipodal.mixture else None)


def test_mixtures_lie_between_demonstrations_of_one_group_at_equal_progress():
    data, copies = training_set(), 4
    poses, progress = data.tensors(copies, 0)
    originals = len(PATHS) * POINTS
    assert len(poses) == (1 + copies) * originals
    mixed = poses[originals:].reshape(len(PATHS), copies, POINTS, 7).numpy()
    shares = progress[originals:].reshape(len(PATHS), copies, POINTS).numpy()
    np.testing.assert_allclose(np.linalg.norm(mixed[..., 3:], axis=-1), 1, atol=1e-6)
    scaled = [data.space.scaled(one) for one in data.paths]
    for number, group in enumerate(data.groups):
        np.testing.assert_allclose(shares[number], np.tile(data.progress[number], (copies, 1)), atol=1e-6)
        matched = np.stack(
            [
                np.stack(
                    [np.interp(data.progress[number], data.progress[other], axis) for axis in scaled[other].T[:3]],
                    axis=1,
                )
                for other in range(len(PATHS))
                if data.groups[other] == group
            ]
        )
        low, high = matched.min(axis=0) - 1e-5, matched.max(axis=0) + 1e-5
        assert ((mixed[number, ..., :3] >= low) & (mixed[number, ..., :3] <= high)).all()
    assert np.ptp(mixed[0, :, 0, 1]) > 1e-3  # shares differ


def test_mixtures_follow_their_seed():
    data = training_set()
    one, again, other = (data.tensors(3, seed)[0] for seed in (0, 0, 1))
    assert torch.equal(one, again) and not torch.equal(one, other)
