"""Execute a learned policy in closed loop on the simulated Panda, and judge how it copes."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from geomotion import conditional_models
from geomotion.demos import storage
from geomotion.demos.pose_vectors import with_pose_vectors
from geomotion.figures.policy_region import save_policy_region_figure
from geomotion.figures.policy_replay import PolicyPicture, save_policy_replay_figure
from geomotion.files import read_json, write_json
from geomotion.robot.field_policy import FieldPolicy
from geomotion.robot.policy_loop import PolicyRun
from geomotion.stages.executed import executed_trajectory, tracking_document, tracking_picture, tracking_rows
from geomotion.stages.policy_execution import Disturbances, cannot_start, disturbances, execute
from geomotion.stages.policy_judgement import executed_states, judge_run
from geomotion.stages.policy_motion import (
    LONGER,
    Beginning,
    PolicyReplayConfig,
    arm_states,
    chosen_skill,
    led_field,
    simulated_panda,
    undisturbed,
)
from geomotion.stages.region_execution import in_region, region_document, region_picture, region_rows
from geomotion.stages.safety import safe
from geomotion.stages.scene import solids
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun

__all__ = ["PolicyReplayConfig", "policy_replay_table", "replay_policy"]


def replay_policy(config: PolicyReplayConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``replay.json``, the executed ``trajectory/``, ``film.gif`` and ``figures/closed_loop``.

    With a safety region, the same is executed without it, to be compared in ``figures/closed_loop_region``. Where the
    arm cannot take the start, nothing is executed: ``replay.json`` then says so, and the rest is left out.

    Raises:
        InvalidSetting: If the skill is of nothing that the Panda can follow, or settings do not fit it.
    """
    demonstrations = storage.load(inputs["ingest"].folder)
    loaded = conditional_models.load(inputs["train"].path("model.pt"))
    skill, begins = chosen_skill(config.replay, loaded, demonstrations)
    arm, duration_s = simulated_panda(config.replay), config.replay.duration_s or LONGER * begins.duration_s
    states = arm_states(skill, begins)
    region = safe(config.safety, config.obstacle, loaded, with_pose_vectors(demonstrations, skill.pose))
    if region is None:  # which is one for motions from any start
        skill = skill.begun(begins.state)
    field, moved = led_field(config, skill, region)
    alone = undisturbed(field, states, begins, arm, duration_s, region)
    if (reason := cannot_start(arm, alone, begins)) is not None:
        write_json(run.folder / "replay.json", {"executed": False, "reason": reason})
        return
    pushes = disturbances(config.replay, begins, alone)
    executed, film, effort_nm = execute(config, FieldPolicy(field, states), arm, alone, pushes, duration_s)
    judged = judge_run(skill, arm_states(skill, begins), moved, arm, alone, pushes, executed, effort_nm)
    rate_per_s = read_json(inputs["train"].path("certificate.json"))["rate_per_s"]
    document = {
        **_settings(config, begins),
        **tracking_document(arm, executed.tracking, bool(solids(config.obstacle))),
        **_timing(executed),
        **judged.document(pushes, rate_per_s),
    }
    if region is not None:
        unfilmed = replace(config, replay=replace(config.replay, film=False))
        policy = FieldPolicy(skill.field, arm_states(skill, begins))
        free = execute(unfilmed, policy, arm, alone, pushes, duration_s)[0]
        with_region, without = (
            in_region(region, executed_states(arm_states(skill, begins), one.tracking), one.tracking)
            for one in (executed, free)
        )
        document["safety"] = region_document(region, with_region, without)
        save_policy_region_figure(region_picture(region, alone, with_region, without, pushes), run.folder / "figures")
    write_json(run.folder / "replay.json", document)
    doing = "led by a policy that was learned from"
    storage.save(
        executed_trajectory(demonstrations, arm, executed.tracking, begins.label, doing), run.folder / "trajectory"
    )
    if film is not None:
        film.save(run.folder / "film.gif")
    picture = PolicyPicture(
        tracking_picture(arm, executed.tracking),
        alone.position_m,
        judged.deviation.to_path_m,
        executed.speed_m_per_s,
        _windows(pushes),
        tuple(change.time_s for change in config.replay.goal_changes),
    )
    save_policy_replay_figure(picture, run.folder / "figures")


def policy_replay_table(document: Mapping[str, Any]) -> str:
    """What the arm did, in lines for people."""
    if not document["executed"]:
        return f"not executed: {document['reason']}"
    return aligned(policy_replay_rows(document))


def policy_replay_rows(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The same, as names and values."""
    return [
        ("start", f"{document['start']}; {document['duration_s']:.2f} s at {document['control_hz']:g} Hz"),
        ("policy", f"{document['thinking_median_ms']:.2f} ms (median), {document['thinking_worst_ms']:.2f} ms (worst)"),
        ("error at the end", _end_error(document)),
        ("from the undisturbed path", f"at most {1000 * document['largest_deviation_m']:.1f} mm"),
        *(_push_row(push) for push in document["pushes"]),
        ("peak speed", f"{document['peak_speed_ratio']:.2f} times that of the undisturbed motion"),
        ("effort", f"{document['energy_j']:.1f} J, at most {document['largest_torque_share']:.0%} of a motor's torque"),
        ("joint speed", f"at most {document['largest_velocity_share']:.0%} of the limit"),
        ("cut short by joint limits", f"{document['cut_short_share']:.1%} of the periods"),
        *tracking_rows(document),
        *(region_rows(document["safety"]) if "safety" in document else ()),
    ]


def _end_error(document: Mapping[str, Any]) -> str:
    parts = []
    if document["end_error_m"] is not None:
        parts.append(f"{1000 * document['end_error_m']:.1f} mm")
    if document["end_error_rad"] is not None:
        parts.append(f"{np.degrees(document['end_error_rad']):.2f} deg")
    return ", ".join(parts)


def _push_row(push: Mapping[str, Any]) -> tuple[str, str]:
    found = [f"{1000 * push['pushed_m']:.1f} mm away"]
    found += [
        f"back within {limit_mm} mm {'never' if after_s is None else f'after {after_s:.2f} s'}"
        for limit_mm, after_s in push["back_s"].items()
    ]
    rate, certified = push["claimed_rate_per_s"], push["certified_rate_per_s"]
    if rate is not None:
        proven = "" if certified is None else f" ({certified:.2g} certified)"
        found.append(f"at {rate:.2g} 1/s{proven}")
    return f"push at {push['time_s']:.2f} s", ", ".join(found)


def _settings(config: PolicyReplayConfig, begins: Beginning) -> dict[str, Any]:
    replay = config.replay
    return {
        "executed": True,
        "start": begins.label,
        "control_hz": replay.control_hz,
        "damping_n_s_per_m": replay.damping_n_s_per_m,
        "noise_m": replay.noise_m,
        "noise_rad": replay.noise_rad,
        "latency_s": round(replay.latency_s * replay.control_hz) / replay.control_hz,
        "goal_changes": [{"time_s": change.time_s, "shift_m": change.shift_m} for change in replay.goal_changes],
    }


def _timing(executed: PolicyRun) -> dict[str, float]:
    return {
        "thinking_median_ms": 1000 * float(np.median(executed.thinking_s)),
        "thinking_worst_ms": 1000 * float(executed.thinking_s.max()),
        "cut_short_share": float(executed.is_cut_short.mean()),
    }


def _windows(pushes: Disturbances) -> tuple[tuple[float, float], ...]:
    """When pushes begin and end [s]."""
    return tuple((push.time_s, push.end_s) for push in pushes)
