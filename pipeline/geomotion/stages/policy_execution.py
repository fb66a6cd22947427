"""A skill in closed loop on the simulated Panda, and what disturbs it there."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from geomotion import config as schema
from geomotion.errors import InvalidSetting
from geomotion.obstacles.solids import SPACE
from geomotion.robot import panda
from geomotion.robot.arm import Arm
from geomotion.robot.disturbances import Displacement, Push, Sensors
from geomotion.robot.field_policy import FieldPolicy
from geomotion.robot.film import Film, draw_path
from geomotion.robot.policy_loop import PolicyLoop, PolicyRun
from geomotion.robot.scene import ArmScene
from geomotion.stages.policy_motion import Beginning, PolicyReplayConfig, Undisturbed
from geomotion.stages.scene import moving_bodies

PUSH_M, PUSH_S, PUSH_AT = 0.05, 0.25, 0.4  # where nothing else is asked for; the last is a share of the motion

Disturbances = Sequence[Push | Displacement]


def cannot_start(arm: Arm, alone: Undisturbed, begins: Beginning) -> str | None:
    """Why the arm cannot take the start of a motion; None if it can."""
    if not alone.path.reached[0]:
        left_mm = 1000 * alone.path.position_error_m[0]
        return f"the arm cannot take the start, {begins.label}: {left_mm:.0f} mm remain"
    with ArmScene(arm, panda.GRIPPER) as scene:
        scene.set_joints(alone.path.joints_rad[0])
        touching = scene.self_clearances(up_to_m=0.0)
    if not touching:
        return None
    links, apart_m = min(touching.items(), key=lambda one: one[1])
    deep = f"{' and '.join(links)}, {-1000 * apart_m:.0f} mm deep"
    return f"the arm would hit itself at the start, {begins.label}: {deep}. Motions are in the arm's base frame"


def disturbances(config: schema.ReplayConfig, begins: Beginning, alone: Undisturbed) -> Disturbances:
    """The pushes that are asked for, in the order in which they begin; by default one, if the motion lasts as long.

    Raises:
        InvalidSetting: If one would begin after the motion.
    """
    duration_s = float(alone.time_s[-1])
    if config.pushes is None:
        time_s = PUSH_AT * begins.duration_s
        return [_across(alone, time_s, config.damping_n_s_per_m)] if time_s < duration_s else []
    for one in config.pushes:
        if one.time_s >= duration_s:
            raise InvalidSetting("replay.pushes.time_s", one.time_s, f"less than the {duration_s:.3g} s of the motion")
    return sorted((_push(one) for one in config.pushes), key=lambda one: one.time_s)


def _push(config: schema.PushConfig) -> Push | Displacement:
    if config.displacement_m is not None:
        return Displacement(config.time_s, np.array(config.displacement_m))
    return Push(config.time_s, config.duration_s, np.array(config.force_n), config.profile.value)


def _across(alone: Undisturbed, time_s: float, damping_n_s_per_m: float) -> Push:
    """A push that moves the arm by 5 cm to the left of where it goes, or to any side where it goes up or down."""
    now = int(np.searchsorted(alone.time_s, time_s))
    ahead = alone.position_m[now] - alone.position_m[max(now - 1, 0)]
    left = np.array([-ahead[1], ahead[0], 0.0])
    if np.linalg.norm(left) < 0.1 * np.linalg.norm(ahead):
        left = np.array([0.0, 1.0, 0.0])
    return Push(time_s, PUSH_S, PUSH_M / PUSH_S * damping_n_s_per_m * left / np.linalg.norm(left))


def execute(
    config: PolicyReplayConfig,
    policy: FieldPolicy,
    arm: Arm,
    alone: Undisturbed,
    pushes: Disturbances,
    duration_s: float,
) -> tuple[PolicyRun, Film | None, Float[np.ndarray, " joint"]]:
    """Let the policy lead the arm in the simulator: what came of it, pictures, and what each motor can give [N m]."""
    replay, bodies = config.replay, moving_bodies(config.obstacle, SPACE)
    film = Film(fps=replay.film_fps) if replay.film else None
    late = round(replay.latency_s * replay.control_hz)
    with ArmScene(arm, panda.GRIPPER, table=replay.table) as scene:
        for body in bodies:
            scene.add_obstacle(body.name, body.body, body.motion.offset(0.0))
        if film is not None:
            draw_path(scene, alone.position_m)
        loop = PolicyLoop(
            scene,
            policy,
            replay.control_hz,
            replay.damping_n_s_per_m,
            Sensors(replay.noise_m, replay.noise_rad, late, replay.seed),
            pushes,
            {body.name: body.motion.offset for body in bodies},
            film,
        )
        return loop.run(alone.path.joints_rad[0], duration_s), film, scene.simulated.effort
