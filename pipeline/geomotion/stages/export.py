"""Turn a trained field into files that other programs can run."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from geomotion import models
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.line_integral import LineIntegralField
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.export import INPUT, OUTPUT, OnnxPolicy, export_onnx, query_time_ms
from geomotion.files import write_json
from geomotion.models import Skill
from geomotion.tracking import Artefacts, StageRun

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
    skill = models.load(inputs["train"].path("model.pt"))
    path = run.folder / "policy.onnx"
    export_onnx(_without_solver(skill.field), path)
    policy = OnnxPolicy(path)
    document: dict[str, Any] = {
        "input": {
            "name": INPUT,
            "shape": ["batch", skill.field.dim],
            "unit": "m",
            "channels": list(skill.state_channels),
        },
        "output": {"name": OUTPUT, "shape": ["batch", skill.field.dim], "unit": "m/s"},
        "goal_m": list(skill.geometry.goal),
        "max_difference_to_torch_m_per_s": _largest_difference(skill, policy),
        "query_time_ms": query_time_ms(policy, skill.field.dim),
    }
    write_json(run.folder / "policy.json", document)
    run.log_series(0, {"query_time_ms": document["query_time_ms"]})
    run.log_policy(path, skill.field.dim, config.register_as)


def _without_solver(field: ChartedField) -> ChartedField:
    """The field with quadrature in place of a solver's loop, which cannot be exported."""
    field = copy.deepcopy(field)
    if isinstance(field.field, LineIntegralField) and not isinstance(field.field.integrator, GaussLegendre):
        field.field.integrator = GaussLegendre(EXPORTED_NODES)
    return field


def _largest_difference(skill: Skill, policy: OnnxPolicy) -> float:
    generator = torch.Generator().manual_seed(0)
    offsets = 2 * torch.rand(CHECKED_STATES, skill.field.dim, generator=generator) - 1
    states = torch.tensor(skill.geometry.centre) + skill.geometry.scale_m * offsets
    with torch.no_grad():
        expected = skill.field(states).numpy()
    differences = np.abs(policy(states.numpy()) - expected)
    return float(np.nanmax(differences, initial=0.0))  # nan: both are infinite
