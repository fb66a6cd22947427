"""Smooth curves along graph paths that stay in the tube they were fitted to."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from geomotion.manifolds.curves import descend
from geomotion.manifolds.graph import GeodesicGraph, GraphPath
from geomotion.manifolds.spline import LatentSpline, fit_spline, polyline
from geomotion.planning.carrying import Offsets, carried_to
from geomotion.planning.manifold import Codes, DecodedPath, SkillManifold, Surface
from geomotion.scores.paths import MotionPath

if TYPE_CHECKING:
    from geomotion.planning.planner import PlannerSettings

LONGEST = 1.05  # times the graph path: a spline longer than that has left its tube
LONGEST_UNCHECKED = 1.1  # the same where edges stay open: tubes of arms are thin, and a path with corners is no motion
DOUBLINGS = (1, 2, 4, 8)  # of the control points, before the graph path itself is taken
ROUNDING = 0.015  # of the graph path's corners: standard deviation, as a share of the path


@dataclass(frozen=True)
class FittedCurve:
    """A curve to execute.

    Attributes:
        codes: Latent points, shape (point, d).
        path: Decoded and carried states, with progress.
        length: Its length in the metric that was planned in.
        graph_length: That of the graph path.
    """

    codes: Codes
    path: DecodedPath
    length: float
    graph_length: float


def fit_curve(
    manifold: SkillManifold,
    surface: Surface,
    offsets: Offsets,
    ends: MotionPath,
    found: GraphPath,
    graph: GeodesicGraph,
    settings: "PlannerSettings",
) -> FittedCurve:
    """The smoothest of some curves that stays on free nodes and is not longer than the graph path allows."""
    nodes = surface.grid.nodes[found.nodes]
    codes = polyline(nodes, settings.samples)
    length = _length(surface, graph, codes)
    allowed = (LONGEST if settings.closes_edges else LONGEST_UNCHECKED) * length
    for points in _smooth(manifold, nodes, codes, settings):
        if not (_stays(surface, graph, points, settings) and surface.grid.contains(points).all()):
            continue
        smooth_length = _length(surface, graph, points)
        if smooth_length <= allowed:
            codes, length = points, smooth_length
            break
    decoded = manifold.decode(codes)
    carried = carried_to(decoded.states, ends, decoded.progress, offsets)
    return FittedCurve(codes, DecodedPath(carried, decoded.progress), length, found.cost)


def _smooth(
    manifold: SkillManifold,
    nodes: Float[np.ndarray, "node d"],
    corners: Float[np.ndarray, "point d"],
    settings: "PlannerSettings",
) -> Iterator[Float[np.ndarray, "point d"]]:
    """Points of splines, and at last those of the graph path with its corners rounded."""
    for spline in _splines(manifold, nodes, settings):
        yield spline.points(settings.samples)
    rounded = gaussian_filter1d(corners, ROUNDING * len(corners), axis=0, mode="nearest")
    rounded[[0, -1]] = corners[[0, -1]]
    yield rounded


def _stays(
    surface: Surface, graph: GeodesicGraph, points: Float[np.ndarray, "point d"], settings: "PlannerSettings"
) -> bool:
    """Whether points are on free nodes; where edges stay open, next to open ones is enough if no obstacle is there."""
    nearest = surface.grid.nearest(points)
    if settings.closes_edges:
        return bool(graph.is_free(nearest).all())
    around, _ = surface.grid.corners(points)
    return bool(graph.is_clear(nearest).all() and graph.is_free(around.ravel()).reshape(around.shape).any(axis=1).all())


def _splines(
    manifold: SkillManifold, nodes: Float[np.ndarray, "node d"], settings: "PlannerSettings"
) -> Iterator[LatentSpline]:
    """The smoothest first, and each one refined before it is taken as it is."""
    for doubling in DOUBLINGS if len(nodes) > 2 else ():
        spline = fit_spline(nodes, doubling * settings.control_points)
        if settings.refine_steps > 0:
            yield _refined(manifold, spline, settings)
        yield spline


def _length(surface: Surface, graph: GeodesicGraph, points: Float[np.ndarray, "point d"]) -> float:
    """Length in the metric that the graph has now, from values interpolated between its nodes."""
    numbers, shares = surface.grid.corners(points)
    along = np.einsum("pc,pck->pk", shares, surface.columns[numbers])
    factor = np.einsum("pc,bpc->pb", shares, graph.factor[:, numbers])
    squares = np.square(np.diff(along[:, :-1], axis=0))
    blocks, width = surface.position.shape[1:]
    position = squares[:, : blocks * width].reshape(len(squares), blocks, width).sum(axis=2)
    rest = squares[:, blocks * width :].sum(axis=1)
    stretch, factor = ((value[1:] + value[:-1]) / 2 for value in (along[:, -1], factor))
    return float((stretch * np.sqrt((factor * position).sum(axis=1) + rest)).sum())


def _refined(manifold: SkillManifold, spline: LatentSpline, settings: "PlannerSettings") -> LatentSpline:
    basis, coefficients = (torch.from_numpy(part) for part in (spline.basis(settings.samples), spline.coefficients))
    descent = descend(manifold.embedding, basis, coefficients, settings.refine_steps, conformal=manifold.conformal)
    return LatentSpline(spline.knots, descent.coefficients.numpy())
