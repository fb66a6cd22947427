"""A simulated arm, and recorded poses for it to take."""

from pathlib import Path

import numpy as np
import pytest

from geomotion import arms
from geomotion.config import PandaArm, PlanarArm
from geomotion.robot.arm import Arm

from .arms import write_crooked

TASKS = ("wineglass", "bottle2shelf", "openbox", "pouring", "scoop", "matfolding")
DEMO_S = 1000 / 60


@pytest.fixture
def scene():
    from geomotion.robot import panda
    from geomotion.robot.panda_arm import panda_arm
    from geomotion.robot.scene import ArmScene

    with ArmScene(panda_arm(), panda.GRIPPER, table=True) as scene:
        scene.set_joints(panda.HOME_RAD)
        yield scene


@pytest.fixture(scope="session")
def recorded(robotasks9_folder: Path):
    """Task -> 200 poses of its demonstration 7: positions [m] and quaternions."""

    def poses(task: str) -> tuple[np.ndarray, np.ndarray]:
        rows = np.load(robotasks9_folder / f"{task}.npy")[7][np.linspace(0, 999, 200).round().astype(int)]
        return rows[:, :3] / 100, rows[:, 3:]

    return poses


def arc(count: int = 60) -> np.ndarray:
    """Joint positions of a smooth sweep in front of the arm [rad]."""
    from geomotion.robot import panda

    s = np.linspace(0, 1, count)[:, None]
    return panda.HOME_RAD + np.sin(np.pi * s * np.array([0.5, 0.4, 0.3, 0.5, 0.7, 0.6, 1.0])) * 0.6


@pytest.fixture(scope="module", params=["panda", "planar", "crooked"])
def arm(request, tmp_path_factory) -> Arm:
    """Shipped arms, and one whose axes and shapes are of all kinds."""
    match request.param:
        case "panda":
            return arms.build(PandaArm())
        case "planar":
            return arms.build(PlanarArm())
    return write_crooked(tmp_path_factory.mktemp("urdf")).arm()
