"""Captions for the pictures of a pose manifold; and why pictures are missing."""

from collections.abc import Mapping
from typing import Any

from geomotion.figures.report.gms_execution import NO_ROBOT
from geomotion.figures.report.pictures import Captions, Picture

FILM = (
    "On the simulated arm",
    "The path, executed under position control in PyBullet, among the obstacles of the plan.",
)
CAPTIONS: Captions = {
    "demonstrations": (
        "Demonstrations",
        "What was recorded, after preprocessing: all that the model has seen of the task.",
    ),
    "plan": (
        "The planned motion",
        "Blue is the geodesic, dashed the straight latent line, which knows nothing of the data. In latent space, blue "
        "should stay where it is pale and inside the support cap, or inside the tubes that walls of the metric leave "
        "open; in projections, near the black demonstrations. Red is what obstacles take. Below, each joint with its "
        "limits, or each component of the orientation: a change of a quaternion's sign is a jump across zero.",
    ),
    "latent": (
        "Latent space",
        "Of a plane: left, how unsure the decoder is; right, how much a step in latent space changes the pose. Dark "
        "walls around the encoded demonstrations keep geodesics near them. Of a space: such walls from two sides, cut "
        "open towards the eye. They are drawn halfway between the metric at the demonstrations and its largest values; "
        "tubes that meet let a geodesic change from one group of demonstrations to another.",
    ),
    "geodesics": (
        "Geodesics against demonstrations",
        "Blue should lie on black: each geodesic is given only the first and the last state of its demonstration. A "
        "ratio of 1 is what another demonstration would reach; the averaged demonstration in orange is the simple "
        "alternative that has to be beaten.",
    ),
    "methods": (
        "The same geodesic by several methods",
        "Graphs of two resolutions, gradient descent, and the straight line, between the same latent points.",
    ),
    "arm_failures": (
        "What inverse kinematics makes of poses",
        "At each pose of the latent plane inside the support cap, the share of random joint solutions with which the "
        "arm touches the obstacle. No demonstration of the hand need do so: where it is dark, planning for the hand "
        "alone is not enough.",
    ),
    "replay": (
        "On the robot",
        "Errors should stay under the dashed lines, joint-limit margins and clearances above them. Clearances are "
        "shown for links that come near an obstacle; flat at the top means: farther than is measured.",
    ),
    "training": (
        "Training",
        "The total should have levelled off; if it still falls at the end, more steps would help.",
    ),
}
ALWAYS_DRAWN = ("demonstrations", "plan", "latent", "geodesics", "training")


def missing(
    present: Mapping[str, Picture], plan: Mapping[str, Any], replay: Mapping[str, Any] | None
) -> dict[str, str]:
    """Why pictures are not on the page, by title.

    Args:
        present: Those that are.
        plan: Contents of ``plan.json``.
        replay: Contents of ``replay.json``; None without a replay stage.
    """
    reasons = {CAPTIONS[name][0]: "its stage left no picture" for name in ALWAYS_DRAWN if name not in present}
    if replay is None:
        reasons[CAPTIONS["replay"][0]] = f"no robot: {NO_ROBOT}"
    elif "replay" not in present:
        why = "the stage left no picture" if plan.get("found") else "there is no path to execute"
        reasons[CAPTIONS["replay"][0]] = why
    return reasons
