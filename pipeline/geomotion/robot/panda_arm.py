"""The Panda as an arm, with the limits that its documentation gives, those of acceleration and jerk among them."""

import functools
from dataclasses import fields, replace

from geomotion.robot import panda
from geomotion.robot.arm import Arm, read_arm


def panda_arm(base_link: str = panda.BASE_LINK, tip_link: str = panda.FRAME_LINKS["grasp_target"]) -> Arm:
    """The Panda, or the part of it between two links; the same object for the same links.

    Raises:
        UnknownName: If there is no such link.
        InvalidSetting: If no joint turns one link against the other.
    """
    return _documented(base_link, tip_link)


@functools.cache
def _documented(base_link: str, tip_link: str) -> Arm:
    arm = read_arm(panda.urdf_path(), base_link, tip_link)
    rows = [panda.JOINTS.index(name) for name in arm.joint_names]
    documented = {field.name: getattr(panda.LIMITS, field.name)[rows] for field in fields(panda.LIMITS)}
    return replace(arm, limits=panda.JointLimits(**documented))
