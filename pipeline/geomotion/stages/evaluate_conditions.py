"""Judge a trained field under each of its conditions, and all of them together."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from geomotion import conditional_models
from geomotion.conditional_models import ConditionalSkill
from geomotion.config import Protocol
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations
from geomotion.errors import InvalidSetting
from geomotion.figures.arrays import from_arrays
from geomotion.figures.conditions import figure_conditions
from geomotion.figures.evaluation import save_all
from geomotion.figures.style import save_figure
from geomotion.files import atomic, read_json, write_json
from geomotion.models import Skill
from geomotion.scores.conditions import merged
from geomotion.scores.equilibrium import judge_equilibrium
from geomotion.scores.evaluation import Evaluation, combine
from geomotion.stages.evaluate import EvaluateConfig, audit, compute, state_unit
from geomotion.stages.evaluate import evaluate as evaluate_unconditional
from geomotion.stages.evaluate_obstacles import certificate_part, judge_among_obstacles
from geomotion.stages.safety import safe
from geomotion.tracking import Artefacts, StageRun


@dataclass(frozen=True)
class Judged:
    """What was found about one condition, and which part of it among obstacles."""

    name: str
    skill: Skill
    condition: tuple[float, ...]
    evaluation: Evaluation
    among_obstacles: Evaluation


def evaluate(config: EvaluateConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write what :func:`geomotion.stages.evaluate.evaluate` writes; with conditions, of all of them.

    ``scores.json`` then holds means over conditions (of largest values the largest) and, under ``conditions``, the
    scores of each; ``conditions/`` holds the arrays of each.

    Raises:
        InvalidSetting: If the peers' protocol is asked for on other data than theirs, or an obstacle does not fit.
    """
    skill = conditional_models.load(inputs["train"].path("model.pt"))
    if isinstance(skill, Skill):
        evaluate_unconditional(config, inputs, run)
        return
    if config.evaluation.protocol is Protocol.peers:
        raise InvalidSetting("evaluation", "peers", "heldout: peers publish nothing about conditions")
    demonstrations = storage.load(inputs["ingest"].folder)
    safe(config.safety, config.obstacle, skill, demonstrations)  # refuses
    certificate = read_json(inputs["train"].path("certificate.json"))
    judged = [
        _judge(name, condition, plain, demonstrations, certificate["rate_per_s"], config)
        for name, condition, plain in _skills(skill, demonstrations)
    ]
    whole = merged([one.evaluation for one in judged])
    certificate["audit"] = audit(whole)
    among = merged([one.among_obstacles for one in judged])
    if among.scores:
        certificate["obstacles"] = certificate_part(among)

    document = whole.document(config.evaluation.protocol.value, demonstrations.name)
    document["conditions"] = [_document(one, skill) for one in judged]
    write_json(run.folder / "scores.json", document)
    write_json(run.folder / "certificate.json", certificate)
    _save_arrays(whole, run.folder)
    run.log_scores(whole.scores)
    for number, one in enumerate(judged):
        run.log_scores({f"{name}/{_slug(one.name)}": score for name, score in one.evaluation.scores.items()})
        _save_arrays(one.evaluation, run.folder / "conditions" / f"{number}_{_slug(one.name)}")
    save_all(whole.arrays, certificate, run.folder / "figures")
    if skill.dim == 2:  # a panel for each condition says more than all in one plane
        panels = {one.name: from_arrays(one.evaluation.arrays) for one in judged}
        save_figure(figure_conditions(panels), run.folder / "figures", "motion", whole.arrays)


def _skills(skill: ConditionalSkill, demonstrations: Demonstrations) -> list[tuple[str, tuple[float, ...], Skill]]:
    """For each trained condition its skill, which knows its own demonstrations only."""
    found = []
    for name, condition in skill.conditions.items():
        plain = skill.given(condition)
        train, test = (
            tuple(number for number in numbers if demonstrations[number].condition == condition)
            for numbers in (plain.train_demos, plain.test_demos)
        )
        found.append((name, condition, replace(plain, train_demos=train, test_demos=test)))
    return found


def _judge(
    name: str,
    condition: tuple[float, ...],
    skill: Skill,
    demonstrations: Demonstrations,
    proven_rate: float | None,
    config: EvaluateConfig,
) -> Judged:
    settings, solver = config.evaluation, config.solver
    alone = compute(skill, demonstrations, proven_rate, settings, solver)
    ends = [demonstrations[number].state(skill.state_channels)[-1] for number in skill.train_demos]
    rest = judge_equilibrium(
        skill.field,
        skill.goal.double().numpy(),
        np.mean(ends, axis=0),
        skill.geometry.scale_m,
        state_unit(skill.state_channels),
    )
    among = judge_among_obstacles(skill, demonstrations, config.obstacle, settings, solver)
    return Judged(name, skill, condition, combine([alone, rest, among]), among)


def _document(judged: Judged, skill: ConditionalSkill) -> dict[str, Any]:
    return {
        "name": judged.name,
        "condition": dict(zip(skill.conditioning.names, judged.condition, strict=True)),
        "goal_m": list(judged.skill.geometry.goal),
        "scores": {name: score.as_dict() for name, score in judged.evaluation.scores.items()},
        "omitted": judged.evaluation.omitted,
    }


def _save_arrays(evaluation: Evaluation, folder: Path) -> None:
    with atomic(folder / "evaluation.npz") as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **evaluation.arrays)


def _slug(name: str) -> str:
    return re.sub(r"[^\w.=-]+", "_", name)
