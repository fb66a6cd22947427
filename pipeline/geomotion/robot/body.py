"""Points of a robot's body, and the balls around them."""

from dataclasses import dataclass

import numpy as np

from geomotion.types import Float, Int


@dataclass(frozen=True)
class BodyPoints:
    """Points fixed to the links of an arm; balls, where they have a radius.

    Attributes:
        frame: Index of the joint whose frame each one moves with, shape (point,); 0 is behind the first joint.
        offset_m: Place in that frame, shape (point, 3) [m].
        radius_m: Shape (point,) [m].
    """

    frame: Int[np.ndarray, " point"]
    offset_m: Float[np.ndarray, "point 3"]
    radius_m: Float[np.ndarray, " point"]

    def __len__(self) -> int:
        return len(self.frame)
