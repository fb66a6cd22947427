"""What one velocity costs a control loop, and a thousand at once a rollout: all fields, eager and exported.

Run as ``python benchmarks/queries.py``. Default settings; parameters are random, which the time does not depend on,
except for dopri5, whose steps do. One core.
"""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from line_integral import measure

from geomotion import config as schema
from geomotion import models
from geomotion.export import Arrays, OnnxPolicy, export_onnx
from geomotion.models import ModelConfig, Skill
from geomotion.policy.policy import Policy
from geomotion.policy.training_range import TrainingRange
from geomotion.training.data import Geometry
from geomotion.types import Tensor

DIMENSIONS = (2, 8, 44)
BATCHES = {1: 1000, 1000: 20}  # states at once, and timed calls
THESIS = ModelConfig(schema.IdentityChart(), schema.LineIntegralField(), schema.ConstantRegulariser(), 0)

MODELS = {
    "linear in a flow": ModelConfig(schema.FlowChart(), schema.LinearField(), schema.NoRegulariser(), 0),
    "potential in a flow": ModelConfig(schema.FlowChart(), schema.PotentialField(), schema.NoRegulariser(), 0),
    "line integral, quadrature": THESIS,
    "line integral, rk4": replace(THESIS, field=schema.LineIntegralField(integrator=schema.Integrator.rk4)),
    "line integral, dopri5": replace(THESIS, field=schema.LineIntegralField(integrator=schema.Integrator.dopri5)),
}
ADAPTIVE = {"line integral, dopri5"}  # how often they evaluate the network depends on the state: not exported


def build(config: ModelConfig, dim: int) -> Skill:
    """A skill in `dim` dimensions, about as large and long as a handwritten letter."""
    centre = (0.0,) * dim
    geometry = Geometry(centre, 0.05, centre, centre, 3.0)
    field = models.build(config, geometry).eval()
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.add_(0.05 * torch.randn(parameter.shape, generator=torch.Generator().manual_seed(0)))
    return Skill(field.requires_grad_(False), config, geometry, ("position_m",), (0,), ())


def row(name: str, skill: Skill) -> str:
    """Times of one field, and whether both ways give the same velocity."""
    field = skill.field
    generator = torch.Generator().manual_seed(0)
    states = {count: 0.02 * torch.randn(count, field.dim, generator=generator) for count in BATCHES}
    cells = [_cell(lambda one=one: field(one), BATCHES[count]) for count, one in states.items()]
    difference = ""
    if name in ADAPTIVE:
        cells += ["-"] * len(BATCHES)
    else:
        policy = _exported(skill, states[1000])
        arrays = {count: {"state_m": one.numpy()} for count, one in states.items()}
        cells += [_cell(lambda one=one: policy(one), BATCHES[count]) for count, one in arrays.items()]
        difference = f"{_difference(policy(arrays[1000]), field(states[1000])):.1e} m/s"
    return f"{name:<27}{field.dim:>2}" + "".join(f"{cell:>19}" for cell in cells) + f"{difference:>14}"


def _cell(call: Callable[[], object], calls: int) -> str:
    median, spread = measure(call, calls)
    return f"{median:.3f} ({spread:.3f})"


def _difference(found: Arrays, expected: Tensor) -> float:
    return float(np.abs(found["velocity_m_per_s"] - expected.numpy()).max())


def _exported(skill: Skill, states: Tensor) -> OnnxPolicy:
    with tempfile.TemporaryDirectory() as folder:
        export_onnx(Policy(skill, TrainingRange(states, 0.05)), Path(folder) / "policy.onnx")
        return OnnxPolicy(Path(folder) / "policy.onnx")


def main() -> None:
    torch.set_num_threads(1)
    print("Velocities at 1 and at 1000 states [ms]: median (interquartile range); largest difference of the exported")
    print(f"{'field':<27}{'D':>2}{'eager, 1':>19}{'eager, 1000':>19}{'exported, 1':>19}{'exported, 1000':>19}")
    for name, config in MODELS.items():
        for dim in DIMENSIONS:
            print(row(name, build(config, dim)), flush=True)


if __name__ == "__main__":
    main()
