"""Whether there is a path, what is guaranteed about it, and what was only measured, in sentences for roboticists."""

from collections.abc import Mapping, Sequence
from typing import Any

from geomotion.figures.report import gms_execution
from geomotion.figures.report.gms_checks import check_findings
from geomotion.figures.report.gms_execution import deg, mm
from geomotion.figures.report.verdict import Finding, Verdict

Document = Mapping[str, Any]
ROUNDING = 1e-6  # of a cap
GUARANTEED = "clearance of {} along the whole decoded path, for the obstacles as they were described"
MEASURED = "distance to the data and energy; in simulation also links, joint limits and tracking errors"
TITLE = "Numbers"


def verdict(plan: Document, graph: Document, training: Document, replay: Document | None) -> Verdict:
    """Put a plan and what became of it into words.

    Args:
        plan: Contents of ``plan.json``.
        graph: Contents of ``graph.json``.
        training: Contents of ``training.json``.
        replay: Contents of ``replay.json``; None without a replay stage.
    """
    failed = [leg for leg in plan["legs"] if leg["status"] != "found"]
    if failed:
        return _no_path(plan, failed)
    legs = [leg["scores"] for leg in plan["legs"]]
    found = [
        _clearance(plan, legs),
        *check_findings(plan),
        _distance(plan, graph, legs),
        *_energy(legs),
        _ends(legs),
        *_health(training),
    ]
    found += gms_execution.findings(replay)
    sentences = tuple(finding.text for finding in found)
    if all(finding.is_good for finding in found):
        return Verdict("found", "A path was found", sentences, facts(plan, replay), TITLE)
    return Verdict("doubtful", "A path was found, with reservations", sentences, facts(plan, replay), TITLE)


def leg_name(leg: Document, number: int) -> str:
    """Where a leg leads, or its number from 1 where its ends have no names."""
    return f"{leg['from']} to {leg['to']}" if "from" in leg else f"leg {number + 1}"


def attempts(training: Document) -> str:
    """How often training began."""
    return "one attempt" if training["attempts"] == 1 else f"{training['attempts']} attempts"


def facts(plan: Document, replay: Document | None) -> tuple[tuple[str, str], ...]:
    """Names and values behind the verdict."""
    found = {
        "Start": str(plan["start"]),
        "Goal": str(plan["goal"]),
        "Obstacles": ", ".join(plan["obstacles"]) or "none",
        "Guaranteed": GUARANTEED.format(plan["protected"])
        if plan["obstacles"]
        else "nothing: there were no obstacles to keep clear of",
        "Measured only": MEASURED,
    }
    if (done := gms_execution.executed(replay)) is not None:
        found["Executed as"] = f"frame {done['frame']}, timing {done['timing']}, {done['duration_s']:.2f} s"
    return tuple(found.items())


def _no_path(plan: Document, failed: Sequence[Document]) -> Verdict:
    first = failed[0]
    reason, _, way_out = str(first["reason"]).partition("; ")
    sentences = []
    if len(plan["legs"]) > 1:
        place = leg_name(first, plan["legs"].index(first))
        others = f"{len(plan['legs']) - len(failed)} of {len(plan['legs'])} legs have a path"
        sentences.append(f"There is none for {place}; {others}.")
    if first["blocking"]:
        sentences.append(f"In the way: {', '.join(first['blocking'])}.")
    if way_out:
        sentences.append(f"A way out: {way_out}.")
    sentences.append("Nothing was executed.")
    return Verdict("not-found", f"No path: {reason}", tuple(sentences), facts(plan, None), TITLE)


def _clearance(plan: Document, legs: Sequence[Document]) -> Finding:
    kept_m = [leg["clearance_m"] for leg in legs if leg["clearance_m"] is not None]
    if not kept_m:
        return Finding("There were no obstacles to keep clear of.")
    names = f"every obstacle ({', '.join(plan['obstacles'])})"
    if min(kept_m) <= 0:
        return Finding(
            f"No clearance is guaranteed: on the decoded path, {plan['protected']} may touch an obstacle.",
            is_good=False,
        )
    return Finding(
        f"Guaranteed, for the obstacles as they were described: along the whole decoded path, {plan['protected']} "
        f"stays at least {mm(min(kept_m))} away from {names}."
    )


def _distance(plan: Document, graph: Document, legs: Sequence[Document]) -> Finding:
    apart_m, apart_rad = (max(float(leg[name]) for leg in legs) for name in ("apart_m", "apart_rad"))
    cap_m, cap_rad = (float(plan.get(name, graph[name])) for name in ("cap_m", "cap_rad"))
    is_inside = apart_m <= cap_m * (1 + ROUNDING) and apart_rad <= cap_rad * (1 + ROUNDING)
    allowed = f"{'' if is_inside else 'only '}{mm(cap_m)} and {deg(cap_rad)} are allowed"
    apart = f"{mm(apart_m)} and {deg(apart_rad)} away from the demonstrations"
    return Finding(f"It goes up to {apart}; {allowed}.", is_inside)


def _energy(legs: Sequence[Document]) -> list[Finding]:
    own, line = (sum(float(leg[name]) for leg in legs) for name in ("energy", "line_energy"))
    if not own > 0:
        return []
    if line >= own:
        return [Finding(f"The straight latent line would take {line / own:.3g} times its energy.")]
    return [
        Finding(
            f"The straight latent line would take less energy, {line / own:.2g} of it: energy alone asks neither for a "
            "way where demonstrations are dense, nor for one far from obstacles."
        )
    ]


def _ends(legs: Sequence[Document]) -> Finding:
    start, goal = (
        f"{mm(leg[f'{end}_residual_m'])} and {deg(leg[f'{end}_residual_rad'])} from the wanted {end}"
        for leg, end in ((legs[0], "start"), (legs[-1], "goal"))
    )
    return Finding(f"The manifold itself passes {start}, and {goal}; the path is led there smoothly.")


def _health(training: Document) -> list[Finding]:
    if training["is_good"]:
        return []
    missed, folded = 100 * training["unexplained_variance"], 100 * training["folded_share"]
    text = (
        f"The latent space is not good after {attempts(training)}: {missed:.2g} % of the variance is "
        f"missed and {folded:.2g} % of the data are folded. Try another seed or more training steps."
    )
    return [Finding(text, is_good=False)]
