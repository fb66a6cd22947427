"""Scores of geodesics: their order, their names, and which to look at first."""

from collections.abc import Mapping
from typing import Any

from geomotion.figures.report.gms_execution import deg, executed, mm
from geomotion.figures.report.scores import SETS, Headline, Scores, Subject, quantity

ORDER: Mapping[str, tuple[str, ...]] = {
    "position_dtwd_ratio": ("position_dtwd_ratio_of_averaged_demo", "position_dtwd_ratio_of_straight_line"),
    "orientation_dtwd_ratio": ("orientation_dtwd_ratio_of_averaged_demo", "orientation_dtwd_ratio_of_straight_line"),
    "joint_dtwd_ratio": ("joint_dtwd_ratio_of_averaged_demo", "joint_dtwd_ratio_of_straight_line"),
    "position_dtwd_per_point": (),
    "orientation_dtwd_per_point": (),
    "joint_dtwd_per_point": (),
    "farthest_from_data": ("farthest_from_data_of_demo",),
    "farthest_turn_from_data": ("farthest_turn_from_data_of_demo",),
    "share_in_support": (),
    "energy": ("energy_of_straight_line",),
    "turning": ("turning_of_demo",),
    "jerk": ("jerk_of_demo",),
    "group_switches": (),
    "start_residual": (),
    "goal_residual": (),
    "planned_share": (),
}
LABELS = {
    "position_dtwd_ratio": "DTWD / distance between demonstrations, position",
    "position_dtwd_ratio_of_averaged_demo": "averaged demonstration instead",
    "position_dtwd_ratio_of_straight_line": "straight latent line instead",
    "orientation_dtwd_ratio": "DTWD / distance between demonstrations, orientation",
    "orientation_dtwd_ratio_of_averaged_demo": "averaged demonstration instead",
    "orientation_dtwd_ratio_of_straight_line": "straight latent line instead",
    "joint_dtwd_ratio": "DTWD / distance between demonstrations, joints",
    "joint_dtwd_ratio_of_averaged_demo": "averaged demonstration instead",
    "joint_dtwd_ratio_of_straight_line": "straight latent line instead",
    "position_dtwd_per_point": "DTWD per point, position",
    "orientation_dtwd_per_point": "DTWD per point, orientation",
    "joint_dtwd_per_point": "DTWD per point, joints",
    "farthest_from_data": "Farthest from the data",
    "farthest_from_data_of_demo": "the demonstrations themselves",
    "farthest_turn_from_data": "Largest angle to orientations demonstrated nearby",
    "farthest_turn_from_data_of_demo": "the demonstrations themselves",
    "share_in_support": "Share of the path inside the support cap",
    "energy": "Energy",
    "energy_of_straight_line": "straight latent line instead",
    "turning": "Turning of the path",
    "turning_of_demo": "the demonstrations themselves",
    "jerk": "Dimensionless jerk",
    "jerk_of_demo": "the demonstrations themselves",
    "group_switches": "Changes between groups of demonstrations",
    "start_residual": "Manifold to the wanted start",
    "goal_residual": "Manifold to the wanted goal",
    "planned_share": "Share for which a path was found",
    "pairs": "From every group's start to every group's goal, shown or not",
    "methods": "The same geodesic by several methods",
    "arm_failures": "Joint solutions of decoded poses that touch the obstacle",
}
GEODESICS = Subject("Geodesics between the ends of demonstrations", ORDER, LABELS)


def headlines(scores: Scores, replay: Mapping[str, Any] | None) -> list[Headline]:
    """The few numbers to look at first, as far as they were judged; held-out demonstrations before training ones.

    Args:
        scores: Of ``scores.json``.
        replay: Contents of ``replay.json``; None without a replay stage.
    """
    name = next((name for name in reversed(SETS) if any(score.startswith(f"{name}.") for score in scores)), "")
    kind = f"{SETS.get(name, '')} demonstrations".replace("held out", "held-out")
    chosen = []
    for part in ("position", "orientation", "joint"):
        ratio = f"{name}.{part}_dtwd_ratio"
        if ratio in scores:
            note = f"{kind}; averaged demonstration {quantity(scores, f'{ratio}_of_averaged_demo')}; another one is 1"
            chosen.append(Headline(f"DTWD ratio, {part}", quantity(scores, ratio), note))
    if (farthest := f"{name}.farthest_from_data") in scores:
        note = f"{kind} themselves: {quantity(scores, f'{farthest}_of_demo')}"
        chosen.append(Headline("Farthest from the data", quantity(scores, farthest), note))
    if (planned := f"{name}.planned_share") in scores:
        note = f"between the ends of {scores[planned].get('count', '?')} {kind}"
        chosen.append(Headline("Paths found", quantity(scores, planned), note))
    return [*chosen, *_tracking(replay)]


def _tracking(replay: Mapping[str, Any] | None) -> list[Headline]:
    if (done := executed(replay)) is None:
        return []
    value = f"{mm(done['tracking_worst_m'])}, {deg(done['tracking_worst_rad'])}"
    return [Headline("Tracking error at worst", value, "of the simulated robot, against the commanded poses")]
