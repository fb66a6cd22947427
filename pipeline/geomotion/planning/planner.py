"""From start and goal to a path on the manifold, around obstacles, within the demonstrations."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from geomotion.errors import ShapeMismatch
from geomotion.manifolds.graph import GeodesicGraph, GraphPath
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.carrying import Offsets
from geomotion.planning.curve import FittedCurve, fit_curve
from geomotion.planning.diagnosis import diagnose
from geomotion.planning.manifold import Codes, SkillManifold, Surface
from geomotion.planning.obstruction import Constraint, Tool, distances, feel, travel_m
from geomotion.planning.plan import PathScores, Plan, PlanStatus
from geomotion.scores.paths import PosePath, orientation_angles
from geomotion.scores.pose_support import PoseSupport

NO_CODES = np.zeros((0, 0))
EXTRA_CLEARANCES_M = (0.0, 0.004, 0.01)  # tried on the graph until the fitted curve keeps the wanted one
CHECKED_STEP_M = 0.002  # of the tool, between poses whose distance to obstacles is looked at
MOST_STEPS = 50  # for each step of a path
NOTHING = np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0)


@dataclass(frozen=True)
class Anchors:
    """Where the demonstrations of each group begin or end.

    Attributes:
        codes: Their mean latent point for each group, shape (group, d).
        poses: What these decode to.
        radii: Largest distance of a demonstrated end from that pose, in units of the manifold's scale, for each group.
    """

    codes: Codes
    poses: PosePath
    radii: Float[np.ndarray, " group"]


@dataclass(frozen=True)
class PlannerSettings:
    """How to plan.

    Attributes:
        cap_m: How far from the demonstrations a path may go [m].
        cap_rad: The same in orientation [rad].
        end_cap_m: How far from the demonstrations start and goal may be [m].
        end_cap_rad: The same in orientation [rad].
        tool: What must not touch obstacles.
        constraint: How obstacles act.
        control_points: Of the spline through the graph path; doubled where the spline would leave the path's tube.
        samples: Points of the resulting path.
        refine_steps: Gradient steps on the spline's energy; 0 for none.
        crossing_length: Length, in the thesis' metric, above which a path counts as crossing a region without data.
    """

    cap_m: float
    cap_rad: float
    end_cap_m: float = np.inf
    end_cap_rad: float = np.inf
    tool: Tool = field(default_factory=Tool)
    constraint: Constraint = field(default_factory=Constraint)
    control_points: int = 12
    samples: int = 200
    refine_steps: int = 0
    crossing_length: float = np.inf


@dataclass(frozen=True)
class Query:
    """Start and goal with the surface carried there: everything that obstacles do not change.

    Attributes:
        start: Node.
        goal: Node.
        offsets: What carries the skill to the wanted poses.
        ends: The wanted poses.
        poses: Carried poses of all nodes.
        points_m: Balls of the tool there.
        is_open: Nodes that paths may use.
        travel_m: How far a ball of the tool moves along each edge, at most [m].
        longest_travel_m: The same for the longest edge that paths may use [m].
    """

    start: int
    goal: int
    offsets: Offsets
    ends: PosePath
    poses: PosePath
    points_m: Float[np.ndarray, "node ball Dx"]
    is_open: Bool[np.ndarray, " node"]
    travel_m: Float[np.ndarray, " edge"]
    longest_travel_m: float


@dataclass(frozen=True)
class Route:
    """A way among obstacles.

    Attributes:
        found: On the graph.
        curve: To execute.
        clearance_m: Distance between tool and obstacles that it surely keeps [m].
    """

    found: GraphPath
    curve: FittedCurve
    clearance_m: float


class Planner:
    """Plans on one surface; the decoded graph stays in memory between calls.

    Args:
        manifold: Decoder.
        surface: Its decoded grid.
        support: The demonstrated poses.
        starts: Where demonstrations begin.
        goals: Where they end.
        settings: How to plan.
    """

    def __init__(
        self,
        manifold: SkillManifold,
        surface: Surface,
        support: PoseSupport,
        starts: Anchors,
        goals: Anchors,
        settings: PlannerSettings,
    ) -> None:
        self.manifold, self.surface, self.support, self.settings = manifold, surface, support, settings
        self._anchors = (starts, goals)
        travel = travel_m(surface.decoded.poses, surface.grid.edges, settings.tool)
        self.graph = GeodesicGraph(surface.grid, surface.position, surface.rest, surface.stretch, travel)
        self._is_open = surface.within(settings.cap_m, settings.cap_rad)

    # ------------------------------------------------------------ start and goal
    def pose_at(self, code: Float[np.ndarray, " d"]) -> PosePath:
        """What a latent point decodes to.

        Raises:
            ShapeMismatch: If it has not the dimension of the latent space.
        """
        if len(code) != self.manifold.latent_dim:
            raise ShapeMismatch("a latent point", f"{self.manifold.latent_dim} coordinates", len(code))
        return self.manifold.decode(np.asarray(code, dtype=float)[None]).poses

    def query(self, start: PosePath, goal: PosePath, codes: tuple[Codes | None, Codes | None] = (None, None)) -> Query:
        """Find the nodes for two poses and carry the surface there.

        Args:
            start: One pose.
            goal: One pose.
            codes: Latent points of start and goal, shape (1, d), where they are known.
        """
        is_open = self._is_open.copy()
        first = self._node(start, codes[0], self._anchors[0])
        is_open[first] = True
        self.graph.close(~is_open)
        self.graph.feel(*NOTHING)
        last = self._node(goal, codes[1], self._anchors[1], first)
        is_open[last] = True
        decoded, ends = self.surface.decoded, _joined(start, goal)
        ends = self._with_signs_of(ends, np.array([first, last]))
        offsets = Offsets.between(decoded.poses, ends, decoded.progress, (first, last))
        poses = offsets.carry(decoded.poses, decoded.progress)
        edges, tool = self.surface.grid.edges, self.settings.tool
        travel = travel_m(poses, edges, tool)
        longest = float(travel[is_open[edges].all(axis=1)].max(initial=0.0))
        query = Query(first, last, offsets, ends, poses, tool.points(poses), is_open, travel, longest)
        self._take_up(query)
        return query

    def onward(self, query: Query, node: int, pose: PosePath | None = None) -> Query:
        """The same query from a node on the way, at the pose where the robot is; at that of the node if omitted."""
        here = query.poses[node : node + 1] if pose is None else pose
        ends = self._with_signs_of(_joined(here, query.ends), np.array([node, query.goal]))
        return replace(query, start=node, ends=ends)

    def _take_up(self, query: Query) -> None:
        """Let the graph be what the query sees, where another one was planned meanwhile."""
        self.graph.close(~query.is_open)
        if self.graph.travel_m is not query.travel_m:
            self.graph.set_travel(query.travel_m)

    def _node(self, pose: PosePath, code: Codes | None, anchors: Anchors, reached_from: int | None = None) -> int:
        """The node of a known code, else of an anchor that is as near as demonstrations are, else the nearest."""
        if code is not None:
            return int(self.surface.grid.nearest(code)[0])
        apart = self._separation(anchors.poses, pose)
        nearest = int((apart / np.maximum(anchors.radii, np.finfo(float).tiny)).argmin())
        if apart[nearest] <= anchors.radii[nearest]:
            return int(self.surface.grid.nearest(anchors.codes[nearest : nearest + 1])[0])
        return self._nearest_node(pose, reached_from)

    def _nearest_node(self, pose: PosePath, reached_from: int | None) -> int:
        apart = np.where(self._is_open, self._separation(self.surface.decoded.poses, pose), np.inf)
        if reached_from is None or not np.isfinite(apart.min()):
            return int(apart.argmin())
        connected = np.isfinite(self.graph.costs_from(reached_from))
        among = np.where(connected, apart, np.inf)
        return int(among.argmin()) if among.min() <= 2 * apart.min() + self.cell_size() else int(apart.argmin())

    def cell_size(self) -> float:
        """Median distance between the poses of neighbouring open nodes, in units of the manifold's scale."""
        edges = self.surface.grid.edges[self._is_open[self.surface.grid.edges].all(axis=1)]
        poses = self.surface.decoded.poses
        steps = poses.position_m[edges[:, 1]] - poses.position_m[edges[:, 0]]
        return float(np.median(np.linalg.norm(steps, axis=1)) / self.manifold.scale_m) if len(edges) else 0.0

    def _separation(self, poses: PosePath, pose: PosePath) -> Float[np.ndarray, " pose"]:
        """Distances to one pose, whatever the sign of its orientation, in units of the manifold's scale."""
        across = (poses.position_m - pose.position_m) / self.manifold.scale_m
        cosine = np.abs(poses.orientation @ pose.orientation[0])
        return np.asarray(np.sqrt(np.square(across).sum(axis=1) + 2 * (1 - cosine.clip(max=1))))

    def _with_signs_of(self, ends: PosePath, nodes: Int[np.ndarray, " end"]) -> PosePath:
        """±q are one orientation: take the sign that the surface has there."""
        known = self.surface.decoded.poses.orientation[nodes]
        if ends.orientation.shape[1] == 3:
            return ends
        signs = np.where((known * ends.orientation).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
        return PosePath(ends.position_m, signs * ends.orientation)

    # ------------------------------------------------------------ planning
    def plan(
        self,
        query: Query,
        bodies: Sequence[MovingBody] = (),
        time_s: float = 0.0,
        guess: GraphPath | None = None,
    ) -> Plan:
        """The path of smallest cost among obstacles, or the reason why there is none.

        Args:
            query: Start and goal.
            bodies: Obstacles.
            time_s: When the obstacles are looked at.
            guess: The last graph path of the same query; the search is faster with it.
        """
        refused = self._refuse(query, bodies, time_s)
        if refused is not None:
            return refused
        route = self.route(query, bodies, time_s, guess)
        if route is None:
            return diagnose(self, query, bodies, time_s)
        return self._judged(query, route.curve, route.clearance_m)

    def route(
        self, query: Query, bodies: Sequence[MovingBody], time_s: float, guess: GraphPath | None = None
    ) -> Route | None:
        """The shortest way whose curve keeps the clearance, if it has to; none where there is no such way."""
        constraint = self.settings.constraint
        for extra in EXTRA_CLEARANCES_M:
            found = self.search(query, bodies, time_s, extra, guess)
            if not found.exists:
                return None
            curve = self.fit(query, found)
            clearance = self.clearance(query, curve, bodies, time_s)
            if clearance >= constraint.clearance_m or not constraint.hard:
                return Route(found, curve, clearance)
        return None

    def search(
        self, query: Query, bodies: Sequence[MovingBody], time_s: float, extra_m: float, guess: GraphPath | None = None
    ) -> GraphPath:
        """The shortest graph path among obstacles, kept at some extra clearance."""
        constraint, tool = self.settings.constraint, self.settings.tool
        wider = replace(constraint, clearance_m=constraint.clearance_m + extra_m)
        self._take_up(query)
        felt = feel(bodies, query.points_m, tool, wider, query.longest_travel_m, time_s)
        self.graph.feel(felt.nodes, felt.factor, felt.room_m)
        return self.graph.shortest_path(query.start, query.goal, guess)

    def fit(self, query: Query, found: GraphPath) -> FittedCurve:
        """A smooth curve along a graph path."""
        return fit_curve(self.manifold, self.surface, query.offsets, query.ends, found, self.graph, self.settings)

    def clearance(self, query: Query, curve: FittedCurve, bodies: Sequence[MovingBody], time_s: float) -> float:
        """Distance between tool and obstacles that is guaranteed along a whole curve [m]."""
        if not bodies:
            return np.inf
        tool, poses = self.settings.tool, _in_small_steps(curve.path.poses, self.settings.tool)
        horizon_s = self.settings.constraint.horizon_s
        apart = distances(bodies, tool.points(poses), tool.radii_m, time_s, horizon_s).min(axis=0)
        return float(((apart[:-1] + apart[1:] - _steps_m(poses, tool)) / 2).min(initial=apart[0]))

    # ------------------------------------------------------------ judging
    def _refuse(self, query: Query, bodies: Sequence[MovingBody], time_s: float) -> Plan | None:
        tool, settings = self.settings.tool, self.settings
        apart_m, apart_rad = self.support.distances(query.ends.position_m, query.ends.orientation)
        states = (
            (PlanStatus.start_outside, PlanStatus.start_covered),
            (PlanStatus.goal_outside, PlanStatus.goal_covered),
        )
        for end, (outside, covered) in enumerate(states):
            if apart_m[end] > settings.end_cap_m or apart_rad[end] > settings.end_cap_rad:
                away = f"{1000 * apart_m[end]:.0f} mm and {np.degrees(apart_rad[end]):.0f} deg away from it"
                limits = f"{1000 * settings.end_cap_m:.0f} mm and {np.degrees(settings.end_cap_rad):.0f} deg"
                return Plan(
                    outside,
                    f"{outside.value}: {away}, at most {limits} are allowed; "
                    "planning.leave_data_m= and planning.leave_data_rad= allow more",
                    NO_CODES,
                )
            if bodies and settings.constraint.hard:
                points = tool.points(query.ends[end : end + 1] if end == 0 else query.ends[1:])
                apart = distances(bodies, points, tool.radii_m, time_s, settings.constraint.horizon_s)[:, 0]
                names = tuple(
                    body.name for body, d in zip(bodies, apart, strict=True) if d < settings.constraint.clearance_m
                )
                if names:
                    reason = f"{covered.value}: {', '.join(names)}, {1000 * apart.min():.0f} mm from it"
                    return Plan(covered, reason, NO_CODES, blocking=names)
        return None

    def _judged(self, query: Query, curve: FittedCurve, clearance: float) -> Plan:
        scores = self._scores(query, curve, clearance)
        reason = PlanStatus.found.value
        status = PlanStatus.found
        plain_length = float(np.sqrt(scores.energy))
        if plain_length > self.settings.crossing_length:
            status = PlanStatus.crosses
            reason = (
                f"{status.value}: its energy is {scores.energy:.3g}, paths inside the data stay below "
                f"{self.settings.crossing_length**2:.3g}; choose start and goal in one cluster"
            )
        return Plan(status, reason, curve.codes, curve.path, scores)

    def _scores(self, query: Query, curve: FittedCurve, clearance: float) -> PathScores:
        poses = curve.path.poses
        apart_m, apart_rad = self.support.distances(poses.position_m, poses.orientation)
        line = np.linspace(curve.codes[0], curve.codes[-1], len(curve.codes))
        nodes = self.surface.decoded.poses
        ends = [query.start, query.goal]
        residual_m = np.linalg.norm(nodes.position_m[ends] - query.ends.position_m, axis=1)
        residual_rad = np.diag(orientation_angles(nodes.orientation[ends], query.ends.orientation))
        return PathScores(
            curve.length,
            curve.graph_length,
            energy(self.manifold, curve.codes),
            energy(self.manifold, line),
            clearance,
            float(apart_m.max()),
            float(apart_rad.max()),
            *(float(value) for pair in zip(residual_m, residual_rad, strict=True) for value in pair),
        )


def energy(manifold: SkillManifold, codes: Codes) -> float:
    """∫ ⟨ċ, M ċ⟩ dt in the thesis' metric, at constant speed: the squared length.

    Source: Thesis Eq. (3.14).
    """
    embedded = np.concatenate(manifold.embed(codes), axis=1)
    return float(np.linalg.norm(np.diff(embedded, axis=0), axis=1).sum() ** 2)


def _steps_m(poses: PosePath, tool: Tool) -> Float[np.ndarray, " step"]:
    numbers = np.arange(len(poses))
    return travel_m(poses, np.stack([numbers[:-1], numbers[1:]], axis=1), tool)


def _in_small_steps(poses: PosePath, tool: Tool) -> PosePath:
    """The same path with poses between its own ones."""
    longest = _steps_m(poses, tool).max(initial=0.0)
    pieces = int(np.clip(np.ceil(longest / CHECKED_STEP_M), 1, MOST_STEPS))
    return poses if pieces == 1 else poses.resampled((len(poses) - 1) * pieces + 1)


def _joined(start: PosePath, goal: PosePath) -> PosePath:
    return PosePath(
        np.concatenate([start.position_m[:1], goal.position_m[-1:]]),
        np.concatenate([start.orientation[:1], goal.orientation[-1:]]),
    )
