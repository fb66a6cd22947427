"""Small recordings whose every number is known."""

import numpy as np
import pytest

from geomotion.demos.demonstrations import Demonstrations, Trajectory


def circle(points=50, radius=0.1, label="", phase=0.0):
    """A quarter of a circle and its true velocity, at uneven times."""
    time_s = np.linspace(0.0, 1.0, points) ** 1.2
    angle = phase + np.pi / 2 * time_s
    return Trajectory(
        time_s,
        {
            "position_m": radius * np.stack([np.cos(angle), np.sin(angle)], axis=1),
            "velocity_m_per_s": radius * np.pi / 2 * np.stack([-np.sin(angle), np.cos(angle)], axis=1),
        },
        label,
    )


@pytest.fixture
def circles():
    trajectories = tuple(circle(points, label=f"quarter {points}") for points in (40, 50, 60, 70))
    return Demonstrations(
        "test/circles", trajectories, "R2", "table", "a formula", "none", steps=("drawn with a compass",)
    )


@pytest.fixture
def poses():
    """Positions in space with orientations turning about z, and joints."""
    time_s = np.linspace(0.0, 2.0, 41)
    half = time_s / 2
    zero = np.zeros_like(half)
    channels = {
        "joints_rad": np.stack([time_s, -time_s, time_s**2], axis=1),
        "orientation_wxyz": np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1),
        "position_m": np.stack([time_s, time_s**2, time_s**3], axis=1),
    }
    trajectories = (
        Trajectory(time_s, channels, "a"),
        Trajectory(time_s[:30], {k: v[:30] for k, v in channels.items()}, "b"),
    )
    return Demonstrations("test/poses", trajectories, "R3xS3xjoint")


def assert_same(found, expected):
    """Equal to the last bit."""
    for name in ("name", "space", "frame", "source", "licence", "steps"):
        assert getattr(found, name) == getattr(expected, name)
    assert len(found) == len(expected)
    for one, other in zip(found.trajectories, expected.trajectories, strict=True):
        assert one.label == other.label
        assert list(one.channels) == list(other.channels)
        np.testing.assert_array_equal(one.time_s, other.time_s)
        for name, values in other.channels.items():
            np.testing.assert_array_equal(one.channels[name], values)


@pytest.fixture
def same():
    return assert_same
