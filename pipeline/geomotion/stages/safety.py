"""Safety regions of trained skills: which one a configuration asks for, and how well it does."""

from typing import Any

import numpy as np
import torch
from jaxtyping import Bool

from geomotion.conditional_models import ConditionalSkill
from geomotion.config import EvaluationConfig, ObstacleConfig, RiemannianSafety, SafetyConfig
from geomotion.demos.demonstrations import Demonstrations
from geomotion.dynamics.rollout import rollout
from geomotion.errors import InvalidSetting
from geomotion.models import Skill
from geomotion.obstacles.safe_field import PLANE, follow_safely
from geomotion.safe_skills import SafeSkill, safe_skill
from geomotion.scores.evaluation import Evaluation, combine
from geomotion.scores.grids import bounding_box
from geomotion.scores.safety import Passage, judge_passages, judge_safe_contraction
from geomotion.scores.score import Score, share_score
from geomotion.stages.scene import moving_bodies, space_of
from geomotion.types import Float, Trajectories

STEPS_PER_DURATION = 100
STARTS_AT_ONCE = 5000  # drawn from the box, to be kept where they are in the support
STATEMENT = (
    "A motion on the skill's surface that starts where S > ρ stays there: by construction, for the spline through S at "
    "the nodes of the latent grid. Beside the surface, it comes back at the transverse rate, and its distance to "
    "obstacles is measured. That the field contracts among regions is measured, not proven."
)


def safe(
    config: SafetyConfig, obstacle: ObstacleConfig, skill: Skill | ConditionalSkill, demonstrations: Demonstrations
) -> SafeSkill | None:
    """The skill with its safety region, obstacles in it; nothing where none is asked for.

    Raises:
        InvalidSetting: If the skill has conditions or does not have two dimensions, or if an obstacle moves, covers the
            goal, or does not fit.
        MissingData: If obstacles are not in the way at all.
    """
    if not isinstance(config, RiemannianSafety):
        return None
    if not isinstance(skill, Skill):
        raise InvalidSetting("safety", "riemannian", "none for a skill with conditions: each would have its own region")
    bodies = moving_bodies(obstacle, space_of(obstacle, skill))
    states = [demonstrations[number].state(skill.state_channels) for number in skill.train_demos]
    return safe_skill(skill, states, bodies, config)


def judge_safety(
    safe: SafeSkill, demonstrations: Demonstrations, settings: EvaluationConfig, count: int
) -> tuple[Evaluation, Float[np.ndarray, "start 2"]]:
    """Follow the skill from random latent starts in the support, with the region and without it.

    Starts lie on the skill's surface; a rollout lasts as long as those that are judged by whether they reach the goal.

    Args:
        safe: The skill.
        demonstrations: All of them.
        settings: Seed, duration, and how near to the goal counts as there.
        count: Number of starts.

    Returns:
        Scores, and the latent starts.
    """
    starts = random_starts(safe, count, settings.seed)
    field, free = safe.safe_field(), safe.free_field()
    states = torch.from_numpy(np.pad(starts, ((0, 0), (0, field.dim - PLANE))))
    times = torch.linspace(0, settings.goal_duration, round(settings.goal_duration * STEPS_PER_DURATION) + 1).double()
    followed, waited = follow_safely(field, states, times)
    undisturbed = rollout(free, states, times).states
    note = (
        f"{len(starts)} random starts in the support and out of obstacles, seed {settings.seed}, followed for "
        f"{settings.goal_duration:.3g} durations"
    )
    tight = bounding_box([demonstrations[number].state(safe.skill.state_channels) for number in safe.skill.train_demos])
    tolerance_m = settings.goal_tolerance * tight.diagonal
    scores = {
        "safety.steps_waited": Score(float(waited), "1", len(starts) * (len(times) - 1), statistic="count"),
        "safety.no_way": share_score(_has_no_way(safe, starts), f"of {note}"),
        **_extent_scores(safe),
    }
    inside = states[safe.region.is_safe(states[:, :PLANE])]
    parts = [
        judge_passages(_passage(safe, followed), _passage(safe, undisturbed), tolerance_m, note),
        Evaluation(scores),
        judge_safe_contraction(field, inside, safe.skill.field.time_unit_s, note),
    ]
    return combine(parts), starts


def random_starts(safe: SafeSkill, count: int, seed: int) -> Float[np.ndarray, "{count} 2"]:
    """Latent points drawn evenly from the part of the support whose positions are outside of obstacles."""
    generator, grid = np.random.default_rng(seed), safe.nodes.grid
    found: list[np.ndarray] = []
    while sum(map(len, found)) < count:
        drawn = generator.uniform(grid.low, grid.high, size=(STARTS_AT_ONCE, PLANE))
        supported = drawn[safe.support.is_safe(torch.from_numpy(drawn)).numpy()]
        found.append(supported[safe.clearance_m(supported) > 0])
    return np.concatenate(found)[:count]


def certificate_part(evaluation: Evaluation) -> dict[str, Any]:
    """What a certificate says about the region: a statement and the measured numbers."""
    measured = {name: score.as_dict()["value"] for name, score in evaluation.scores.items()}
    return {"statement": STATEMENT, "measured": measured}


@torch.no_grad()
def _passage(safe: SafeSkill, states: Trajectories) -> Passage:
    codes = states[..., :PLANE]
    goal = safe.surface.plane.decode(torch.from_numpy(safe.goal))
    ends = safe.surface.plane.decode(codes[:, -1])
    return Passage(
        (~safe.support.is_safe(codes)).any(dim=1).numpy(),
        safe.clearance_m(codes.numpy()).min(axis=1),
        (ends - goal).norm(dim=-1).numpy(),
    )


def _has_no_way(safe: SafeSkill, starts: Float[np.ndarray, "start 2"]) -> Bool[np.ndarray, " start"]:
    """Whether obstacles cut them off: they are safe, and so is the nearest node, but none is the way to the goal."""
    nearest = safe.nodes.grid.nearest(starts)
    places = torch.from_numpy(np.stack([starts, safe.nodes.grid.nodes[nearest]]))
    return np.asarray(np.isinf(safe.way_to_goal[nearest]) & safe.region.is_safe(places).all(dim=0).numpy())


def _extent_scores(safe: SafeSkill) -> dict[str, Score]:
    """How much of the support is left as it was, and how much is lost though no obstacle is there."""
    nodes = torch.from_numpy(safe.nodes.grid.nodes)
    supported = safe.support.is_safe(nodes).numpy()
    distance = safe.region.distance(nodes).numpy()[supported]
    is_clear = safe.clearance_m(safe.nodes.grid.nodes)[supported] > 0
    levels = safe.region.levels
    return {
        "safety.unchanged": share_score(distance >= levels.inactive, "nodes of the support with S ≥ ν"),
        "safety.closed_beside_obstacles": share_score(
            (distance <= levels.impenetrable) & is_clear, "nodes of the support with S ≤ ρ outside of obstacles"
        ),
    }
