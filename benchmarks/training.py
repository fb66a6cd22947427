"""Cost of an optimiser step of every field with its default settings, on generated handwriting.

Run as ``python benchmarks/training.py``. One core.
"""

import tempfile
import time
from pathlib import Path

import torch

from geomotion import config as schema
from geomotion import models
from geomotion.demos import readers
from geomotion.demos.preprocessing import preprocess
from geomotion.dynamics.fields import ChartedField
from geomotion.models import ModelConfig
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.objectives import VelocityReconstruction
from geomotion.training.trainer import Objective, Schedule, fit
from geomotion.training.trajectories import TrajectoryReproduction

STEPS = 200
SLOW_STEPS = 20  # of fields that are integrated by a solver
RATE = 3e-3


def step_ms(
    model: ModelConfig, geometry: Geometry, objective: Objective[ChartedField], steps: int
) -> tuple[float, float]:
    """Wall time and processor time of a step [ms]."""
    schedule = Schedule(steps, RATE, 50, 1.0, steps, steps, 0)
    field = models.build(model, geometry)
    wall, processor = time.perf_counter(), time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        fit(field, objective, schedule, Path(folder) / "checkpoint", lambda step, values: None)
    return 1e3 * (time.perf_counter() - wall) / steps, 1e3 * (time.process_time() - processor) / steps


def integral(integrator: schema.Integrator) -> ModelConfig:
    """The thesis' field."""
    field = schema.LineIntegralField(integrator=integrator)
    return ModelConfig(schema.IdentityChart(), field, schema.ConstantRegulariser(), 0)


def main() -> None:
    torch.set_num_threads(1)
    config = schema.LettersDataset(name="letters/j", letter="j", points=1000)
    demonstrations = preprocess(readers.read(config), config.preprocess).select(range(5))
    data = TrainingSet.from_demonstrations(demonstrations, config.state_channels or ["position_m"])
    geometry = Geometry.of(data)
    linear = ModelConfig(schema.FlowChart(), schema.LinearField(), schema.NoRegulariser(), 0)
    potential = ModelConfig(schema.FlowChart(), schema.PotentialField(), schema.NoRegulariser(), 0)
    early, late = (
        TrajectoryReproduction(data, geometry, schema.TrajectoryTraining(warm_up=share)) for share in (1.0, 0.0)
    )
    velocity, curl, contraction = (
        VelocityReconstruction(data, geometry, schema.VelocityTraining(**weights))
        for weights in ({}, {"curl_weight": 1.0}, {"contraction_weight": 1.0})
    )
    quadrature = integral(schema.Integrator.quadrature)
    print(f"Time of a training step [ms], 5 demonstrations of 1000 points\n{'':<50}{'wall':>8}{'CPU':>8}")
    for name, model, objective, steps in (
        ("linear in a flow, before the nearest-point term", linear, early, STEPS),
        ("linear in a flow, with the nearest-point term", linear, late, STEPS),
        ("potential in a flow", potential, velocity, STEPS),
        ("line integral, quadrature", quadrature, velocity, STEPS),
        ("line integral, quadrature, curl penalty", quadrature, curl, SLOW_STEPS),
        ("line integral, quadrature, contraction penalty", quadrature, contraction, SLOW_STEPS),
        ("line integral, rk4", integral(schema.Integrator.rk4), velocity, SLOW_STEPS),
        ("line integral, dopri5", integral(schema.Integrator.dopri5), velocity, SLOW_STEPS),
    ):
        wall, processor = step_ms(model, geometry, objective, steps)
        print(f"{name:<50}{wall:>8.2f}{processor:>8.2f}", flush=True)


if __name__ == "__main__":
    main()
