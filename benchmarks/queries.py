"""What a control loop pays for one velocity at one state: all fields with their default settings, eager and exported.

Run as ``python benchmarks/queries.py``. Parameters are random, which the time does not depend on. One core.
"""

import tempfile
from pathlib import Path

import numpy as np
import torch
from line_integral import measure

from geomotion import config as schema
from geomotion import models
from geomotion.dynamics.fields import ChartedField
from geomotion.export import OnnxPolicy, export_onnx
from geomotion.models import ModelConfig
from geomotion.training.data import Geometry

DIMENSIONS = (2, 4, 8)
CALLS = 1000

MODELS = {
    "linear in a flow": ModelConfig(schema.FlowChart(), schema.LinearField(), schema.NoRegulariser(), 0),
    "potential in a flow": ModelConfig(schema.FlowChart(), schema.PotentialField(), schema.NoRegulariser(), 0),
    "line integral": ModelConfig(schema.IdentityChart(), schema.LineIntegralField(), schema.ConstantRegulariser(), 0),
}


def build(config: ModelConfig, dim: int) -> ChartedField:
    """A field in `dim` dimensions, about as large and long as a handwritten letter."""
    centre = (0.0,) * dim
    field = models.build(config, Geometry(centre, 0.05, centre, centre, 3.0)).eval()
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.add_(0.05 * torch.randn(parameter.shape, generator=torch.Generator().manual_seed(0)))
    return field.requires_grad_(False)


def row(name: str, field: ChartedField) -> str:
    """Times of one field, and whether both ways give the same velocity."""
    state = torch.full((1, field.dim), 0.02)
    array = state.numpy()
    with tempfile.TemporaryDirectory() as folder:
        export_onnx(field, Path(folder) / "policy.onnx")
        policy = OnnxPolicy(Path(folder) / "policy.onnx")
    times = measure(lambda: field(state), CALLS), measure(lambda: policy(array), CALLS)
    cells = "".join(f"{f'{median:.3f} ({spread:.3f})':>18}" for median, spread in times)
    difference = np.abs(policy(array) - field(state).numpy()).max()
    return f"{name:<22}{field.dim:>3}{cells}{difference:>18.1e} m/s"


def main() -> None:
    torch.set_num_threads(1)
    print("One velocity at one state [ms]: median (interquartile range)")
    print(f"{'field':<22}{'D':>3}{'eager':>18}{'exported':>18}{'largest difference':>22}")
    for name, config in MODELS.items():
        for dim in DIMENSIONS:
            print(row(name, build(config, dim)), flush=True)


if __name__ == "__main__":
    main()
