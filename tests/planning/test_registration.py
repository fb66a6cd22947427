"""Progress along repetitions of one motion."""

import numpy as np
import pytest

from geomotion.planning.registration import register

SHARES = np.linspace(0, 1, 120)


def curve(progress: np.ndarray) -> np.ndarray:
    """A motion with features all along, poses at some progress."""
    return np.stack([2 * progress, np.sin(9 * progress), np.cos(5 * progress)], axis=1)


def warp(amount: float) -> np.ndarray:
    """Monotone from 0 to 1; slow first where the amount is positive."""
    return SHARES - amount * np.sin(2 * np.pi * SHARES) / (2 * np.pi)


def test_a_known_warp_is_recovered():
    warps = [warp(amount) for amount in (-0.6, -0.2, 0.2, 0.6)]  # their mean is none
    for found, expected in zip(register([curve(one) for one in warps]), warps, strict=True):
        np.testing.assert_allclose(found, expected, atol=0.02)
    assert max(np.abs(one - SHARES).max() for one in warps) > 0.09


def test_registered_paths_agree_better_than_those_at_equal_times():
    warps = [warp(amount) for amount in (-0.7, 0.7)]
    paths = [curve(one) for one in warps]
    before = np.linalg.norm(paths[0] - paths[1], axis=1).mean()
    matched = [
        np.stack([np.interp(SHARES, progress, axis) for axis in path.T], axis=1)
        for progress, path in zip(register(paths), paths, strict=True)
    ]
    assert np.linalg.norm(matched[0] - matched[1], axis=1).mean() < 0.2 * before


def test_paths_with_other_ends_are_registered_by_their_shape():
    warps = [warp(amount) for amount in (-0.5, 0.5)]
    shifts = [np.array([1.0, -0.5, 0.2]), np.array([-1.0, 0.5, -0.2])]
    paths = [curve(one) + (1 - SHARES)[:, None] * shift for one, shift in zip(warps, shifts, strict=True)]
    for found, expected in zip(register(paths), warps, strict=True):
        np.testing.assert_allclose(found, expected, atol=0.05)


@pytest.mark.parametrize("seed", range(5))
def test_progress_rises_from_zero_to_one_for_any_paths(seed):
    generator = np.random.default_rng(seed)
    paths = [generator.normal(size=(60, 3)).cumsum(axis=0) for _ in range(3)]
    paths[0][20:40] = paths[0][20]  # a pause
    for progress in register(paths):
        assert (progress[0], progress[-1]) == (0, 1)
        assert (np.diff(progress) > 0).all()


def test_one_path_and_equal_paths_are_as_they_were():
    for paths in ([curve(SHARES)], [curve(SHARES)] * 3):
        for progress in register(paths):
            np.testing.assert_allclose(progress, SHARES, atol=1e-12)
