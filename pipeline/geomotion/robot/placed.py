"""An obstacle in the simulator: where it is, and how far from it other bodies are."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.robot.shapes import Shape
from geomotion.types import Float

COLOUR = (0.84, 0.37, 0.0, 1.0)


class PlacedObstacle:
    """The pieces of one obstacle, which move together.

    Args:
        client: The simulator.
        shape: What to place.
        colour: Red, green, blue and opacity, from 0 to 1.
    """

    def __init__(self, client: Any, shape: Shape, colour: tuple[float, ...] = COLOUR) -> None:
        self.client, self.shape = client, shape
        self.orientation_xyzw = Rotation.from_matrix(shape.rotation).as_quat().tolist()
        visual = client.createVisualShape(**shape.visual, rgbaColor=colour)
        self.pieces: list[int] = []
        for index, arguments in enumerate(shape.collision):
            piece = client.createMultiBody(
                baseMass=0,
                baseCollisionShapeIndex=client.createCollisionShape(**arguments),
                baseVisualShapeIndex=visual if index == 0 else -1,
                basePosition=shape.position_m.tolist(),
                baseOrientation=self.orientation_xyzw,
            )
            client.changeDynamics(piece, -1, collisionMargin=shape.margin_m)
            self.pieces.append(piece)

    def move(self, offset_m: Float[np.ndarray, "3"]) -> None:
        """Put it at an offset from its own place [m]."""
        place = (self.shape.position_m + offset_m).tolist()
        for piece in self.pieces:
            self.client.resetBasePositionAndOrientation(piece, place, self.orientation_xyzw)

    def distances(self, body: int, up_to_m: float) -> dict[int, float]:
        """Distance to each link of a body [m], negative within; links farther than `up_to_m` are left out."""
        found: dict[int, float] = {}
        for piece in self.pieces:
            for contact in self.client.getClosestPoints(body, piece, up_to_m + self.shape.skin_m):
                link, distance = contact[3], contact[8] - self.shape.skin_m
                found[link] = min(distance, found.get(link, np.inf))
        return found
