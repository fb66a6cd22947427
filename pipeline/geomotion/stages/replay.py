"""Execute a planned motion on the simulated arm."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.errors import InvalidSetting
from geomotion.figures.replay import ReplayPicture, save_replay_figure
from geomotion.files import read_json, write_json
from geomotion.robot.recording import Tracking
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import QUATERNION, MotionPath, PosePath
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
    storage.save(_trajectory(demonstrations, done), run.folder / "trajectory")
    if done.film is not None:
        done.film.save(run.folder / "film.gif")
    save_replay_figure(_picture(done), run.folder / "figures")


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
    if document["limit_margin_rad"] is not None:
        rows.append(("joint-limit margin", f"{np.degrees(document['limit_margin_rad']):.1f} deg"))
    if document["self_clearance"] is not None:
        links, apart = document["self_clearance"]["links"], document["self_clearance"]["distance_m"]
        rows.append(("links to each other", f"{1000 * apart:.1f} mm ({' to '.join(links)})"))
    if document["clearance_m"]:
        link, apart = min(document["clearance_m"].items(), key=lambda item: item[1])
        rows.append(("smallest clearance", f"{1000 * apart:.1f} mm ({link})"))
        rows.append(("contacts", ", ".join(document["contacts"]) or "none"))
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
        "arm": done.arm.name,
        "states": "configurations" if isinstance(done.path, ConfigurationPath) else "poses",
        "frame": done.arm.tip_link,
        "timing": config.robot.timing.value,
        "duration_s": float(tracking.time_s[-1]),
        "stretch": _stretch(done),
        "reached_share": 1 - len(done.unreachable) / done.asked,
        "unreachable": [vars(one) for one in done.unreachable],
        "ik_worst_m": float(joints.position_error_m.max()),
        "ik_worst_rad": float(joints.orientation_error_rad.max()),
        "largest_joint_step_rad": joints.largest_step_rad,
        "tracking_worst_m": float(tracking.position_error_m.max()),
        "tracking_worst_rad": float(tracking.orientation_error_rad.max()),
        "limit_margin_rad": _finite(tracking.limit_margin_rad.min()),
        "self_clearance": _self_clearance(tracking),
        "clearance_m": tracking.smallest_clearance_m if solids(config.obstacle) else {},
        "contacts": tracking.contact_steps,
        "closed_loop": pilot is not None,
        "replans": 0 if pilot is None else len(pilot.seconds),
        "replan_median_ms": None if pilot is None else 1000 * float(np.median(pilot.seconds)),
        "waited_s": 0.0 if pilot is None else pilot.waited_s,
        "reached_goal": None if pilot is None else pilot.reached_goal,
    }


def _self_clearance(tracking: Tracking) -> dict[str, Any] | None:
    """The two links that come nearest to each other; None if all stay as far apart as is measured."""
    if not tracking.self_clearance_m:
        return None
    links, distance_m = min(tracking.self_clearance_m.items(), key=lambda item: item[1])
    return {"links": list(links), "distance_m": distance_m}


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _stretch(done: Replay) -> float:
    """How many times longer than its own timing the motion took; a closed loop has no timing of its own."""
    return done.timed.stretch if done.pilot is None else 1.0


def _trajectory(demonstrations: Demonstrations, done: Replay) -> Demonstrations:
    """What was executed, in the layout of demonstrations, to be run elsewhere."""
    tracking = done.tracking
    channels = {
        "position_m": tracking.position_m,
        "orientation_wxyz": tracking.orientation_wxyz,
        "joints_rad": tracking.commanded_joints_rad,
    }
    one = Trajectory(tracking.time_s - tracking.time_s[0], channels, "geodesic")
    return Demonstrations(
        f"{demonstrations.name}/replay",
        (one,),
        "R3xS3xjoint",
        f"{done.arm.base_link} of {done.arm.name}; poses of {done.arm.tip_link}",
        f"planned by geomotion from {demonstrations.name} and executed in simulation; {demonstrations.source}",
        demonstrations.licence,
    )


def _picture(done: Replay) -> ReplayPicture:
    tracking = done.tracking
    commanded_m, _ = done.arm.chain.pose(tracking.commanded_joints_rad)
    return ReplayPicture(
        tracking.time_s,
        tracking.position_error_m,
        tracking.orientation_error_rad,
        tracking.limit_margin_rad,
        tracking.clearance_time_s,
        tracking.clearance_m,
        commanded_m,
        tracking.position_m,
        _stretch(done),
    )
