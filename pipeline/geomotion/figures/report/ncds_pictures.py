"""Captions for the pictures of a learned field; and why pictures are missing."""

from collections.abc import Mapping

from geomotion.figures.arrays import EvaluationArrays
from geomotion.figures.report.pictures import Captions, Picture

CAPTIONS: Captions = {
    "demonstrations": (
        "Demonstrations",
        "What was recorded, after preprocessing: all that the model has seen of the task.",
    ),
    "motion": (
        "Learned motion",
        "Orange should lie on black: each rollout starts where its demonstration starts and is never corrected. Dotted "
        "and dashed curves were kept from training. Green and grey, where present, show what happens elsewhere.",
    ),
    "eigenvalues": (
        "Where the field contracts",
        "Blue: nearby motions approach each other at once. Red, outlined and hatched in maps: they part at first. The "
        "panels share one scale, cut at the 95th percentile. Only the true Jacobian describes the motion.",
    ),
    "nearby": (
        "Nearby motions",
        "Do they come together? Below 1 they are closer than at the start. The solid curve has to stay under the "
        "dashed bound where one is proven; the Euclidean curve may rise above 1 first.",
    ),
    "region": (
        "Time inside the demonstration region",
        "Rollouts from an equidistant grid, strong where they are inside the convex hull of the demonstrations, "
        "Eq. (6.10). Bars far to the right mean that motions enter soon and stay.",
    ),
    "goal_starts": (
        "Starts that never reach the goal",
        "From crosses, the motion stops elsewhere, circles, diverges, or is too slow for the time allowed.",
    ),
    "training": (
        "Training",
        "The total should have levelled off; if it still falls at the end, more steps would help.",
    ),
}


def missing(present: Mapping[str, Picture], data: EvaluationArrays) -> dict[str, str]:
    """Why pictures or parts of them are not on the page, by title."""
    reasons = {}
    if data.dim != 2:
        reasons["Vector field, eigenvalue map, region"] = (
            f"they are drawn in a plane; the state has {data.dim} dimensions"
        )
    if data.eigenvalues is not None and data.eigenvalues.jhat is None:
        reasons["Eigenvalues of Ĵ"] = "only a line-integral field has a matrix Ĵ, Eq. (5.1)"
    if not data.has_held_out:
        reasons["Held-out demonstrations"] = "none were judged"
    if data.goal_starts is not None and data.goal_starts.reached.all():
        reasons[CAPTIONS["goal_starts"][0]] = f"all {len(data.goal_starts.reached)} starts reach it"
    absent = [name for name in ("demonstrations", "motion", "training") if name not in present]
    return reasons | {CAPTIONS[name][0]: "its stage left no picture" for name in absent}
