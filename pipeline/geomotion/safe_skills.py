"""Skills of two dimensions that stay where demonstrations are, and out of obstacles that are pulled back to them."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool
from scipy.spatial import cKDTree

from geomotion.config import RiemannianSafety
from geomotion.dynamics.fields import ChartedField, VectorField
from geomotion.errors import InvalidSetting
from geomotion.manifolds.graph import GeodesicGraph
from geomotion.models import Skill
from geomotion.obstacles.ambient import ambient_factor, combine_factors
from geomotion.obstacles.motion import MovingBody
from geomotion.obstacles.safe_field import PLANE, Onward, SafeField, along_geodesic
from geomotion.obstacles.safety_region import (
    Levels,
    Reason,
    SafetyRegion,
    calibrated,
    distance_on_grid,
    narrowest_passage,
)
from geomotion.skill_surface import EmbeddedGrid, SkillSurface
from geomotion.types import Float

SUPPORT = "the surroundings of the data"
GRID_ROOM = 5.0  # widths of the density around the demonstrations
EXACT_WITHIN_M = 0.02

Points = Float[np.ndarray, "point 2"]


@dataclass(frozen=True)
class SafeSkill:
    """A skill with its safety region.

    Attributes:
        skill: Without the region.
        surface: Its plane.
        nodes: The grid that volumes were computed on.
        volume: √det M at the nodes over that of the means, obstacles included.
        reasons: To stay away: the surroundings of the data first, then obstacles, if there are any.
        support: Where demonstrations are, obstacles or not.
        region: The support without obstacles.
        graph: Ways in the region.
        way_to_goal: Length of the shortest one from each node; infinite where there is none.
        bodies: The obstacles.
        goal: Its latent point, shape (1, 2).
    """

    skill: Skill
    surface: SkillSurface
    nodes: EmbeddedGrid
    volume: Float[np.ndarray, " node"]
    reasons: tuple[Reason, ...]
    support: SafetyRegion
    region: SafetyRegion
    graph: GeodesicGraph
    way_to_goal: Float[np.ndarray, " node"]
    bodies: tuple[MovingBody, ...]
    goal: Points

    def free_field(self) -> VectorField:
        """The latent field without the region, in double precision."""
        return deepcopy(self.skill.field).double().eval().requires_grad_(False).field

    def safe_field(self, onward: Onward | None = along_geodesic) -> SafeField:
        """The latent field that stays in the region, in double precision."""
        return SafeField(self.free_field(), self.region, onward, fastest_return=self.top_speed)

    def charted_field(self) -> ChartedField:
        """The same in the robot's coordinates, in the precision of the model."""
        free = self.skill.field
        safe = SafeField(free.field, deepcopy(self.region).to(self.skill.goal), fastest_return=self.top_speed)
        return ChartedField(free.chart, safe, free.time_unit_s, free.time_law, free.transverse_law).eval()

    @cached_property
    def top_speed(self) -> float:
        """The highest latent speed at demonstrated states, per time unit; a way back into the region is no faster."""
        field = self.free_field()
        codes = torch.from_numpy(np.concatenate(self.surface.codes))
        with torch.no_grad():
            velocity = field(torch.nn.functional.pad(codes, (0, field.dim - PLANE)))
        return float(velocity[:, :PLANE].norm(dim=-1).max())

    @torch.no_grad()
    def clearance_m(self, points: Float[np.ndarray, "*batch 2"]) -> Float[np.ndarray, "*batch"]:
        """Distance between the skill's positions at latent points and the obstacles [m].

        Where it is more than `EXACT_WITHIN_M`, it is that of the nearest node, less half of the way to its neighbours;
        infinite without obstacles.
        """
        flat = points.reshape(-1, PLANE)
        found = self._surely_clear_m[self.nodes.grid.nearest(flat)]
        near = np.flatnonzero(found < EXACT_WITHIN_M)
        if len(near):
            positions = self.surface.plane.positions(torch.from_numpy(flat[near]))[:, 0].numpy()
            found[near] = nearest_body_m(self.bodies, positions)
        return np.asarray(found.reshape(points.shape[:-1]))

    @torch.no_grad()
    def to_border_m(self, points: Float[np.ndarray, "point 2"]) -> Float[np.ndarray, " point"]:
        """Distance between positions at latent points and those where S = ρ; negative outside of the region [m]."""
        codes = torch.from_numpy(points)
        away_m = self._border_m.query(self.surface.plane.positions(codes)[:, 0].numpy())[0]
        return np.asarray(np.where(self.region.is_safe(codes).numpy(), away_m, -away_m))

    @cached_property
    def _border_m(self) -> cKDTree:
        """Positions where edges of the grid cross S = ρ [m]."""
        grid = self.nodes.grid
        beyond = -np.log(distance_on_grid(self.reasons) / self.region.levels.impenetrable)
        first, last = grid.edges[(beyond[grid.edges] > 0).sum(axis=1) == 1].T
        share = beyond[first] / (beyond[first] - beyond[last])
        crossings = grid.nodes[first] + share[:, None] * (grid.nodes[last] - grid.nodes[first])
        return cKDTree(self.surface.plane.positions(torch.from_numpy(crossings))[:, 0].numpy())

    @cached_property
    def node_clearance_m(self) -> Float[np.ndarray, " node"]:
        """Distance between the positions of nodes and the obstacles [m]."""
        return nearest_body_m(self.bodies, self.nodes.decoded_m)

    @cached_property
    def _surely_clear_m(self) -> Float[np.ndarray, " node"]:
        """The same of all that is nearer to a node than to others, at least."""
        return np.asarray(self.node_clearance_m - self.nodes.half_edges_m())

    def geodesic(self, start: Float[np.ndarray, " 2"]) -> Points:
        """Nodes on the shortest way in the region from a latent point to the goal; none if there is no way."""
        first, last = self.nodes.grid.nearest(np.stack([start, self.goal[0]]))
        return np.asarray(self.nodes.grid.nodes[self.graph.shortest_path(int(first), int(last)).nodes])


def safe_skill(
    skill: Skill, states: Sequence[Float[np.ndarray, "_ D"]], bodies: Sequence[MovingBody], config: RiemannianSafety
) -> SafeSkill:
    """Find the safety region of a trained skill.

    Both α come from the data. That of the support is chosen by ν: S ≥ ν at the wanted share of demonstrated states, so
    that their motion is not changed. Those of obstacles are chosen by ρ: S ≤ ρ at every supported node whose
    position is inside of one, or nearer than the margin and half the way to its neighbours, so that nothing between
    nodes is inside either.

    Args:
        skill: Of two dimensions, in the plane or embedded.
        states: Those of its training demonstrations [m].
        bodies: Obstacles at rest in the space of positions.
        config: ρ, ν and how support and obstacles are seen.

    Raises:
        InvalidSetting: If the skill does not have two dimensions or remembers starts, the goal is not in the region, or
            an obstacle moves.
        MissingData: If obstacles contain no node of the support.
    """
    if skill.field.start_memory is not None:
        expected = "null and training=trajectory: a plane without starts says little of where motions may be"
        raise InvalidSetting("field.start_fade_durations", "a memory of starts beside safety=riemannian", expected)
    levels = Levels(config.rho, config.nu, config.steepness)
    with torch.no_grad():
        surface = SkillSurface.of(skill, states, config.density_bandwidth, config.density_power)
        nodes = surface.embedded(surface.grid(config.points_per_axis, GRID_ROOM))
    volume = nodes.volume()
    demonstrated = nodes.grid.interpolate(volume[:, None], np.concatenate(surface.codes))[:, 0]
    reasons = [Reason(SUPPORT, volume, config.nu * float(np.quantile(demonstrated, config.support_quantile)))]
    factor = np.ones(len(volume))
    if bodies:
        kept_away_m = nodes.half_edges_m() + config.margin_m
        is_supported = distance_on_grid(reasons) > levels.impenetrable
        is_unsafe = (nearest_body_m(bodies, nodes.decoded_m) < kept_away_m) & is_supported
        felt_m = kept_away_m[is_unsafe].max(initial=0.0)  # a smaller obstacle would be felt less far than it counts
        factor = combine_factors([_factor(body, nodes, felt_m, config.obstacle_gain) for body in bodies])
        reasons.append(calibrated("the obstacle", nodes.volume(factor) / volume - 1, is_unsafe, levels))
    graph = GeodesicGraph(nodes.grid, nodes.position, nodes.rest, nodes.stretch, np.zeros(len(nodes.grid.edges)))
    graph.feel(np.arange(graph.nodes), factor[None], np.full(graph.nodes, np.inf))
    goal = surface.encoded(skill.goal[None])
    goal_node = int(nodes.grid.nearest(goal)[0])
    first_nodes = nodes.grid.nearest(np.stack([one[0] for one in surface.codes]))
    supported, supported_way = _ways(graph, reasons[:1], levels, goal_node)
    distance, way = _ways(graph, reasons, levels, goal_node)
    passage = narrowest_passage(nodes.grid, distance, first_nodes[np.isfinite(way[first_nodes])], goal_node)
    support = SafetyRegion(nodes.grid, supported, supported_way, levels)  # steers nothing
    region = SafetyRegion(nodes.grid, distance, way, levels.below(passage))
    return SafeSkill(
        skill, surface, nodes, nodes.volume(factor), tuple(reasons), support, region, graph, way, tuple(bodies), goal
    )


def nearest_body_m(
    bodies: Sequence[MovingBody], positions: Float[np.ndarray, "point Dx"]
) -> Float[np.ndarray, " point"]:
    """Signed distance to the nearest body; infinite without any [m]."""
    distances = [body.signed_distance(positions, 0.0) for body in bodies]
    return np.asarray(np.min(distances, axis=0)) if distances else np.full(len(positions), np.inf)


def _factor(body: MovingBody, nodes: EmbeddedGrid, felt_m: float, gain: float) -> Float[np.ndarray, " node"]:
    if body.motion.travelled(0.0, 1.0) > 0:
        raise InvalidSetting("obstacle", body.name, "obstacles at rest: a safety region is computed once")
    return ambient_factor(body.signed_distance(nodes.decoded_m, 0.0), max(body.body.inradius, felt_m), gain)


def _ways(
    graph: GeodesicGraph, reasons: Sequence[Reason], levels: Levels, goal_node: int
) -> tuple[Float[np.ndarray, " node"], Float[np.ndarray, " node"]]:
    """S at the nodes for some reasons, and the ways to the goal where it allows them, which the graph then has."""
    distance = distance_on_grid(reasons)
    is_safe: Bool[np.ndarray, " node"] = distance > levels.impenetrable
    if not is_safe[goal_node]:
        if len(reasons) == 1:
            raise InvalidSetting("safety.nu", levels.inactive, "more: the goal is outside of the support of the data")
        raise InvalidSetting("obstacle", "over the goal", "one that leaves the goal free, or a smaller safety.margin_m")
    graph.close(~is_safe)
    return distance, graph.costs_from(goal_node)
