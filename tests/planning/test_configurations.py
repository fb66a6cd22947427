"""Plans of a whole arm: two links in the plane, whose latent space is their joint space."""

import numpy as np
import pytest
import torch
from torch import Tensor

from geomotion.manifolds.grid import LatentGrid
from geomotion.obstacles.motion import MovingBody
from geomotion.obstacles.solids import Sphere
from geomotion.planning.controller import ControllerSettings, GeodesicController
from geomotion.planning.ends import Anchors
from geomotion.planning.manifold import DecodedPath, SkillManifold, Surface
from geomotion.planning.obstruction import Constraint, RobotShape
from geomotion.planning.plan import PlanStatus
from geomotion.planning.planner import Planner, PlannerSettings
from geomotion.planning.replanner import Replanner
from geomotion.scores.configurations import ConfigurationPath, ConfigurationSupport

LINKS_M = (0.3, 0.25)
RADIUS_M, CLEARANCE_M = 0.02, 0.01
BALLS = 6  # along each link
START_RAD, GOAL_RAD = np.array([[-0.6, 0.9]]), np.array([[0.6, 0.9]])


def ends_m(joints: np.ndarray) -> np.ndarray:
    """Ends of both links, shape (state, 2, 3)."""
    angles = np.cumsum(joints, axis=-1)
    links = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1) * np.array(LINKS_M)[:, None]
    return np.cumsum(links, axis=-2)


def kinematics(joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    half, none = joints.sum(axis=1) / 2, np.zeros(len(joints))
    return ends_m(joints)[:, -1], np.stack([np.cos(half), none, none, np.sin(half)], axis=1)


class JointSpace:
    """z = q; the metric is that of the ends of both links, and of the joints themselves."""

    latent_dim, scale_m = 2, 0.3

    def __init__(self, limit_rad: float = np.inf) -> None:
        self.limit_rad = limit_rad

    def blocks(self, z: Tensor) -> tuple[Tensor, Tensor]:
        angles = z.cumsum(dim=-1)
        links = torch.stack([angles.cos(), angles.sin()], dim=-1) * torch.tensor(LINKS_M).double()[:, None]
        return links.cumsum(dim=-2) / self.scale_m, z

    def decode(self, z: np.ndarray) -> DecodedPath:
        return DecodedPath(ConfigurationPath(z, kinematics), (z[:, 0] + 0.6) / 1.2)

    def embed(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position, rest = self.blocks(torch.from_numpy(z))
        return position.numpy(), rest.numpy()

    def stretch(self, z: np.ndarray) -> np.ndarray:
        return np.ones(len(z))

    def embedding(self, z: Tensor) -> Tensor:
        position, rest = self.blocks(z)
        return torch.cat([position.flatten(-2), rest], dim=-1)

    def conformal(self, z: Tensor) -> Tensor:
        return torch.ones_like(z[..., 0])

    def allows(self, states: ConfigurationPath) -> np.ndarray:
        return np.asarray((np.abs(states.vectors) <= self.limit_rad).all(axis=1))

    def separation(self, states: ConfigurationPath, one: ConfigurationPath) -> np.ndarray:
        return np.linalg.norm(states.vectors - one.vectors, axis=1)


class Links:
    """Balls along both links; each belongs to the end of its link."""

    radii_m, blocks = np.full(2 * BALLS, RADIUS_M), np.repeat([0, 1], BALLS)
    finer: "Links | None" = None

    def points(self, states: ConfigurationPath) -> np.ndarray:
        first, second = np.moveaxis(ends_m(states.vectors), 1, 0)
        shares = (np.arange(1, BALLS + 1) / BALLS)[:, None]
        return np.concatenate([shares * first[:, None], first[:, None] + shares * (second - first)[:, None]], axis=1)

    def travel_m(self, states: ConfigurationPath, pairs: np.ndarray) -> np.ndarray:
        turned = np.abs(np.diff(states.vectors[pairs], axis=1)[:, 0])
        return turned @ [sum(LINKS_M), LINKS_M[1]]


class Stout(Links):
    """Balls so large that they come too close where the arm itself does not."""

    radii_m, finer = np.full(2 * BALLS, RADIUS_M + 0.03), Links()


class Tip(Links):
    """The last ball only."""

    radii_m, blocks = np.array([RADIUS_M]), np.array([1])

    def points(self, states: ConfigurationPath) -> np.ndarray:
        return super().points(states)[:, -1:]


def demonstrations() -> list[ConfigurationPath]:
    """The shoulder turns, the elbow bent more or less."""
    shoulder, bends = np.linspace(-0.6, 0.6, 80), np.linspace(0.1, 1.8, 18)
    return [ConfigurationPath(np.stack([shoulder, np.full(80, bend)], axis=1), kinematics) for bend in bends]


def planner_of(shape: RobotShape, limit_rad: float = np.inf, gain: float = 0.0, hard: bool = True) -> Planner:
    manifold = JointSpace(limit_rad)
    grid, support = (
        LatentGrid(np.array([-0.7, 0.0]), np.array([0.7, 1.9]), 61),
        ConfigurationSupport.of(demonstrations()),
    )
    anchors = [Anchors(q, ConfigurationPath(q, kinematics), np.array([0.02])) for q in (START_RAD, GOAL_RAD)]
    settings = PlannerSettings(0.05, 0.1, 0.05, 0.1, shape, Constraint(CLEARANCE_M, hard, gain))
    return Planner(manifold, Surface.of(manifold, grid, support), support, *anchors, settings)


def sphere(x_m: float, y_m: float, radius_m: float) -> MovingBody:
    return MovingBody.at_its_velocity("ball", Sphere(torch.tensor([x_m, y_m, 0.0]).double(), radius_m))


IN_THE_WAY = sphere(0.433, 0.183, 0.025)  # the tip gets past it by stretching, but the forearm only by bending
ENDS = ConfigurationPath(START_RAD, kinematics), ConfigurationPath(GOAL_RAD, kinematics)


def room_m(states: ConfigurationPath, body: MovingBody) -> float:
    """Of the whole arm, at closely spaced configurations."""
    points = Links().points(states.resampled(20 * len(states)))
    return float((np.linalg.norm(points - body.centre_m(0.0), axis=2) - RADIUS_M - body.body.inradius).min())


def test_the_arm_is_a_manifold_and_a_shape_for_planning():
    assert isinstance(JointSpace(), SkillManifold) and isinstance(Links(), RobotShape)
    generator = np.random.default_rng(0)
    some, pairs = ConfigurationPath(generator.uniform(-2, 2, (100, 2)), kinematics), np.arange(100).reshape(50, 2)
    moved = np.linalg.norm(np.diff(Links().points(some)[pairs], axis=1)[:, 0], axis=2).max(axis=1)
    assert (moved <= Links().travel_m(some, pairs)).all()


def test_without_obstacles_ends_are_met_exactly_and_scores_are_in_metres_and_radians():
    planner = planner_of(Links())
    beside = ConfigurationPath(GOAL_RAD + 0.02, kinematics)
    query = planner.query(ENDS[0], beside)
    plan = planner.plan(query)
    assert plan.found
    np.testing.assert_allclose(plan.path.states.vectors[[0, -1]], [START_RAD[0], beside.vectors[0]], atol=1e-12)
    missed = planner.surface.decoded.states[query.goal : query.goal + 1].residuals(beside)
    assert (plan.scores.goal_residual_m, plan.scores.goal_residual_rad) == (missed[0][0], missed[1][0])
    assert missed[1][0] == np.linalg.norm(planner.surface.grid.nodes[query.goal] - beside.vectors)
    assert plan.scores.apart_rad < 0.1 and plan.scores.apart_m < 0.05


@pytest.mark.parametrize("gain", [0.0, 20.0])
def test_the_whole_arm_keeps_clear(gain):
    planner = planner_of(Links(), gain=gain)
    plan = planner.plan(planner.query(*ENDS), [IN_THE_WAY])
    assert plan.found
    kept_m = room_m(plan.path.states, IN_THE_WAY)
    assert kept_m >= CLEARANCE_M
    assert plan.scores.clearance_m <= kept_m + 1e-9


def test_a_closer_look_finds_the_way_that_balls_around_the_arm_hide():
    planner, below = planner_of(Stout()), sphere(0.083, -0.144, 0.03)  # the upper arm, which turns upwards
    query = planner.query(*ENDS)
    assert planner.route(query, [below], 0.0, closely=False) is None
    assert Replanner(planner, *ENDS).replan([below], 0.0) is None
    plan = planner.plan(query, [below])
    assert plan.found
    kept_m = room_m(plan.path.states, below)
    assert CLEARANCE_M <= plan.scores.clearance_m <= kept_m + 1e-9


def test_the_tip_alone_gets_past_where_the_forearm_does_not():
    planner = planner_of(Tip())
    plan = planner.plan(planner.query(*ENDS), [IN_THE_WAY])
    assert plan.found and plan.scores.clearance_m >= CLEARANCE_M
    assert room_m(plan.path.states, IN_THE_WAY) < 0


def test_a_soft_constraint_acts_on_each_block_by_its_own_factor():
    rooms = []
    for gain in (0.0, 200.0):
        planner = planner_of(Links(), gain=gain, hard=False)
        plan = planner.plan(planner.query(*ENDS), [IN_THE_WAY])
        assert plan.found
        rooms.append(room_m(plan.path.states, IN_THE_WAY))
    assert rooms[1] > rooms[0] + 0.005
    factor = planner.graph.factor
    assert factor.shape == (2, 61**2) and factor.min() >= 1
    assert not np.allclose(factor[0], factor[1])


def test_what_the_arm_cannot_do_is_on_no_path():
    free, limited = (planner_of(Links(), limit) for limit in (np.inf, 1.0))
    detour = sphere(0.51, 0.05, 0.03)
    around = free.plan(free.query(*ENDS), [detour])
    assert around.found and around.path.states.vectors.max() > 1.1
    query = limited.query(*ENDS)
    plan = limited.plan(query, [detour])
    assert not query.is_open[(np.abs(query.states.vectors) > 1.0).any(axis=1)].any()
    assert plan.status is PlanStatus.blocked and plan.blocking == ("ball",)


def test_replanning_and_control_go_on_in_joint_space():
    planner = planner_of(Links())
    replanner = Replanner(planner, *ENDS)
    curve = replanner.replan([IN_THE_WAY], 0.0)
    node, here = replanner.node_at(curve.codes[80]), curve.path.states[80:81]
    onward = replanner.replan([IN_THE_WAY], 0.0, node, here)
    np.testing.assert_allclose(onward.path.states.vectors[[0, -1]], [here.vectors[0], GOAL_RAD[0]], atol=1e-12)
    controller = GeodesicController(planner, *ENDS, lambda progress: 0.3, ControllerSettings(1 / 20))
    passed = [controller.state.vectors]
    for step in range(100):
        passed.append(controller.step(step / 20, [IN_THE_WAY]).vectors)
    assert controller.arrived
    assert room_m(ConfigurationPath(np.concatenate(passed), kinematics), IN_THE_WAY) >= CLEARANCE_M - 1e-4
