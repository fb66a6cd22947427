"""Turn a trained field into files that other programs can run."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from geomotion import conditional_models
from geomotion.conditional_models import ConditionalPolicy, ConditionalSkill
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.line_integral import LineIntegralField
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.export import CONDITION, ELAPSED, INPUT, OUTPUT, OnnxPolicy, export_onnx, input_widths, query_time_ms
from geomotion.files import write_json
from geomotion.models import Skill
from geomotion.tracking import Artefacts, StageRun

Field = ChartedField | ConditionalPolicy

CHECKED_STATES = 256
EXPORTED_NODES = 20  # of the quadrature that stands for a solver


@dataclass(frozen=True)
class ExportConfig:
    """What the export stage needs.

    Attributes:
        register_as: Name in MLflow's model registry; None to leave it out.
    """

    register_as: str | None = None


def export(config: ExportConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``policy.onnx`` and ``policy.json`` (interface, agreement with torch, query time); log the MLflow model."""
    skill = conditional_models.load(inputs["train"].path("model.pt"))
    plain, field = (skill, skill.field) if isinstance(skill, Skill) else (skill.augmented, ConditionalPolicy(skill))
    path = run.folder / "policy.onnx"
    export_onnx(_without_solver(field), path)
    policy, widths = OnnxPolicy(path), input_widths(field)
    document: dict[str, Any] = {
        "input": {
            "name": INPUT,
            "shape": ["batch", field.dim],
            "unit": "m",
            "channels": list(plain.state_channels),
        },
        "output": {"name": OUTPUT, "shape": ["batch", field.dim], "unit": "m/s"},
        **_interface(skill),
        **({"elapsed": {"name": ELAPSED, "shape": ["batch", 1], "unit": "s"}} if field.time_law is not None else {}),
        "max_difference_to_torch_m_per_s": _largest_difference(skill, field, policy),
        "query_time_ms": query_time_ms(policy, widths),
    }
    write_json(run.folder / "policy.json", document)
    run.log_series(0, {"query_time_ms": document["query_time_ms"]})
    run.log_policy(path, widths, config.register_as)


def _interface(skill: Skill | ConditionalSkill) -> dict[str, Any]:
    """Where motions end; with conditions, what these are and where motions end under those demonstrated."""
    if isinstance(skill, Skill):
        return {"goal_m": list(skill.geometry.goal)}
    names = list(skill.conditioning.names)
    return {
        "condition": {"name": CONDITION, "shape": ["batch", len(names)], "entries": names},
        "demonstrated": {
            name: {"condition": list(condition), "goal_m": skill.conditioning.goal_at(np.array(condition)).tolist()}
            for name, condition in skill.conditions.items()
        },
    }


def _without_solver(field: Field) -> Field:
    """The field with quadrature in place of a solver's loop, which cannot be exported."""
    field = copy.deepcopy(field)
    for module in field.modules():
        if isinstance(module, LineIntegralField) and not isinstance(module.integrator, GaussLegendre):
            module.integrator = GaussLegendre(EXPORTED_NODES)
    return field


def _largest_difference(skill: Skill | ConditionalSkill, field: Field, policy: OnnxPolicy) -> float:
    generator = torch.Generator().manual_seed(0)
    geometry = skill.geometry if isinstance(skill, Skill) else skill.augmented.geometry
    offsets = 2 * torch.rand(CHECKED_STATES, field.dim, generator=generator) - 1
    asked = [torch.tensor(geometry.centre[: field.dim]) + geometry.scale_m * offsets]
    if isinstance(skill, ConditionalSkill):
        shown = torch.tensor(list(skill.conditions.values()))
        asked.append(shown[torch.arange(CHECKED_STATES) % len(shown)])
    if field.time_law is not None:
        asked.append(1.5 * geometry.duration_s * torch.rand(CHECKED_STATES, 1, generator=generator))
    with torch.no_grad():
        expected = field(*asked).numpy()
    differences = np.abs(policy(*(values.numpy() for values in asked)) - expected)
    return float(np.nanmax(differences, initial=0.0))  # nan: both are infinite
