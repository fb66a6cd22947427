"""The arm on a tabletop along joint positions that are known before, in position control."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from geomotion.robot.simulated_arm import Joints
from geomotion.robot.tabletop import Tabletop
from geomotion.robot.timed import RATE_HZ
from geomotion.types import Float


@dataclass(frozen=True)
class Executed:
    """What the arm did, at 240 Hz.

    Attributes:
        time_s: From 0 on [s].
        joints_rad: Measured [rad].
    """

    time_s: Float[np.ndarray, " time"]
    joints_rad: Float[np.ndarray, "time joint"]


def execute(
    tabletop: Tabletop, time_s: Float[np.ndarray, " pose"], joints_rad: Float[np.ndarray, "pose joint"]
) -> Executed:
    """Lead the arm from where it is along a spline through joint positions [rad] at times [s], the first of them 0."""
    scene, path = tabletop.scene, CubicSpline(time_s, joints_rad, bc_type="clamped")
    times = np.arange(round(time_s[-1] * RATE_HZ) + 1) / RATE_HZ
    measured = [scene.joints()[0]]
    for position, velocity in zip(path(times[:-1]), path(times[:-1], 1), strict=True):
        scene.command(position, velocity)
        scene.step()
        measured.append(scene.joints()[0])
    return Executed(times, np.stack(measured))


def wait(tabletop: Tabletop, duration_s: float, joints_rad: Joints) -> None:
    """Hold the joints [rad] for a while [s], in which the fingers may move and things may fall."""
    still = np.zeros_like(joints_rad)
    for _ in range(round(duration_s * RATE_HZ)):
        tabletop.scene.command(joints_rad, still)
        tabletop.scene.step()
