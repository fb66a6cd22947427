"""A skill as what leads the simulated Panda: its states on the arm, its field, and the motion that it makes alone."""

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as default
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from geomotion import config as schema
from geomotion.conditional_models import ConditionalSkill
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.pose_vectors import BODY_STATES, with_pose_vectors
from geomotion.dynamics.fields import TimedField, TimedVelocity
from geomotion.dynamics.moved_goal import MovedGoal
from geomotion.dynamics.rollout import rollout
from geomotion.errors import InvalidSetting
from geomotion.models import Skill
from geomotion.obstacles.solids import SPACE
from geomotion.robot import panda
from geomotion.robot.arm import Arm
from geomotion.robot.field_policy import JointStates, PoseStates, PositionStates
from geomotion.robot.inverse_kinematics import JointPath, exactly, solve_path
from geomotion.robot.panda_arm import panda_arm
from geomotion.safe_skills import SafeSkill
from geomotion.stages.phases import Start
from geomotion.stages.safe_motion import follow_in_region
from geomotion.stages.scene import around_obstacles, grown, solids

ARM_STATES: Mapping[tuple[str, ...], int] = {**BODY_STATES, ("joints_rad",): len(panda.JOINTS)}
LONGER = 1.25  # times a demonstration: the end is approached ever more slowly
HAND_DOWN = np.array([0.0, 1.0, 0.0, 0.0])
NOMINAL_HZ = 30.0
IK_POSES = 60  # of the undisturbed motion, by which the branch of the arm is chosen

States = Float[np.ndarray, "time D"]
AnyStates = PoseStates | PositionStates | JointStates


@dataclass(frozen=True)
class PolicyReplayConfig:
    """What the replay stage of `ncds` needs."""

    replay: schema.ReplayConfig
    obstacle: schema.ObstacleConfig
    safety: schema.SafetyConfig = default(default_factory=schema.NoSafety)


@dataclass(frozen=True)
class Beginning:
    """Where a motion starts.

    Attributes:
        label: What to call it.
        state: Shape (D,).
        duration_s: How long the demonstration took [s].
        orientation_wxyz: Held where states say nothing of it.
    """

    label: str
    state: Float[np.ndarray, " D"]
    duration_s: float
    orientation_wxyz: Float[np.ndarray, "4"]


@dataclass(frozen=True)
class Undisturbed:
    """What the policy would do alone.

    Attributes:
        time_s: Times.
        states: At these.
        path: Poses as joint positions of the arm.
        position_m: Of the tip.
    """

    time_s: Float[np.ndarray, " time"]
    states: States
    path: JointPath
    position_m: Float[np.ndarray, "time 3"]


def leads_an_arm(loaded: Skill | ConditionalSkill) -> bool:
    """Whether states are poses or positions in space, or joints of the Panda."""
    plain = loaded if isinstance(loaded, Skill) else loaded.augmented
    return ARM_STATES.get(plain.state_channels) == plain.field.dim - plain.geometry.context


def chosen_skill(
    config: schema.ReplayConfig, loaded: Skill | ConditionalSkill, demonstrations: Demonstrations
) -> tuple[Skill, Beginning]:
    """The skill, under the condition of the demonstration that it starts as, and where that is.

    Raises:
        InvalidSetting: If there is no such demonstration, or a state has another number of coordinates.
    """
    plain = loaded if isinstance(loaded, Skill) else loaded.augmented
    number = (plain.test_demos or plain.train_demos)[0]
    if not (config.start is None or isinstance(config.start, list)):
        number = _demonstration(config.start, len(demonstrations))
    skill = loaded if isinstance(loaded, Skill) else loaded.given(demonstrations[number].condition, "replay.start")
    return skill, _beginning(config, skill, demonstrations, number)


def _beginning(config: schema.ReplayConfig, skill: Skill, demonstrations: Demonstrations, number: int) -> Beginning:
    one = with_pose_vectors(demonstrations.select([number]), skill.pose)[0]
    state, label = one.state(skill.state_channels)[0], f"demonstration {number}"
    if isinstance(config.start, list):
        state, label = np.asarray(config.start, dtype=float), "given state"
        if len(state) != len(skill.geometry.goal):
            raise InvalidSetting("replay.start", config.start, f"{len(skill.geometry.goal)} coordinates of a state")
    orientation = one.channels["orientation_wxyz"][0] if "orientation_wxyz" in one.channels else HAND_DOWN
    return Beginning(label, state, one.duration_s, np.asarray(orientation, dtype=float))


def _demonstration(start: Any, count: int) -> int:
    kind, _, number = str(start).partition(":")
    if kind != "demo" or not number.isdigit() or int(number) >= count:
        raise InvalidSetting("replay.start", start, f"demo:0 to demo:{count - 1}, or the coordinates of a state")
    return int(number)


def led_field(
    config: PolicyReplayConfig, skill: Skill, region: SafeSkill | None = None
) -> tuple[TimedVelocity, MovedGoal | None]:
    """The skill's field in its safety region, or among obstacles and with a goal that moves, and that alone if it does.

    Raises:
        InvalidSetting: If an obstacle covers the goal, something in space is asked of a skill of joints, or the goal
            is to leave the safety region.
    """
    changes, goal = config.replay.goal_changes, skill.goal
    if region is not None:
        if changes:
            expected = "[] with safety=riemannian: the region lies around the demonstrations, which end at the goal"
            raise InvalidSetting("replay.goal_changes", f"{len(changes)} of them", expected)
        return region.charted_field(), None
    field: TimedVelocity = skill.field
    is_in_space = skill.state_channels != ("joints_rad",)
    if not is_in_space and (changes or solids(config.obstacle)):
        raise InvalidSetting("replay", "goal changes or obstacles", "a skill of poses or positions, which lie in space")
    moved = None
    if changes:
        shifts = torch.zeros(len(changes), len(goal))
        shifts[:, :SPACE] = torch.tensor([change.shift_m for change in changes])
        field = moved = MovedGoal(field, torch.tensor([change.time_s for change in changes]), shifts)
    obstacles = grown(config.obstacle, config.replay.clearance_m)
    around = around_obstacles(obstacles, field, goal, SPACE) if is_in_space else None
    return around or field, moved


def undisturbed(
    field: TimedVelocity,
    states: AnyStates,
    begins: Beginning,
    arm: Arm,
    duration_s: float,
    region: SafeSkill | None = None,
) -> Undisturbed:
    """The motion of the policy from its start, without anything that disturbs it."""
    times = torch.linspace(0, duration_s, round(duration_s * NOMINAL_HZ) + 1)
    if region is not None:
        start = Start(begins.label, begins.state, times.double().numpy())
        found = follow_in_region(region, start).states.double().numpy()
    else:
        clocked = torch.cat([torch.tensor(begins.state, dtype=torch.float32)[None], torch.zeros(1, 1)], dim=-1)
        found = rollout(TimedField(field), clocked, times, method="rk4").states[0, :, :-1].double().numpy()
    if isinstance(states, JointStates):
        path, position_m = exactly(found, arm.limits), arm.chain.pose(found)[0]
    else:
        position_m, orientation = states.poses(found)
        rows = np.linspace(0, len(found) - 1, IK_POSES).round().astype(int)
        path = solve_path(position_m[rows], orientation[rows], panda.frame_of(arm.tip_link))
    return Undisturbed(times.double().numpy(), found, path, position_m)


def simulated_panda(config: schema.ReplayConfig) -> Arm:
    """The arm whose tip the poses are of."""
    return panda_arm(tip_link=panda.FRAME_LINKS[config.frame.value])


def arm_states(skill: Skill, begins: Beginning) -> AnyStates:
    """What the skill's states are on the arm.

    Raises:
        InvalidSetting: If they are nothing that the arm has.
    """
    if not leads_an_arm(skill):
        found = f"states of {len(skill.geometry.goal)} coordinates of {', '.join(skill.state_channels)}"
        expected = (
            f"poses (space=R3xSO3), positions in space, or {len(panda.JOINTS)} joints: the Panda can follow those"
        )
        raise InvalidSetting("dataset", found, expected)
    if skill.pose is not None:
        exact = type(skill.pose).from_document(skill.pose.document())
        _, orientation = exact.to_pose(torch.tensor(begins.state))
        return PoseStates(exact, orientation.numpy())
    return JointStates() if skill.state_channels == ("joints_rad",) else PositionStates(begins.orientation_wxyz)
