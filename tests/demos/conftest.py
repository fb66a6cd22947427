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
    for name in ("name", "space", "frame", "source", "licence", "steps", "joint_names"):
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


@pytest.fixture
def close():
    """Equal but for rounding, which differs between machines and shows in joints more than in poses."""

    def assert_close(found, expected):
        assert (found.name, found.space, found.source, found.steps) == (
            expected.name, expected.space, expected.source, expected.steps,
        )  # fmt: skip
        assert [item.label for item in found.trajectories] == [item.label for item in expected.trajectories]
        for one, other in zip(found.trajectories, expected.trajectories, strict=True):
            np.testing.assert_allclose(one.time_s, other.time_s, rtol=0, atol=1e-9)
            for name, values in other.channels.items():
                tolerance = 1e-5 if name == "joints_rad" else 1e-8
                np.testing.assert_allclose(one.channels[name], values, rtol=0, atol=tolerance)

    return assert_close


class SimulatedPanda:
    """The arm of pybullet_data in PyBullet, as an independent judge of poses and joints."""

    GRASP_TARGET = 11
    MOVABLE = (0, 1, 2, 3, 4, 5, 6, 9, 10)
    FINGERS_M = (0.02, 0.02)

    def __init__(self):
        import pybullet
        import pybullet_data

        self.bullet = pybullet
        self.client = pybullet.connect(pybullet.DIRECT)
        urdf = f"{pybullet_data.getDataPath()}/franka_panda/panda.urdf"
        self.arm = pybullet.loadURDF(urdf, useFixedBase=True, physicsClientId=self.client)
        infos = [pybullet.getJointInfo(self.arm, joint, physicsClientId=self.client) for joint in range(7)]
        self.lower_rad, self.upper_rad = np.array([info[8:10] for info in infos]).T

    def within_limits(self, joints_rad):
        return bool(((joints_rad > self.lower_rad) & (joints_rad < self.upper_rad)).all())

    def takes(self, joints_rad, positions_m, orientations_wxyz):
        """Whether these joint positions, within their limits, bring the grasp target to these poses."""
        found = [
            self._away(joints, *pose) for joints, *pose in zip(joints_rad, positions_m, orientations_wxyz, strict=True)
        ]
        distances_m, angles_rad = np.array(found).T
        return self.within_limits(joints_rad) and max(distances_m) < 1e-5 and max(angles_rad) < 1e-5

    def reaches(self, start_rad, positions_m, orientations_wxyz):
        """Whether plain inverse kinematics, warm-started, comes within 1 mm and 0.5 degrees of every pose."""
        joints = start_rad
        for position, orientation in zip(positions_m, orientations_wxyz, strict=True):
            for _ in range(2):
                joints = self._solve(joints, position, orientation)
                distance_m, angle_rad = self._away(joints, position, orientation)
            if distance_m > 1e-3 or angle_rad > np.radians(0.5) or not self.within_limits(joints):
                return False
        return True

    def _solve(self, start_rad, position_m, orientation_wxyz):
        self._move(start_rad)
        w, x, y, z = (float(value) for value in orientation_wxyz)
        found = self.bullet.calculateInverseKinematics(
            self.arm, self.GRASP_TARGET, [float(value) for value in position_m], [x, y, z, w],
            maxNumIterations=200, residualThreshold=1e-6, physicsClientId=self.client,
        )  # fmt: skip
        return np.array(found[:7])

    def _away(self, joints_rad, position_m, orientation_wxyz):
        """Distance [m] and angle [rad] between where the grasp target is and where it should be."""
        self._move(joints_rad)
        state = self.bullet.getLinkState(
            self.arm, self.GRASP_TARGET, computeForwardKinematics=True, physicsClientId=self.client
        )
        x, y, z, w = state[5]
        chord = min(np.linalg.norm(orientation_wxyz - sign * np.array([w, x, y, z])) for sign in (1, -1))
        return np.linalg.norm(np.array(state[4]) - position_m), 4 * np.arcsin(chord / 2)

    def _move(self, joints_rad):
        for joint, value in zip(self.MOVABLE, (*joints_rad, *self.FINGERS_M), strict=True):
            self.bullet.resetJointState(self.arm, joint, float(value), physicsClientId=self.client)


@pytest.fixture(scope="session")
def simulated_panda():
    panda = SimulatedPanda()
    yield panda
    panda.bullet.disconnect(panda.client)
