"""What the numbers of a report on geodesics do not say."""

from collections.abc import Mapping
from typing import Any

from geomotion.figures.report.gms_execution import executed

Document = Mapping[str, Any]
ALWAYS = (
    "The mean of the demonstrations stands beside every ratio: for one smooth bundle with one goal it is hard to beat. "
    "Geodesics earn their place with obstacles, branches, and starts and goals that were not shown.",
    "Lengths and energies depend on the scaling of the metric. Compare them within this page, not between models.",
    "DTWD matches each point with the nearest one of the other curve, whatever their order in time.",
    "One seed, one training run: how much the scores change with the seed is not shown.",
)
NO_HELD_OUT = "No demonstration was held out: geodesics are judged against the training data."
OBSTACLES = (
    "The guaranteed clearance concerns {} on the decoded path and the obstacles as they were described to the "
    "planner. It says nothing about other parts of the arm, about tracking errors, or about obstacles seen wrongly.",
    "A plan sees moving obstacles where they are at time zero; only planning anew on the way answers their motion.",
)
SIMULATED = (
    "The robot is simulated with PyBullet. A real arm's friction, delays and calibration are in none of these numbers."
)
CLEARANCES = "Clearances of links are sampled thirty times a second, and only near obstacles."


def caveats(summary: Document, scores: Document, plan: Document, replay: Document | None) -> list[str]:
    """Caveats of this run, then those of every run.

    Args:
        summary: Contents of ``summary.json``.
        scores: Of ``scores.json``.
        plan: Contents of ``plan.json``.
        replay: Contents of ``replay.json``; None without a replay stage.
    """
    found = [_held_out(scores)]
    if plan["obstacles"]:
        found += [text.format(plan["protected"]) for text in OBSTACLES]
    if (done := executed(replay)) is not None:
        found += [SIMULATED] if done["states"] == "configurations" else [SIMULATED, _frame(summary, done)]
        found += [CLEARANCES] if done["clearance_m"] else []
    return [*found, *ALWAYS]


def _frame(summary: Document, replay: Document) -> str:
    return (
        f"The recordings give their frame as: {summary.get('frame') or 'not stated'}. The robot executed them as poses "
        f"of its frame {replay['frame']}; if they follow another point of the hand, reach and clearances are another's."
    )


def _held_out(scores: Document) -> str:
    counts = [int(score.get("count", 1)) for name, score in scores.items() if name == "heldout.planned_share"]
    if not any(name.startswith("heldout.") for name in scores):
        return NO_HELD_OUT
    how_many = f"{counts[0]} " if counts else ""
    noun = "demonstration" if counts == [1] else "demonstrations"
    return f"Held-out scores rest on {how_many}{noun} of the same task, most likely by the same person."
