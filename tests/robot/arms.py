"""Arms that the tests of kinematics share: shipped ones, those of pybullet_data, and a crooked one."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geomotion.arms import PLANAR_URDF
from geomotion.robot import panda
from geomotion.robot.arm import Arm, read_arm

CROOKED = """<?xml version="1.0" encoding="utf-8"?>
<!-- axes that are not z, one left out, a joint without end, shapes of all kinds, a finger, a plugin -->
<robot name="crooked">
  <transmission name="t"><plugin reduction="?"/></transmission>
  <link name="world"/>
  <joint name="mount" type="fixed">
    <parent link="world"/><child link="base"/><origin xyz="0.1 0 0.2" rpy="0.3 0 1"/>
  </joint>
  <link name="base"/>
  <joint name="a" type="continuous">
    <parent link="base"/><child link="one"/><origin xyz="0 0 0.1" rpy="0.2 -0.4 0"/>
  </joint>
  <link name="one">
    <collision><origin xyz="0 0 0.1"/><geometry><sphere radius="0.07"/></geometry></collision>
    <collision><geometry><box size="0.02 0.3 0.06"/></geometry></collision>
  </link>
  <joint name="b" type="revolute">
    <parent link="one"/><child link="two"/><origin xyz="0.05 0 0.2" rpy="0 0 0.5"/><axis xyz="0 -2 0"/>
    <limit lower="-1" upper="2" velocity="1.5" effort="1"/>
    <safety_controller soft_lower_limit="-0.9" soft_upper_limit="2.5" k_position="1" k_velocity="1"/>
  </joint>
  <link name="two"/>
  <joint name="c" type="revolute">
    <parent link="two"/><child link="three"/><origin xyz="0.2 0.1 0" rpy="1 1 1"/><axis xyz="1 2 -0.5"/>
    <limit lower="-2" upper="2" velocity="1.5" effort="1"/>
  </joint>
  <link name="three">
    <collision>
      <origin xyz="0 0.05 0" rpy="0.4 0 0"/><geometry><cylinder radius="0.04" length="0.2"/></geometry>
    </collision>
  </link>
  <joint name="end" type="fixed">
    <parent link="three"/><child link="tip"/><origin xyz="0 0.1 0.1" rpy="0 0.3 0"/>
  </joint>
  <link name="tip"/>
  <joint name="slide" type="prismatic">
    <parent link="tip"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.03" velocity="1" effort="1"/>
  </joint>
  <link name="finger"><collision><geometry><box size="0.01 0.01 0.05"/></geometry></collision></link>
</robot>
"""


@dataclass(frozen=True)
class Case:
    """A URDF and the links between which it is an arm."""

    path: Path
    base: str
    tip: str

    def arm(self) -> Arm:
        return read_arm(self.path, self.base, self.tip)


def write_crooked(folder: Path) -> Case:
    path = folder / "crooked.urdf"
    path.write_text(CROOKED, encoding="utf-8")
    return Case(path, "base", "tip")


def shipped_cases() -> dict[str, Case]:
    data = panda.urdf_path().parents[1]
    return {
        "panda": Case(panda.urdf_path(), panda.BASE_LINK, "panda_grasptarget"),
        "iiwa": Case(data / "kuka_iiwa/model.urdf", "lbr_iiwa_link_0", "lbr_iiwa_link_7"),
        "xarm": Case(data / "xarm/xarm6_robot.urdf", "link_base", "link6"),
        "planar": Case(PLANAR_URDF, "base", "tip"),
    }


NAMES = ("panda", "iiwa", "xarm", "planar", "crooked")


def some_joints(arm: Arm, count: int, seed: int = 0) -> np.ndarray:
    """Random configurations within the limits, and within a turn where there are none."""
    limits = arm.limits
    lower, upper = np.maximum(limits.lower_rad, -np.pi), np.minimum(limits.upper_rad, np.pi)
    return np.random.default_rng(seed).uniform(lower, upper, (count, len(lower)))
