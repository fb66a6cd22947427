"""From start and goal to a path on the manifold, around obstacles, within the demonstrations."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial.distance import cdist

from geomotion.errors import ShapeMismatch
from geomotion.manifolds.graph import GeodesicGraph, GraphPath
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.clearance import kept_clearances
from geomotion.planning.curve import FittedCurve, fit_curve
from geomotion.planning.diagnosis import diagnose
from geomotion.planning.ends import Anchors, Ends, Query
from geomotion.planning.manifold import Codes, SkillManifold, Surface
from geomotion.planning.obstruction import Constraint, RobotShape, Tool, closer_look, distances, feel
from geomotion.planning.plan import PathScores, Plan, PlanStatus
from geomotion.scores.paths import MotionPath
from geomotion.scores.pose_support import Support

NO_CODES = np.zeros((0, 0))
ROUTES = 40  # tried until the curve fitted to one keeps the wanted clearance


@dataclass(frozen=True)
class PlannerSettings:
    """How to plan.

    Attributes:
        cap_m: How far from the demonstrations a path may go [m].
        cap_rad: The same in orientation [rad].
        end_cap_m: How far from the demonstrations start and goal may be [m].
        end_cap_rad: The same in orientation [rad].
        shape: What must not touch obstacles.
        constraint: How obstacles act.
        control_points: Of the spline through the graph path; doubled where the spline would leave the path's tube.
        samples: Points of the resulting path.
        refine_steps: Gradient steps on the spline's energy; 0 for none.
        closes_edges: Whether an edge is closed if an obstacle might touch it. Where the travel along edges is long, or
            hardly known, that leaves no way; False leaves it to the check of the curve.
        crossing_length: Length, in the thesis' metric, above which a path counts as crossing a region without data.
    """

    cap_m: float
    cap_rad: float
    end_cap_m: float = np.inf
    end_cap_rad: float = np.inf
    shape: RobotShape = field(default_factory=Tool)
    constraint: Constraint = field(default_factory=Constraint)
    control_points: int = 12
    samples: int = 200
    refine_steps: int = 0
    closes_edges: bool = True
    crossing_length: float = np.inf


@dataclass(frozen=True)
class Route:
    """A way among obstacles.

    Attributes:
        found: On the graph.
        curve: To execute.
        closely: Whether its clearance shows only in smaller balls.
    """

    found: GraphPath
    curve: FittedCurve
    closely: bool


class Planner:
    """Plans on one surface; the decoded graph stays in memory between calls.

    Args:
        manifold: Decoder.
        surface: Its decoded grid.
        support: The demonstrated states.
        starts: Where demonstrations begin.
        goals: Where they end.
        settings: How to plan.
    """

    def __init__(
        self,
        manifold: SkillManifold,
        surface: Surface,
        support: Support,
        starts: Anchors,
        goals: Anchors,
        settings: PlannerSettings,
    ) -> None:
        self.manifold, self.surface, self.support, self.settings = manifold, surface, support, settings
        nowhere = np.zeros(len(surface.grid.edges))  # until a query says how far the robot moves along edges
        self.graph = GeodesicGraph(surface.grid, surface.position, surface.rest, surface.stretch, nowhere)
        is_within = surface.within(settings.cap_m, settings.cap_rad)
        self.ends = Ends(
            manifold, surface, starts, goals, settings.shape, is_within, settings.closes_edges, settings.crossing_length
        )

    # ------------------------------------------------------------ start and goal
    def state_at(self, code: Float[np.ndarray, " d"]) -> MotionPath:
        """What a latent point decodes to.

        Raises:
            ShapeMismatch: If it has not the dimension of the latent space.
        """
        if len(code) != self.manifold.latent_dim:
            raise ShapeMismatch("a latent point", f"{self.manifold.latent_dim} coordinates", len(code))
        return self.manifold.decode(np.asarray(code, dtype=float)[None]).states

    def query(
        self, start: MotionPath, goal: MotionPath, codes: tuple[Codes | None, Codes | None] = (None, None)
    ) -> Query:
        """Find the nodes for two states and carry the surface there.

        Args:
            start: One state.
            goal: One state.
            codes: Latent points of start and goal, shape (1, d), where they are known.
        """
        query = self.ends.query(self.graph, start, goal, codes)
        self._take_up(query)
        return query

    def _take_up(self, query: Query) -> None:
        """Let the graph be what the query sees, where another one was planned meanwhile."""
        self.graph.close(~query.is_open)
        if self.graph.travel_m is not query.travel_m:
            self.graph.set_travel(query.travel_m)

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
        kept = self.clearances(route.curve, bodies, time_s, route.closely)
        return self.judged(query, route.curve, float(kept.min(initial=np.inf)))

    def route(
        self,
        query: Query,
        bodies: Sequence[MovingBody],
        time_s: float,
        guess: GraphPath | None = None,
        closely: bool = True,
    ) -> Route | None:
        """The shortest way whose curve keeps the clearance, if it has to; none where there is no such way.

        Args:
            query: Start and goal.
            bodies: Obstacles.
            time_s: When they are looked at.
            guess: The last graph path of the same query; the search is faster with it.
            closely: Whether the robot is looked at in smaller balls before it is said that there is no way.
        """
        found = self._route(query, bodies, time_s, guess, closely=False)
        if found is None and closely and bodies and self.settings.shape.finer is not None:
            found = self._route(query, bodies, time_s, guess, closely=True)
        return found

    def _route(
        self, query: Query, bodies: Sequence[MovingBody], time_s: float, guess: GraphPath | None, closely: bool
    ) -> Route | None:
        constraint = self.settings.constraint
        self.sense(query, bodies, time_s, closely)
        for _ in range(ROUTES):
            found = self.graph.shortest_path(query.start, query.goal, guess)
            if not found.exists:
                return None
            curve = self.fit(query, found)
            kept = self.clearances(curve, bodies, time_s, closely, constraint.clearance_m)
            if not constraint.hard or kept.min(initial=np.inf) >= constraint.clearance_m:
                return Route(found, curve, closely)
            self.graph.shut(self._near(query, found, curve, kept < constraint.clearance_m))
            guess = found
        return None

    def search(self, query: Query, bodies: Sequence[MovingBody], time_s: float) -> GraphPath:
        """The shortest graph path among obstacles; whether a curve along it keeps the clearance, too, is not known."""
        self.sense(query, bodies, time_s)
        return self.graph.shortest_path(query.start, query.goal)

    def sense(self, query: Query, bodies: Sequence[MovingBody], time_s: float, closely: bool = False) -> None:
        """Let the graph know where obstacles are."""
        constraint = self.settings.constraint
        self._take_up(query)
        block_count = self.surface.position.shape[1]
        felt = feel(bodies, query.balls, constraint, query.longest_travel_m, time_s, block_count)
        finer = self.settings.shape.finer if closely else None
        if finer is not None:
            states = query.states.with_vectors(query.states.vectors[query.nodes[felt.nodes]])
            felt = closer_look(felt, states, finer, bodies, constraint, query.longest_travel_m, time_s)
        self.graph.feel(query.nodes[felt.nodes], felt.factor, felt.room_m)

    def _near(
        self, query: Query, found: GraphPath, curve: FittedCurve, is_close: Bool[np.ndarray, " step"]
    ) -> Int[np.ndarray, " node"]:
        """Nodes of a path, and around the curve fitted to it, where that comes too close; start and goal stay open."""
        grid, steps = self.surface.grid, np.flatnonzero(is_close)
        codes = curve.codes[np.unique([steps, steps + 1])]
        of_path = cdist(codes, grid.nodes[found.nodes]).argmin(axis=1)
        near = np.concatenate([grid.nearest(codes), found.nodes[of_path]])
        return np.setdiff1d(near, [query.start, query.goal])

    def fit(self, query: Query, found: GraphPath) -> FittedCurve:
        """A smooth curve along a graph path."""
        return fit_curve(self.manifold, self.surface, query.offsets, query.ends, found, self.graph, self.settings)

    def clearances(
        self,
        curve: FittedCurve,
        bodies: Sequence[MovingBody],
        time_s: float,
        closely: bool = False,
        enough_m: float = np.inf,
    ) -> Float[np.ndarray, " step"]:
        """Distances between robot and obstacles that are kept along the steps of a curve [m]; empty without any.

        Those above `enough_m` may be bounds far below the distance.
        """
        if not bodies:
            return np.zeros(0)
        constraint, shape = self.settings.constraint, self.settings.shape
        if closely and shape.finer is not None:
            shape = shape.finer
        return kept_clearances(curve.path.states, shape, bodies, time_s, constraint.horizon_s, enough_m)

    # ------------------------------------------------------------ judging
    def _refuse(self, query: Query, bodies: Sequence[MovingBody], time_s: float) -> Plan | None:
        settings = self.settings
        shape = settings.shape.finer or settings.shape
        apart_m, apart_rad = self.support.distances(query.ends)
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
                points = shape.points(query.ends[end : end + 1] if end == 0 else query.ends[1:])
                apart = distances(bodies, points, shape.radii_m, time_s, settings.constraint.horizon_s)[:, 0]
                names = tuple(
                    body.name for body, d in zip(bodies, apart, strict=True) if d < settings.constraint.clearance_m
                )
                if names:
                    reason = f"{covered.value}: {', '.join(names)}, {1000 * apart.min():.0f} mm from it"
                    return Plan(covered, reason, NO_CODES, blocking=names)
        return None

    def judged(self, query: Query, curve: FittedCurve, clearance: float) -> Plan:
        """The plan that a curve is: found, or across a region without data."""
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
        apart_m, apart_rad = self.support.distances(curve.path.states)
        line = np.linspace(curve.codes[0], curve.codes[-1], len(curve.codes))
        nodes = self.surface.decoded.states
        found = nodes.with_vectors(nodes.vectors[[query.start, query.goal]])
        residual_m, residual_rad = found.residuals(query.ends)
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
    position, rest = manifold.embed(codes)
    embedded = np.column_stack([position.reshape(len(codes), -1), rest])
    return float(np.linalg.norm(np.diff(embedded, axis=0), axis=1).sum() ** 2)
