"""Optimiser steps per second of both fields with their default settings, on generated handwriting.

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


def steps_per_second(
    model: ModelConfig, geometry: Geometry, objective: Objective[ChartedField], rate: float
) -> tuple[float, float]:
    """Steps per second of wall time and of processor time."""
    schedule = Schedule(STEPS, rate, 50, 1.0, STEPS, STEPS, 0)
    wall, processor = time.perf_counter(), time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        fit(models.build(model, geometry), objective, schedule, Path(folder) / "checkpoint", lambda step, values: None)
    return STEPS / (time.perf_counter() - wall), STEPS / (time.process_time() - processor)


def main() -> None:
    torch.set_num_threads(1)
    config = schema.LettersDataset(name="letters/j", letter="j", points=1000)
    demonstrations = preprocess(readers.read(config), config.preprocess).select(range(5))
    data = TrainingSet.from_demonstrations(demonstrations, config.state_channels)
    geometry = Geometry.of(data)
    linear = ModelConfig(schema.FlowChart(), schema.LinearField(), schema.NoRegulariser(), 0)
    integral = ModelConfig(schema.IdentityChart(), schema.LineIntegralField(), schema.ConstantRegulariser(), 0)
    early, late = schema.TrajectoryTraining(warm_up=1.0), schema.TrajectoryTraining(warm_up=0.0)
    velocity = schema.VelocityTraining()
    print(f"Training steps per second, 5 demonstrations of 1000 points, {STEPS} steps\n{'':<48}{'wall':>8}{'CPU':>8}")
    for name, model, objective, rate in (
        (
            "linear in a flow, before the nearest-point term",
            linear,
            TrajectoryReproduction(data, geometry, early),
            1e-2,
        ),
        ("linear in a flow, with the nearest-point term", linear, TrajectoryReproduction(data, geometry, late), 1e-2),
        ("line integral", integral, VelocityReconstruction(data, geometry, velocity), 1e-3),
    ):
        wall, processor = steps_per_second(model, geometry, objective, rate)
        print(f"{name:<48}{wall:>8.1f}{processor:>8.1f}", flush=True)


if __name__ == "__main__":
    main()
