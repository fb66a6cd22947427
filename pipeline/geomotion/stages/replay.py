"""Execute a planned motion on the simulated arm."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from geomotion.demos import storage
from geomotion.errors import InvalidSetting
from geomotion.figures.replay import save_replay_figure
from geomotion.files import read_json, write_json
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import QUATERNION, MotionPath, PosePath
from geomotion.stages.executed import executed_trajectory, tracking_document, tracking_picture, tracking_rows
from geomotion.stages.execution import Planned, Replay, ReplayStageConfig, execute
from geomotion.stages.graph import load_skilled
from geomotion.stages.scene import solids
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun

__all__ = ["ReplayStageConfig", "replay", "replay_table"]


def replay(config: ReplayStageConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``replay.json``, the executed ``trajectory/``, ``film.gif`` and ``figures/replay``.

    Without a path there is nothing to execute: ``replay.json`` then says so, and the rest is left out.

    Raises:
        InvalidSetting: If the demonstrations are neither poses in R³×S³ nor configurations of an arm.
    """
    skilled = load_skilled(inputs, config.metric)
    first = skilled.manifold.data.paths[0]
    dims = first.position_m.shape[1], first.orientation.shape[1]
    if dims != (3, QUATERNION):
        found = f"poses in R{dims[0]} x S{dims[1] - 1}"
        raise InvalidSetting("dataset", found, "poses in R3 x S3, which a robot can take")
    plan = read_json(inputs["plan"].path("plan.json"))
    if not plan["found"]:
        reasons = [leg["reason"] for leg in plan["legs"] if leg["status"] != "found"]
        write_json(run.folder / "replay.json", {"executed": False, "reason": reasons[0]})
        return
    demonstrations = storage.load(inputs["ingest"].folder)
    done = execute(config, skilled, demonstrations, _planned(inputs["plan"], plan["legs"], first))
    write_json(run.folder / "replay.json", _document(config, done))
    doing = "planned by geomotion from"
    storage.save(
        executed_trajectory(demonstrations, done.arm, done.tracking, "geodesic", doing), run.folder / "trajectory"
    )
    if done.film is not None:
        done.film.save(run.folder / "film.gif")
    save_replay_figure(tracking_picture(done.arm, done.tracking, _stretch(done)), run.folder / "figures")


def replay_table(document: Mapping[str, Any]) -> str:
    """What the arm did, in lines for people."""
    if not document["executed"]:
        return f"not executed: {document['reason']}"
    timing = f"{document['timing']}, stretched {document['stretch']:.2f} times"
    rows = []
    if document["states"] == "poses":
        lost = f", {len(document['unreachable'])} not" if document["unreachable"] else ""
        rows.append(("reached by inverse kinematics", f"{document['reached_share']:.1%} of the poses{lost}"))
    rows += [
        ("duration", f"{document['duration_s']:.2f} s ({'in closed loop' if document['closed_loop'] else timing})"),
        (
            "tracking error",
            f"at most {1000 * document['tracking_worst_m']:.2f} mm, "
            f"{np.degrees(document['tracking_worst_rad']):.2f} deg",
        ),
    ]
    rows += tracking_rows(document)
    if document["closed_loop"]:
        reached = "reached" if document["reached_goal"] else "not reached"
        rows.append(("goal", f"{reached}; {document['waited_s']:.2f} s without a way on"))
        rows.append(("replanned", f"{document['replans']} times, {document['replan_median_ms']:.1f} ms median"))
    for one in document["unreachable"][:5]:
        left = f"{1000 * one['position_error_m']:.1f} mm, {np.degrees(one['orientation_error_rad']):.1f} deg remain"
        rows.append((f"  pose {one['index']}", f"out of reach: {left}"))
    return aligned(rows)


def _planned(plan: Artefacts, legs: Sequence[Mapping[str, Any]], like: MotionPath) -> Planned:
    path: MotionPath
    with np.load(plan.path("path.npz"), allow_pickle=False) as stored:
        if isinstance(like, ConfigurationPath):
            path = like.with_vectors(stored["joints_rad"])
        else:
            path = PosePath(stored["position_m"], stored["orientation"])
        progress = stored["progress"]
    return Planned(path, progress, [0, *np.cumsum([leg["points"] - 1 for leg in legs]).tolist()])


def _document(config: ReplayStageConfig, done: Replay) -> dict[str, Any]:
    tracking, joints, pilot = done.tracking, done.joints, done.pilot
    return {
        "executed": True,
        "states": "configurations" if isinstance(done.path, ConfigurationPath) else "poses",
        "timing": config.robot.timing.value,
        "stretch": _stretch(done),
        "reached_share": 1 - len(done.unreachable) / done.asked,
        "unreachable": [vars(one) for one in done.unreachable],
        "ik_worst_m": float(joints.position_error_m.max()),
        "ik_worst_rad": float(joints.orientation_error_rad.max()),
        "largest_joint_step_rad": joints.largest_step_rad,
        **tracking_document(done.arm, tracking, bool(solids(config.obstacle))),
        "closed_loop": pilot is not None,
        "replans": 0 if pilot is None else len(pilot.seconds),
        "replan_median_ms": None if pilot is None else 1000 * float(np.median(pilot.seconds)),
        "waited_s": 0.0 if pilot is None else pilot.waited_s,
        "reached_goal": None if pilot is None else pilot.reached_goal,
    }


def _stretch(done: Replay) -> float:
    """How many times longer than its own timing the motion took; a closed loop has no timing of its own."""
    return done.timed.stretch if done.pilot is None else 1.0
