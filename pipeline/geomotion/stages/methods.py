"""One geodesic by several methods: graphs of two resolutions and gradient descent (Fig. 3.3)."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch

from geomotion.config import EndEffectorFrame, PlanningConfig
from geomotion.figures.methods import MethodCurve
from geomotion.manifolds.curves import descend
from geomotion.manifolds.grid import LatentGrid
from geomotion.manifolds.spline import fit_spline
from geomotion.planning.manifold import Codes, Surface
from geomotion.planning.planner import energy
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.paths import MotionPath
from geomotion.scores.score import Score
from geomotion.stages import planners
from geomotion.stages.graph import Skilled

RESOLUTIONS = (50, 100)  # Fig. 3.3
DESCENT_STEPS = 300
ANYWHERE = 1e3  # metres and radians: no cap, so that methods differ in nothing but how they search


@dataclass(frozen=True)
class Compared:
    """Curves of all methods between the same latent points, and what they cost."""

    evaluation: Evaluation
    curves: list[MethodCurve]


def compare_methods(skilled: Skilled, config: PlanningConfig, frame: EndEffectorFrame, ends: MotionPath) -> Compared:
    """Length and energy in the thesis' metric, farthest distance from the data, and time, of each method.

    Args:
        skilled: Trained manifold.
        config: Splines and samples.
        frame: Which frame of the arm the poses are of.
        ends: Start and goal.
    """
    found: dict[str, tuple[Codes, float]] = {}
    for resolution in RESOLUTIONS:
        found[f"graph_{resolution}"] = _timed(partial(_on_graph, skilled, config, frame, ends, resolution))
    reference = found[f"graph_{RESOLUTIONS[-1]}"][0]
    line = np.linspace(reference[0], reference[-1], config.samples)
    found["straight_line"] = line, 0.0
    for name, start in (("gradient_from_line", line), ("gradient_from_graph", reference)):
        found[name] = _timed(partial(_descended, skilled, config, start))
    scores: dict[str, Score] = {}
    curves = []
    demonstrated = skilled.manifold.space.support(skilled.manifold.data.paths)
    for name, (codes, seconds) in found.items():
        apart_m, _ = demonstrated.distances(skilled.manifold.decode(codes).states)
        squared = energy(skilled.manifold, codes)
        scores |= {
            f"methods.{name}_length": Score(float(np.sqrt(squared)), "1"),
            f"methods.{name}_energy": Score(squared, "1"),
            f"methods.{name}_farthest": Score(1000 * float(apart_m.max()), "mm", note="from the demonstrations"),
            f"methods.{name}_time": Score(seconds, "s", note="graph decoded and searched, or all descent steps"),
        }
        curves.append(MethodCurve(name, codes, float(np.sqrt(squared)), seconds))
    return Compared(Evaluation(scores, {f"{one.name}_codes": one.codes for one in curves}), curves)


def _timed(method: Callable[[], Codes]) -> tuple[Codes, float]:
    begun = time.perf_counter()
    codes = method()
    return codes, time.perf_counter() - begun


def _on_graph(skilled: Skilled, config: PlanningConfig, frame: EndEffectorFrame, ends: MotionPath, count: int) -> Codes:
    manifold = skilled.manifold
    grid = LatentGrid(skilled.surface.grid.low, skilled.surface.grid.high, count)
    surface = Surface.of(manifold, grid, manifold.space.support(manifold.data.paths))
    unbound = replace(config, leave_data_m=ANYWHERE, leave_data_rad=ANYWHERE)
    planner = planners.planner(replace(skilled, surface=surface), unbound, frame)
    query = planner.query(ends[:1], ends[-1:])
    return planner.fit(query, planner.search(query, (), 0.0)).codes


def _descended(skilled: Skilled, config: PlanningConfig, start: Codes) -> Codes:
    spline = fit_spline(start, config.spline_control_points)
    basis, coefficients = (torch.from_numpy(part) for part in (spline.basis(config.samples), spline.coefficients))
    descent = descend(skilled.manifold.embedding, basis, coefficients, DESCENT_STEPS)
    return np.asarray((basis @ descent.coefficients).numpy())
