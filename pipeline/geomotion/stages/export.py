"""Turn a trained skill into files that other programs can run."""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from dataclasses import field as default
from importlib.resources import files
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from geomotion import conditional_models
from geomotion.conditional_models import ConditionalSkill
from geomotion.config import NoObstacle, NoSafety, ObstacleConfig, PolicyConfig, SafetyConfig
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.pose_vectors import with_pose_vectors
from geomotion.export import Arrays, OnnxPolicy, export_onnx, query_time_ms
from geomotion.files import write_json
from geomotion.models import Skill
from geomotion.obstacles.safety_region import Levels
from geomotion.policy import ports
from geomotion.policy.policy import Policy
from geomotion.policy.ports import Input, Status
from geomotion.policy.sphere import Avoidance
from geomotion.policy.training_range import TrainingRange
from geomotion.stages.safety import safe
from geomotion.tracking import Artefacts, StageRun
from geomotion.types import Tensor

CHECKED_STATES = 256
LATEST = 1.5  # of the times that are checked, in mean durations
BALL = 0.3  # radius of the ball that is checked, of the demonstrations' half extent
EXAMPLE = "policy_example.py"


@dataclass(frozen=True)
class ExportConfig:
    """What the export stage needs.

    Attributes:
        policy: What a policy says of states outside of the demonstrations, and does about obstacles.
        register_as: Name in MLflow's model registry; None to leave it out.
        safety: In which region the policy stays; none for any.
        obstacle: What is kept out of that region; without a region a policy is told of obstacles at run time.
    """

    policy: PolicyConfig
    register_as: str | None = None
    safety: SafetyConfig = default(default_factory=NoSafety)
    obstacle: ObstacleConfig = default(default_factory=NoObstacle)


def export(config: ExportConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``policy.onnx``, ``policy.json`` and ``policy_example.py``; log the MLflow model.

    ``policy.json`` tells inputs, outputs, agreement with the trained model and query time.
    """
    skill = conditional_models.load(inputs["train"].path("model.pt"))
    every = with_pose_vectors(storage.load(inputs["ingest"].folder), _plain(skill).pose)
    if (region := safe(config.safety, config.obstacle, skill, every)) is not None:
        skill = replace(region.skill, field=region.charted_field())
    plain = _plain(skill)
    demonstrations = every.select(plain.train_demos)
    policy = trained_policy(skill, demonstrations, config.policy)
    path = run.folder / "policy.onnx"
    export_onnx(policy, path)
    exported = OnnxPolicy(path)
    start = demonstrated_start(policy, demonstrations)
    document = {
        **_interface(policy),
        **_goals(skill),
        "range": _range(policy),
        **({} if plain.pose is None else {"pose": plain.pose.document()}),
        **({} if policy.safe is None else {"safety": _levels(policy.safe.region.levels)}),
        "example": {
            "inputs": {name: values[0].tolist() for name, values in start.items()},
            "goal": _goal(skill, demonstrations),
            "duration_s": plain.geometry.duration_s,
        },
        "max_difference_to_torch": _largest_differences(policy, exported, demonstrations),
        "query_time_ms": query_time_ms(exported, start),
    }
    write_json(run.folder / "policy.json", document)
    shutil.copyfile(str(files("geomotion.policy") / EXAMPLE), run.folder / EXAMPLE)
    run.log_series(0, {"query_time_ms": document["query_time_ms"]})
    run.log_policy(path, policy.inputs, policy.outputs, config.register_as)


def trained_policy(skill: Skill | ConditionalSkill, demonstrations: Demonstrations, config: PolicyConfig) -> Policy:
    """The policy of a skill.

    Args:
        skill: Trained.
        demonstrations: What it was fitted to, with the channels of its state.
        config: Margin of the range, and how obstacles are avoided.
    """
    plain = _plain(skill)
    states = np.concatenate([one.state(plain.state_channels) for one in demonstrations.trajectories])
    conditions = None
    if isinstance(skill, ConditionalSkill):
        conditions = torch.tensor([one.condition for one in demonstrations.trajectories])
    margin = config.range_margin
    training_range = TrainingRange(torch.tensor(states), margin * plain.geometry.scale_m, conditions, margin)
    obstacle = config.obstacle
    avoidance = Avoidance(obstacle.reactivity, obstacle.escape, obstacle.recovery_time_s, obstacle.hold)
    return Policy(skill, training_range, avoidance)


def policy_summary(document: Mapping[str, Any]) -> str:
    """Plain text: what goes in, what comes out, how fast and how exact it is."""
    needed = [name for name, one in document["inputs"].items() if "default" not in one]
    optional = [name for name, one in document["inputs"].items() if "default" in one]
    lines = [
        f"inputs   {', '.join(needed)}" + (f"; if wanted {', '.join(optional)}" if optional else ""),
        f"outputs  {', '.join(document['outputs'])}",
        f"query    {document['query_time_ms']:.3f} ms for one state on one core",
        f"differs  from the trained model by at most {differences(document)}",
    ]
    return "\n".join(lines)


def differences(document: Mapping[str, Any]) -> str:
    """How far an exported policy is from the trained model, in words."""
    largest = document["max_difference_to_torch"]
    return ", ".join(f"{largest[name]:.1g} {document['outputs'][name]['unit']}" for name in largest)


def demonstrated_start(policy: Policy, demonstrations: Demonstrations) -> Arrays:
    """What a robot would tell the policy at the start of the first demonstration."""
    first = demonstrations[0]
    state = torch.tensor(first.state(policy.channels)[:1])
    asked = _arrays(policy, state, torch.tensor([first.condition]), torch.zeros(1, 1))
    return {**asked, **_remembered(policy, state)}


def _plain(skill: Skill | ConditionalSkill) -> Skill:
    return skill if isinstance(skill, Skill) else skill.augmented


def _interface(policy: Policy) -> dict[str, Any]:
    """Names, shapes and units."""
    inputs: dict[str, Any] = {}
    for one in policy.inputs:
        inputs[one.name] = {"shape": ["batch" if one.default is None else 1, one.width], "unit": one.unit}
        if one.default is not None:
            inputs[one.name]["default"] = list(one.default)
    outputs = {
        one.name: {"shape": ["batch", *([] if one.width is None else [one.width])], "unit": one.unit}
        for one in policy.outputs
    }
    return {
        "inputs": inputs,
        "outputs": outputs,
        "state_channels": list(policy.channels),
        "status": {str(int(one)): one.name for one in Status},
    }


def _goals(skill: Skill | ConditionalSkill) -> dict[str, Any]:
    """Where motions end; with conditions, what these are and where motions end under those demonstrated."""
    if isinstance(skill, Skill) and skill.pose is not None:
        joints, pose = torch.tensor(skill.geometry.goal, dtype=torch.float64).tensor_split([skill.joints])
        position, orientation = skill.pose.to_pose(pose)
        goal = {ports.POSITION: position.tolist(), ports.ORIENTATION: orientation.tolist()}
        return {"goal": goal | ({ports.JOINTS: joints.tolist()} if skill.joints else {})}
    if isinstance(skill, Skill):
        return {"goal": list(skill.geometry.goal)}
    return {
        "condition": list(skill.conditioning.names),
        "demonstrated": {
            name: {"condition": list(condition), "goal": skill.conditioning.goal_at(np.array(condition)).tolist()}
            for name, condition in skill.conditions.items()
        },
    }


def _goal(skill: Skill | ConditionalSkill, demonstrations: Demonstrations) -> list[float]:
    """Of the first demonstration, in what the first input is."""
    if isinstance(skill, ConditionalSkill):
        goal: list[float] = skill.conditioning.goal_at(np.array(demonstrations[0].condition)).tolist()
        return goal
    return list(skill.geometry.goal[: (skill.joints or 3) if skill.pose is not None else None])


def _levels(levels: Levels) -> dict[str, float]:
    return {"rho": levels.impenetrable, "nu": levels.inactive}


def _range(policy: Policy) -> dict[str, Any]:
    found = policy.training_range
    conditions = [ports.CONDITION] if policy.conditional is not None else []
    return {"of": [*policy.channels, *conditions], "lower": found.lower.tolist(), "upper": found.upper.tolist()}


def _largest_differences(policy: Policy, exported: OnnxPolicy, demonstrations: Demonstrations) -> dict[str, float]:
    """Over random states in the range of the demonstrations, plainly, and with a ball in the way and a start told."""
    generator = torch.Generator().manual_seed(0)
    lower, upper = (side[: policy.dim] for side in (policy.training_range.lower, policy.training_range.upper))
    states = lower + torch.rand(CHECKED_STATES, policy.dim, generator=generator) * (upper - lower)
    conditions = torch.tensor([one.condition for one in demonstrations.trajectories])
    shown = conditions[torch.arange(CHECKED_STATES) % len(conditions)]
    times = LATEST * policy.field.time_unit_s * torch.rand(CHECKED_STATES, 1, generator=generator)
    asked = dict(_arrays(policy, states, shown, times))
    changed = {one.name: np.array([one.default], np.float32) for one in policy.inputs if one.default is not None}
    if ports.OBSTACLE_RADIUS in changed:
        width = changed[ports.OBSTACLE_CENTRE].shape[1]
        changed[ports.OBSTACLE_CENTRE][:] = ((lower + upper) / 2)[:width].numpy()
        changed[ports.OBSTACLE_RADIUS][:] = BALL * policy.scale_m
    changed |= _remembered(policy, torch.tensor(demonstrations[0].state(policy.channels)[:1]))
    largest: dict[str, float] = {}
    for inputs in (asked, asked | changed):
        with torch.no_grad():
            expected = policy(*(torch.tensor(_or_default(one, inputs)) for one in policy.inputs))
        found = exported(inputs)
        for one, ours in zip(policy.outputs, expected, strict=True):
            if one.name != ports.STATUS:
                difference = float(np.abs(found[one.name] - ours.numpy()).max())
                largest[one.name] = max(largest.get(one.name, 0.0), difference)
    return largest


def _or_default(one: Input, inputs: Arrays) -> NDArray[np.float32]:
    return inputs[one.name] if one.name in inputs else np.array([one.default], np.float32)


def _arrays(policy: Policy, states: Tensor, conditions: Tensor, times_s: Tensor) -> Arrays:
    """What a robot in these states has to tell the policy."""
    asked = _measured(policy, states) | {ports.CONDITION: conditions, ports.ELAPSED: times_s}
    return {one.name: asked[one.name].float().numpy() for one in policy.inputs if one.default is None}


def _measured(policy: Policy, states: Tensor) -> dict[str, Tensor]:
    if policy.pose is None:
        return {policy.inputs[0].name: states}
    joints, pose = states.float().tensor_split([policy.joints], dim=-1)
    position, orientation = policy.pose.to_pose(pose)
    measured = {ports.JOINTS: joints} if policy.joints else {}
    return measured | {ports.POSITION: position, ports.ORIENTATION: orientation}


def _remembered(policy: Policy, start: Tensor) -> Arrays:
    """What a robot that began there may tell the policy of it."""
    told = {ports.START + name: value.float().numpy() for name, value in _measured(policy, start).items()}
    return {one.name: told[one.name] for one in policy.inputs if one.name in told}
