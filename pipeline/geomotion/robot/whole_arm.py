"""A whole arm among obstacles: balls that together contain its links, and move with its joints."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial.distance import cdist

from geomotion.robot.arm import Arm
from geomotion.robot.body import BodyPoints
from geomotion.scores.paths import MotionPath
from geomotion.types import Float, Int


@dataclass(frozen=True)
class WholeArm:
    """Balls on an arm; a :class:`geomotion.planning.obstruction.RobotShape` for configurations.

    Attributes:
        arm: Whose joints the configurations are of.
        balls: What must not touch obstacles.
        blocks: Which point of the metric each ball belongs to.
        closer: Makes more and smaller balls that contain the same, for a closer look; None if there are none.
    """

    arm: Arm
    balls: BodyPoints
    blocks: Int[np.ndarray, " ball"]
    closer: Callable[[], BodyPoints] | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(
        cls, arm: Arm, balls: BodyPoints, metric_points: BodyPoints, closer: Callable[[], BodyPoints] | None = None
    ) -> "WholeArm":
        """Give each ball to the point of the metric that is nearest to it, all joints at zero."""
        straight = np.zeros(len(arm.joint_names))
        apart = cdist(arm.chain.points(straight, balls), arm.chain.points(straight, metric_points))
        return cls(arm, balls, apart.argmin(axis=1), closer)

    @cached_property
    def finer(self) -> "WholeArm | None":
        """The same arm in the smaller balls; their blocks do not matter."""
        if self.closer is None:
            return None
        balls = self.closer()
        return WholeArm(self.arm, balls, np.zeros(len(balls), dtype=int))

    @property
    def radii_m(self) -> Float[np.ndarray, " ball"]:
        """Of the balls [m]."""
        return self.balls.radius_m

    def points(self, states: MotionPath) -> Float[np.ndarray, "state ball 3"]:
        """Centres of the balls [m]."""
        return np.asarray(self.arm.chain.points(states.vectors, self.balls))

    def travel_m(self, states: MotionPath, pairs: Int[np.ndarray, "pair 2"]) -> Float[np.ndarray, " pair"]:
        """Upper bound on how far any ball moves while the joints go straight from one configuration to the other [m].

        No point moves faster about an axis than its largest possible distance from it times the turn.
        """
        turned_rad = np.abs(np.diff(states.vectors[pairs], axis=1)[:, 0])
        return np.asarray((turned_rad @ self.arm.chain.reach_m(self.balls)).max(axis=1))
