"""Replanning in closed loop: controllers that see the obstacles move lead the simulated arm from stop to stop."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from geomotion.config import PlanningConfig, RobotConfig, ToolShape
from geomotion.demos.demonstrations import Demonstrations
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.controller import ControllerSettings, GeodesicController, Pace
from geomotion.robot.closed_loop import Target
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import MotionPath
from geomotion.stages import planners
from geomotion.stages.graph import Skilled

SLOWEST = 0.25  # of the mean pace: demonstrations begin and end at rest, where a motion would never leave
SETTLED_S = 0.5  # at the goal, after which a motion has ended


@dataclass
class Pilot:
    """Hands the states of controllers to a control loop, one leg after the other.

    Attributes:
        controllers: One for each leg, each beginning where the one before ends.
        bodies: Obstacles.
        seconds: Computing time of each step that planned [s].
    """

    controllers: Sequence[GeodesicController]
    bodies: Sequence[MovingBody]
    seconds: list[float] = field(default_factory=list)
    _leg: int = 0
    _settled_s: float = 0.0

    def __call__(
        self, time_s: float, position_m: Float[np.ndarray, "3"], orientation_wxyz: Float[np.ndarray, "4"]
    ) -> Target:
        """The pose [m, wxyz] or the configuration [rad] of one period later; where the arm is makes no difference."""
        if self.controllers[self._leg].arrived and self._leg < len(self.controllers) - 1:
            self._leg += 1
        controller = self.controllers[self._leg]
        before, begun = controller.plans, time.perf_counter()
        state = controller.step(time_s, self.bodies)
        if controller.plans > before:
            self.seconds.append(time.perf_counter() - begun)
        self._settled_s = self._settled_s + controller.settings.period_s if self.reached_goal else 0.0
        if isinstance(state, ConfigurationPath):
            return np.asarray(state.joints_rad[0])
        return state.position_m[0], state.orientation[0]

    @property
    def reached_goal(self) -> bool:
        """Whether the last leg has ended."""
        return self.controllers[-1].arrived

    @property
    def waited_s(self) -> float:
        """How long there was no way on [s]."""
        return sum(controller.waited_s for controller in self.controllers)

    def has_ended(self) -> bool:
        """Whether the motion has been at its goal for a while."""
        return self._settled_s >= SETTLED_S


def make_pilot(
    robot: RobotConfig,
    planning: PlanningConfig,
    skilled: Skilled,
    demonstrations: Demonstrations,
    stops: MotionPath,
    bodies: Sequence[MovingBody],
) -> Pilot:
    """Follow the manifold from stop to stop at the demonstrations' pace.

    The hand is protected, unless the configuration says that the tool is a point.

    Args:
        robot: Frame, rate, horizon, and duration if the demonstrations' own is not wanted.
        planning: Limits, tool and constraint.
        skilled: Trained manifold and its grid.
        demonstrations: Those that it was trained on, among others.
        stops: Start, places on the way, and goal.
        bodies: Obstacles.
    """
    if planning.tool is ToolShape.auto:
        planning = replace(planning, tool=ToolShape.hand)
    planner = planners.planner(skilled, planning, robot.frame, robot.horizon_s)
    trained = demonstrations.select(skilled.skill.train_demos)
    durations_s = [one.duration_s for one in trained.trajectories]
    faster = 1.0 if robot.duration_s is None else float(np.mean(durations_s)) / robot.duration_s
    data = skilled.manifold.data
    pace = demonstrated_pace(data.originals, data.progress, durations_s, faster)
    settings = ControllerSettings(1 / robot.control_hz)
    legs = range(len(stops) - 1)
    controllers = [GeodesicController(planner, stops[k : k + 1], stops[k + 1 : k + 2], pace, settings) for k in legs]
    return Pilot(controllers, bodies)


def demonstrated_pace(
    paths: Sequence[MotionPath],
    progress: Sequence[Float[np.ndarray, " state"]],
    durations_s: Sequence[float],
    faster: float = 1.0,
) -> Pace:
    """How fast demonstrations are on average at a progress.

    Args:
        paths: Demonstrations, even in time.
        progress: Share of the motion that is done at each of their states.
        durations_s: How long they take [s].
        faster: Times their own pace.
    """
    shares = np.linspace(0, 1, 50)
    speeds = [
        np.interp(shares, (done[1:] + done[:-1]) / 2, path.steps_m() * (len(path) - 1) / duration_s)
        for path, done, duration_s in zip(paths, progress, durations_s, strict=True)
    ]
    mean = faster * np.mean(speeds, axis=0)
    mean = np.maximum(mean, SLOWEST * mean.mean())
    return lambda progress: float(np.interp(progress, shares, mean))
