"""Captions for the pictures of a learned field; and why pictures are missing."""

from collections.abc import Mapping

from geomotion.figures.arrays import EvaluationArrays
from geomotion.figures.report.pictures import Captions, Picture

FILM = (
    "In closed loop on the simulated arm",
    "The policy is asked anew in every control period. Blue: where it would go undisturbed. Red dots end where a force "
    "pushes the arm, which yields to it; nothing but the policy brings it back.",
)
BODY_FILM = (
    "The body in motion",
    "Orange: led by the learned field, never corrected. Grey: the demonstration at the same time. From elsewhere, the "
    "joints come back to the path of the demonstration, but may stay ahead of it or behind.",
)
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
    "body": (
        "The body over time",
        "Orange should lie on grey, the demonstration at the same time; below, soon after a start that is off in every "
        "joint. Snapshots stand apart from each other. Where the skill is of joints alone, the hip does not move.",
    ),
    "latent_paths": (
        "The skill in its latent space",
        "Dots are the demonstration, encoded; the star is the goal. Motions from elsewhere come to the line where "
        "nothing is left beside the skill, and to the goal along it; where they start along it decides how far ahead "
        "or behind they are.",
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
    "closed_loop": (
        "The policy on the simulated arm",
        "Orange should come back to the dashed path after each push, red. Dotted are 25 mm and 10 mm beside the path.",
    ),
    "safety_motion": (
        "Safety region",
        "The latent plane of the skill. White is free, dark is unsafe: far from the data, or an obstacle (filled). "
        "Green motions must not cross the solid line; red dots, where they end, should be on the star. Help along the "
        "geodesic frees motions that modulation alone brings to rest.",
    ),
    "safety_distance": (
        "From volume to distance",
        "Where positions are in obstacles, where the volume of the metric is large, and the distance field that is "
        "calibrated with it: unsafe where S falls below ρ, untouched where it is above ν.",
    ),
    "safety_switching": (
        "Switching of the modulation",
        "Across the border, a motion is slowed to nothing at ρ; along it, it is up to twice as fast, Eq. (6.6).",
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
