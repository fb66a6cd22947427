"""How often the arm behind a planned pose touches an obstacle, over the latent plane (Sec. 4.4, Fig. 4.4)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from geomotion.config import ArmFailuresConfig, EndEffectorFrame, ObstacleConfig
from geomotion.errors import InvalidSetting
from geomotion.figures.arm_failures import FailureMap
from geomotion.manifolds.grid import LatentGrid
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.obstruction import Tool, distances
from geomotion.robot import panda
from geomotion.robot.arm_failures import arm_failures
from geomotion.robot.panda_arm import panda_arm
from geomotion.robot.scene import ArmScene
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.paths import QUATERNION, MotionPath
from geomotion.scores.score import Score, max_score, mean_score
from geomotion.stages.graph import Skilled
from geomotion.stages.scene import moving_bodies

MM = 1000.0


@dataclass(frozen=True)
class FailureStudy:
    """Scores and the map behind them."""

    evaluation: Evaluation
    failures: FailureMap


def study_arm_failures(
    config: ArmFailuresConfig,
    skilled: Skilled,
    obstacle: ObstacleConfig,
    frame: EndEffectorFrame,
    caps: tuple[float, float],
) -> FailureStudy:
    """Decode a latent grid, draw joint solutions of every pose inside the support cap, and look which of them collide.

    Args:
        config: Grid and number of solutions.
        skilled: A manifold of poses with two latent dimensions.
        obstacle: Where it is at time zero.
        frame: Which frame of the arm the poses are of.
        caps: How far from the demonstrations poses may be [m], [rad].

    Raises:
        InvalidSetting: If there is no obstacle, or the skill is none of poses in R³×S³ on a latent plane.
    """
    manifold, paths = skilled.manifold, skilled.manifold.data.originals
    if skilled.skill.arm is not None or paths[0].orientation.shape[1] != QUATERNION or manifold.latent_dim != 2:
        raise InvalidSetting("evaluation.arm_failures.study", True, "false: it needs poses in R3xS3 on a latent plane")
    bodies = moving_bodies(obstacle, 3)
    if not bodies:
        raise InvalidSetting("obstacle", "none", "an obstacle beside the arm, for evaluation.arm_failures.study=true")
    whole = skilled.surface.grid
    grid = LatentGrid(whole.low, whole.high, config.points_per_axis)
    states = manifold.decode(grid.nodes).states
    apart_m, apart_rad = manifold.space.support(manifold.data.paths).distances(states)
    judged = np.flatnonzero((apart_m <= caps[0]) & (apart_rad <= caps[1]))
    with ArmScene(panda_arm()) as scene:
        for body in bodies:
            scene.add_obstacle(body.name, body.body, body.motion.offset(0.0))
        found = arm_failures(
            scene, states.position_m[judged], states.orientation[judged], config.solutions, frame.value, config.seed
        )
    share = np.full(len(grid.nodes), np.nan)
    share[judged] = found.share
    near = np.unique(grid.nearest(np.concatenate([codes.numpy() for codes in manifold.codes])))
    room_m = _room_of_hand_m(bodies, paths, frame)
    reached = float(found.solutions.sum()) / (len(judged) * config.solutions)
    evaluation = Evaluation(_scores(share, near, reached, room_m), {"arm_failures_share": share.reshape(grid.shape)})
    axes = [np.linspace(*ends, config.points_per_axis) for ends in zip(grid.low, grid.high, strict=True)]
    return FailureStudy(evaluation, FailureMap((axes[0], axes[1]), share.reshape(*grid.shape), config.solutions))


def _scores(share: Float[np.ndarray, " node"], near: np.ndarray, reached: float, room_m: float) -> dict[str, Score]:
    known, beside = share[np.isfinite(share)], share[near][np.isfinite(share[near])]
    of_solutions = "of the random joint solutions of a pose, those that touch the obstacle"
    scores = {
        "clearance_of_demonstrated_hands": Score(MM * room_m, "mm", note="balls around the hand; above 0: not blocked"),
        "solved_share": Score(
            reached, "1", statistic="share", note="of the random joint solutions that were asked for"
        ),
    }
    if len(known):
        scores["worst_share"] = max_score(known, "1", f"{of_solutions}, inside the support cap")
        scores["mean_share"] = mean_score(known, "1", "the same")
    if len(beside):
        scores["mean_share_near_demonstrations"] = mean_score(beside, "1", "at the nodes nearest to encoded ones")
        scores["worst_share_near_demonstrations"] = max_score(beside, "1", "the same")
    return {f"arm_failures.{name}": score for name, score in scores.items()}


def _room_of_hand_m(bodies: list[MovingBody], paths: tuple[MotionPath, ...], frame: EndEffectorFrame) -> float:
    """Smallest distance between obstacles and the balls around the hand, over all demonstrated poses [m]."""
    hand = Tool(*panda.hand_balls(frame.value))
    return min(float(distances(bodies, hand.points(path), hand.radii_m, 0.0).min()) for path in paths)
