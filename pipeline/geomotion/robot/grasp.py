"""An object in the hand: a body of its own, held by a rigid joint."""

from dataclasses import dataclass
from typing import Any

from scipy.spatial.transform import Rotation

COLOUR = (0.35, 0.70, 0.90, 1.0)

Pose = tuple[tuple[float, ...], tuple[float, ...]]  # position [m] and quaternion xyzw, as PyBullet has them


@dataclass(frozen=True)
class GraspedCylinder:
    """A bottle or cup held between the fingers, in the frame of the grasp target.

    Attributes:
        radius_m: [m].
        length_m: [m].
        axis: Its direction; x lies across both the fingers' motion and the hand's approach.
        centre_m: Place of its middle [m].
        mass_kg: What it weighs on the arm [kg].
    """

    radius_m: float
    length_m: float
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass_kg: float = 0.3


class Grasp:
    """A cylinder that the simulator keeps in the hand; it collides with everything but the arm.

    Args:
        client: The simulator.
        arm: Body that holds it.
        link: Link of the arm in whose frame the cylinder is given.
        tool: What is held.
    """

    def __init__(self, client: Any, arm: int, link: int, tool: GraspedCylinder) -> None:
        self.client = client
        turn, _ = Rotation.align_vectors([tool.axis], [[0, 0, 1]])
        self.in_hand: Pose = tool.centre_m, tuple(turn.as_quat().tolist())
        shape = client.GEOM_CYLINDER
        self.body: int = client.createMultiBody(
            tool.mass_kg,
            client.createCollisionShape(shape, radius=tool.radius_m, height=tool.length_m),
            client.createVisualShape(shape, radius=tool.radius_m, length=tool.length_m, rgbaColor=COLOUR),
        )
        for other in range(-1, client.getNumJoints(arm)):
            client.setCollisionFilterPair(arm, self.body, other, -1, 0)
        place, turned = self.in_hand
        client.createConstraint(arm, link, self.body, -1, client.JOINT_FIXED, [0, 0, 0], place, [0, 0, 0], turned)

    def place(self, hand: Pose) -> None:
        """Put it into the hand, at rest, when the hand has been put somewhere else."""
        self.client.resetBasePositionAndOrientation(self.body, *self.client.multiplyTransforms(*hand, *self.in_hand))
        self.client.resetBaseVelocity(self.body, [0, 0, 0], [0, 0, 0])
