"""Scores of a learned field: their order, their names, and which to look at first."""

from collections.abc import Mapping

from geomotion.figures.report.scores import SETS, Headline, Scores, Subject, quantity

REPRODUCTION: Mapping[str, tuple[str, ...]] = {
    "dtwd_per_point": ("dtwd_to_nearest_demo", "dtwd_of_averaged_demo", "dtwd_between_demos"),
    "dtwd_ratio": (),
    "ratio_to_nearest_demo": (),
    "relative_velocity_error": ("nearest_neighbour_velocity_error",),
}
LABELS = {
    "dtwd_per_point": "DTWD, per point",
    "dtwd_sum": "DTWD, summed",
    "dtwd_ratio": "DTWD / distance between demonstrations",
    "ratio_to_nearest_demo": "DTWD / distance to the nearest demonstration",
    "dtwd_to_nearest_demo": "nearest other demonstration instead",
    "dtwd_of_averaged_demo": "averaged demonstration instead",
    "dtwd_between_demos": "any other demonstration instead",
    "dtw": "Dynamic time warping, per point",
    "dtw_sum": "Dynamic time warping, summed",
    "frechet": "Fréchet distance",
    "relative_velocity_error": "Relative velocity error",
    "nearest_neighbour_velocity_error": "velocity of the nearest known state instead",
    "velocity_rmse": "Velocity error (RMS)",
    "time_aligned_rmse": "Distance at equal times (RMS)",
    "rate": "Contraction rate (largest eigenvalue)",
    "mean_rate": "Mean of the largest eigenvalue",
    "ratio": "Contraction ratio",
    "non_contracting_fraction": "Share of points that do not contract",
    "margin": "Largest excess over the proven rate",
    "contracting": "Share of the box proven to contract",
    "not_contracting": "Share of the box proven not to contract",
    "undecided": "Share of the box of which nothing is proven",
    "witness": "Positive eigenvalue at one state, at least",
    "max_expansion": "Largest distance / initial distance",
    "final_ratio": "Final distance / initial distance",
    "growing_share": "Share of time steps in which the distance grows",
    "bound_excess": "Largest excess over the proven bound / initial distance",
    "never_reached": "Starts that never reach the goal",
    "clearance": "Smallest distance to an obstacle",
    "speed_at_goal": "Speed at the goal, where it should be zero",
    "goal_distance": "Distance of the equilibrium to the goal",
    "end_distance": "Distance of the equilibrium to where demonstrations end",
    "joint_rmse": "Joints at equal times (RMS)",
    "joint_rmse_worst_joint": "Worst joint at equal times (RMS)",
    "back_within_3deg_share": "Back within 3 deg of the path (RMS) before the end",
    "back_within_3deg": "Time until back within 3 deg of the path (RMS)",
    "back_within_3deg_worst": "Time until back within 3 deg of the path (RMS), worst",
    "left_half_way_equal_time": "Left half-way, at equal times",
    "left_half_way_equal_time_worst": "Left half-way, at equal times, worst",
    "back_within_25mm_share": "Back within 25 mm in 6 % of the duration",
    "back_within_25mm": "Time until back within 25 mm",
    "back_within_25mm_worst": "Time until back within 25 mm, worst",
    "back_within_10mm_share": "Back within 10 mm in 25 % of the duration",
    "back_within_10mm": "Time until back within 10 mm",
    "back_within_10mm_worst": "Time until back within 10 mm, worst",
    "left_at_end": "Left at the end",
    "left_at_end_worst": "Left at the end, worst",
    "left_at_end_equal_time": "Left at the end, at equal times",
    "left_at_end_equal_time_worst": "Left at the end, at equal times, worst",
    "peak_speed": "Highest speed / that of the undisturbed motion",
    "peak_speed_worst": "Highest speed / that of the undisturbed motion, worst",
    "peak_speed_share": "Speed at most 1.5 times that of the undisturbed motion",
    "recovery_ratio": "Time to a fifth of the distance / what the rate promises",
}
FIELD = Subject("Reproduction of the demonstrations, from their own starts", REPRODUCTION, LABELS)


def headlines(scores: Scores) -> list[Headline]:
    """The few numbers to look at first, as far as they were judged."""
    chosen = []
    for name, kind in (("heldout", "held-out"), ("train", "training")):
        if f"{name}.dtwd_per_point" in scores:
            note = f"mean DTWD per point; nearest other one: {quantity(scores, f'{name}.dtwd_to_nearest_demo')}"
            value = quantity(scores, f"{name}.dtwd_per_point")
            chosen.append(Headline(f"Distance to {kind} demonstrations", value, note))
    errors = [f"{name}.relative_velocity_error" for name in reversed(SETS)]
    if name := next((name for name in errors if name in scores), ""):
        kind = SETS[name.partition(".")[0]].replace(" ", "-")
        note = f"on {kind} demonstrations; 0 is perfect, 1 as good as standing still"
        chosen.append(Headline("Relative velocity error", quantity(scores, name), note))
    if "goal.never_reached" in scores:
        note = f"of {scores['goal.never_reached'].get('count', '?')} starts around the demonstrations"
        chosen.append(Headline("Never reach the goal", quantity(scores, "goal.never_reached"), note))
    return chosen
