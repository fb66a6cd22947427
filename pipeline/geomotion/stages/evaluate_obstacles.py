"""Judge a trained field among the obstacles of a configuration."""

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geomotion.config import EvaluationConfig, ObstacleConfig, SolverConfig
from geomotion.demos.demonstrations import Demonstrations
from geomotion.dynamics.fields import ChartedField
from geomotion.models import Skill
from geomotion.obstacles.rollout import rollout_among_obstacles
from geomotion.scores.array_field import ArrayField
from geomotion.scores.evaluation import Evaluation, combine
from geomotion.scores.grids import bounding_box, sample_box
from geomotion.scores.modulated import is_free, judge_modulated_contraction, judge_modulated_nearby, judge_passage
from geomotion.scores.nearby import nearby_starts
from geomotion.stages.scene import modulated

STATEMENT = (
    "What is claimed about contraction holds in free space. Among obstacles it was measured, not proven; proven is "
    "that no solution enters one."
)
PASSAGE_TIMES = 200


def judge_among_obstacles(
    skill: Skill,
    demonstrations: Demonstrations,
    obstacle: ObstacleConfig,
    settings: EvaluationConfig,
    solver: SolverConfig,
) -> Evaluation:
    """Contraction, nearby rollouts, and passage to the goal; nothing in free space.

    Contraction is judged at mean speed and where obstacles are at time zero. Of starts, a skill that remembers them
    remembers that of the first demonstration: others are displaced, not begun elsewhere.

    Raises:
        InvalidSetting: If an obstacle does not fit the skill.
    """
    field = modulated(obstacle, skill)
    if field is None:
        return Evaluation()
    chart = skill.field.chart
    steady = modulated(obstacle, replace(skill, field=ChartedField(chart, skill.field.field, skill.field.time_unit_s)))
    assert steady is not None
    array, options = ArrayField(skill.field), _options(solver)
    forgetful = replace(skill, field=skill.field.forgetful())

    def rolled(own: Skill, starts: NDArray[np.float64], times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        among = modulated(obstacle, own)
        assert among is not None
        found = rollout_among_obstacles(among, array.tensor(starts), array.tensor(times_s), **options)
        return np.asarray(found.states.double().numpy())

    def free(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(points[is_free(field, array.tensor(points)).numpy()])

    trained = [demonstrations[number] for number in skill.train_demos]
    tight = bounding_box([one.state(skill.state_channels) for one in trained])
    box = tight.enlarged(settings.grid_margin)
    grid = sample_box(box, settings.contraction_grid_points, settings.seed)
    start, time_s = trained[0].state(skill.state_channels)[0], trained[0].time_s - trained[0].time_s[0]
    nearby = nearby_starts(start, settings.nearby_starts, settings.nearby_spread * tight.diagonal, settings.seed)
    starts = sample_box(box, max(2, round(math.sqrt(settings.region_starts))), settings.seed)
    outside = free(starts.points)
    times_s = np.linspace(0, settings.goal_duration * skill.geometry.duration_s, PASSAGE_TIMES)
    return combine(
        [
            judge_modulated_contraction(steady, chart, array.tensor(grid.points), grid.note)
            if skill.field.is_onto
            else Evaluation(omitted={"obstacles.contraction": "the claimed metric is one of the decoder's manifold"}),
            judge_modulated_nearby(partial(rolled, forgetful), array.to_claimed, free(nearby), time_s),
            judge_passage(
                field,
                array.tensor(rolled(skill.begun(start[None]), outside, times_s)),
                array.tensor(times_s),
                skill.goal,
                settings.goal_tolerance * tight.diagonal,
                f"{len(outside)} starts outside of the obstacles; {starts.note}",
            ),
        ]
    )


def certificate_part(evaluation: Evaluation) -> dict[str, Any]:
    """What a certificate says about obstacles: a statement and the measured numbers."""
    measured = {name: score.as_dict()["value"] for name, score in evaluation.scores.items()}
    return {"statement": STATEMENT, "measured": measured}


def _options(solver: SolverConfig) -> dict[str, Any]:
    return {
        "method": solver.method.value,
        "substeps": solver.substeps,
        "relative_tolerance": solver.relative_tolerance,
        "absolute_tolerance": solver.absolute_tolerance,
    }
