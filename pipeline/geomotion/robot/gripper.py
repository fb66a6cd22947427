"""What a simulated hand needs to be told to hold something."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Gripper:
    """A hand of sliding fingers, which are open where their joints are at their upper limits.

    Attributes:
        holding_link: The link in whose frame held objects are given.
        finger_joints: Joints of the fingers.
    """

    holding_link: str
    finger_joints: tuple[str, ...]
