"""Scores as plain text."""

from collections.abc import Mapping
from itertools import groupby
from typing import Any

TITLES = {
    "train": "Training demonstrations, from their own starts",
    "heldout": "Held-out demonstrations, from their own starts",
    "train.manifold": "Training demonstrations, beside the manifold of the skill (offsets in latent units)",
    "heldout.manifold": "Held-out demonstrations, beside the manifold of the skill (offsets in latent units)",
    "contraction.true": "Contraction of the field in robot coordinates (true Jacobian; negative rates contract)",
    "contraction.claimed": "Contraction in the coordinates where it is claimed (true Jacobian)",
    "contraction.jhat": "The network's matrix of Eq. (5.1), which is not the Jacobian of the field",
    "contraction.condition": "The differential condition in the claimed metric (true Jacobian, robot coordinates)",
    "verification": "Proof on the box around the demonstrations, by bounds on the true Jacobian",
    "region": "Rollouts from a grid: steps in the region of the demonstrations, Eq. (6.10)",
    "nearby.euclidean": "Rollouts from nearby starts, Euclidean distance",
    "nearby.claimed": "Rollouts from nearby starts, distance in the claimed metric",
    "goal": "Starts on a grid",
    "step": "Single integration steps, Table 6.3",
    "equilibrium": "Where the field comes to rest",
    "returns": "Motions from starts that are off in every joint, distance to the demonstration (RMS of joints)",
    "returns.claimed": "Motions from starts that are off in every joint, in the claimed metric",
    "pushes": "Motions pushed aside, distance to their undisturbed paths",
    "pushes.claimed": "Motions pushed aside, distance to the undisturbed motion in the claimed metric",
    "obstacles.contraction.true": "Contraction among obstacles, robot coordinates (measured, not proven)",
    "obstacles.contraction.claimed": "Contraction among obstacles in the claimed metric (measured, not proven)",
    "obstacles.nearby.euclidean": "Rollouts from nearby starts among obstacles, Euclidean distance",
    "obstacles.nearby.claimed": "Rollouts from nearby starts among obstacles, distance in the claimed metric",
    "obstacles.passage": "Starts on a grid, among obstacles",
    "safety": "Motions from random starts in the support, in the safety region and without it",
    "safety.contraction": "Contraction in the safety region, latent coordinates (measured, not proven)",
    "pairs": "From every group's start to every group's goal",
    "methods": "The same geodesic by other methods",
    "arm_failures": "Joint solutions of decoded poses that touch the obstacle, Fig. 4.4",
}


def scores_table(document: Mapping[str, Any]) -> str:
    """The scores of a ``scores.json`` document, one line each, in groups; then what was left out, and why.

    A spread is a standard deviation over the `n` values behind a mean. What is neither a mean nor a share of them is
    named in the last column.
    """
    lines = [f"{document['dataset']}, protocol {document['protocol']}"]
    scores: Mapping[str, Mapping[str, Any]] = document["scores"]
    width = max((len(name.rpartition(".")[2]) for name in scores), default=0)
    for group, names in groupby(scores, key=lambda name: name.rpartition(".")[0]):
        lines += ["", TITLES.get(group, group)]
        lines += [_row(name.rpartition(".")[2], scores[name], width) for name in names]
    if document["omitted"]:
        lines += ["", "Left out"]
        lines += [f"  {name}: {reason}" for name, reason in document["omitted"].items()]
    return "\n".join(lines)


def _row(name: str, score: Mapping[str, Any], width: int) -> str:
    value = _number(score["value"])
    spread = f"± {_number(score['spread'])}" if score["spread"] and score["statistic"] != "max" else ""
    unit = "" if score["unit"] == "1" else score["unit"]
    statistic = "" if score["statistic"] in {"mean", "share"} else score["statistic"]
    return f"  {name:<{width}}  {value:>10} {spread:<11} {unit:<5}  n={score['count']:<5} {statistic}".rstrip()


def _number(value: float | None) -> str:
    return "not finite" if value is None else f"{value:.4g}"
