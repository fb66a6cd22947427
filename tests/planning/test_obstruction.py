"""What obstacles do to decoded nodes, and the tool that must not touch them."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation, Slerp

from geomotion.errors import InvalidSetting
from geomotion.obstacles.ambient import ambient_factor
from geomotion.obstacles.motion import ConstantVelocity, MovingBody
from geomotion.obstacles.solids import Box, Sphere
from geomotion.planning.obstruction import Balls, Constraint, RobotShape, Tool, distances, feel
from geomotion.scores.paths import PosePath

BOTTLE = Tool(np.array([[0.0, 0, 0], [0, 0, 0.1], [0.05, 0, 0.2]]), np.array([0.02, 0.03, 0.01]))


def poses(count: int = 500, seed: int = 0, spread_m: float = 0.5) -> PosePath:
    generator = np.random.default_rng(seed)
    turns = Rotation.random(count, rng=generator).as_quat(scalar_first=True)
    return PosePath(generator.uniform(-spread_m, spread_m, size=(count, 3)), turns)


def ball(radius: float = 0.08, centre: tuple[float, ...] = (0.0, 0.0, 0.0)) -> MovingBody:
    return MovingBody.at_its_velocity("ball", Sphere(torch.tensor(centre, dtype=torch.float64), radius))


def box() -> MovingBody:
    solid = Box(torch.tensor([0.2, 0.1, 0.0], dtype=torch.float64), [0.3, 0.1, 0.2], 0.01)
    return MovingBody("box", solid, ConstantVelocity(np.array([0.2, 0.0, -0.1])))


def test_balls_of_a_tool_turn_with_the_pose():
    some = poses(20)
    rotation = Rotation.from_quat(some.orientation, scalar_first=True)
    for number, centre in enumerate(BOTTLE.centres_m):
        expected = some.position_m + rotation.apply(centre)
        np.testing.assert_allclose(BOTTLE.points(some)[:, number], expected)
    either = PosePath(some.position_m, -some.orientation)
    np.testing.assert_allclose(BOTTLE.points(either), BOTTLE.points(some))
    np.testing.assert_allclose(Tool().points(some)[:, 0], some.position_m)
    assert isinstance(BOTTLE, RobotShape)
    np.testing.assert_array_equal(BOTTLE.blocks, 0)  # all act on the end effector's position
    assert BOTTLE.lever_m == pytest.approx(np.hypot(0.05, 0.2)) and Tool().lever_m == 0


def test_positions_in_the_plane_and_directions_are_taken_too():
    flat = PosePath(np.random.default_rng(0).normal(size=(5, 2)), np.tile([0.0, 0, 1], (5, 1)))
    np.testing.assert_allclose(Tool(radii_m=np.array([0.1])).points(flat)[:, 0], flat.position_m)
    disc = MovingBody.at_its_velocity("disc", Sphere(torch.zeros(2, dtype=torch.float64), 0.1))
    found = distances([disc], Tool().points(flat), np.zeros(1), 0.0)
    np.testing.assert_allclose(found[0], np.linalg.norm(flat.position_m, axis=1) - 0.1)


def test_travel_bounds_the_way_of_every_ball_between_two_poses():
    some = poses(400)
    pairs = np.arange(400).reshape(-1, 2)
    bound = BOTTLE.travel_m(some, pairs)
    for pair, limit in zip(pairs, bound, strict=True):
        turns = Rotation.from_quat(some.orientation[pair], scalar_first=True)
        shares = np.linspace(0, 1, 200)
        between = some.position_m[pair[0]] + shares[:, None] * np.diff(some.position_m[pair], axis=0)
        way = PosePath(between, Slerp([0, 1], turns)(shares).as_quat(scalar_first=True))
        steps = np.linalg.norm(np.diff(BOTTLE.points(way), axis=0), axis=2).sum(axis=0)
        assert steps.max() <= limit + 1e-9
    still = PosePath(some.position_m[:2], np.stack([some.orientation[0], -some.orientation[0]]))
    np.testing.assert_allclose(
        BOTTLE.travel_m(still, np.array([[0, 1]])), np.linalg.norm(np.diff(still.position_m, axis=0)), atol=1e-7
    )
    np.testing.assert_allclose(
        Tool().travel_m(some, pairs), np.linalg.norm(np.diff(some.position_m[pairs], axis=1)[:, 0], axis=1)
    )


def test_distances_are_those_of_the_nearest_ball():
    some = poses(50)
    found = distances([ball(), box()], BOTTLE.points(some), BOTTLE.radii_m, 0.5)
    assert found.shape == (2, 50)
    for row, body in zip(found, [ball(), box()], strict=True):
        each = [
            body.signed_distance(BOTTLE.points(some)[:, k], 0.5) - radius for k, radius in enumerate(BOTTLE.radii_m)
        ]
        np.testing.assert_allclose(row, np.min(each, axis=0))


@pytest.mark.parametrize("horizon_s", [0.0, 0.7])
@pytest.mark.parametrize("gain", [0.0, 5.0, 100.0, 1e5])
@pytest.mark.parametrize("tool", [Tool(), BOTTLE], ids=["point", "bottle"])
def test_no_node_that_matters_is_left_out(tool, gain, horizon_s):
    some, bodies, longest_m = poses(4000), [ball(), box()], 0.04
    constraint = Constraint(0.02, True, gain, horizon_s)
    felt = feel(bodies, Balls(tool.points(some), tool), constraint, longest_m, 0.3)
    apart = distances(bodies, tool.points(some), tool.radii_m, 0.3, horizon_s)
    factor, room = np.ones(4000), np.full(4000, np.inf)
    factor[felt.nodes], room[felt.nodes] = felt.factor[0], felt.room_m
    size = tool.radii_m.max()
    exact = sum(
        ambient_factor(row, body.body.inradius + size, gain) - 1 for row, body in zip(apart, bodies, strict=True)
    )
    assert_close_from_below(factor, 1 + exact)
    assert_rooms_where_they_matter(room, apart.min(axis=0) - 0.02, longest_m)
    assert 0 < len(felt.nodes) < 4000


def assert_close_from_below(factor: np.ndarray, exact: np.ndarray) -> None:
    """No more than one percent is missed for each of two obstacles, as only balls near them are looked at."""
    assert (exact - factor).max() <= 0.02
    assert ((factor - exact) / exact).max() <= 1e-9


def assert_rooms_where_they_matter(room_m: np.ndarray, exact_m: np.ndarray, longest_m: float) -> None:
    """Exact where an edge might be closed; elsewhere there is room for every edge."""
    matters = exact_m < longest_m
    assert matters.any() and not matters.all()
    np.testing.assert_allclose(room_m[matters], exact_m[matters], atol=1e-12)
    assert room_m[~matters].min() >= longest_m


class Limb:
    """Two balls at the end effector in block 2, one where three times its orientation would be in block 0."""

    radii_m, blocks = np.array([0.02, 0.05, 0.03]), np.array([2, 2, 0])
    finer = None

    def points(self, states: PosePath) -> np.ndarray:
        return np.stack([states.position_m, states.position_m + 0.1, 3 * states.orientation[:, 1:]], axis=1)

    def travel_m(self, states: PosePath, pairs: np.ndarray) -> np.ndarray:
        return np.linalg.norm(np.diff(self.points(states)[pairs], axis=1)[:, 0], axis=-1).max(axis=1)


@pytest.mark.parametrize("horizon_s", [0.0, 0.7])
def test_each_block_has_the_factor_of_its_own_nearest_ball(horizon_s):
    limb, some, bodies, constraint = (
        Limb(),
        poses(800, spread_m=1.5),
        [ball(0.2), box()],
        Constraint(0.02, True, 50.0, horizon_s),
    )
    assert isinstance(limb, RobotShape)
    points = limb.points(some)
    felt = feel(bodies, Balls(points, limb), constraint, 0.04, 0.3, block_count=4)
    assert felt.factor.shape == (4, len(felt.nodes)) and 0 < len(felt.nodes) < 800
    np.testing.assert_array_equal(felt.factor[[1, 3]], 1)  # without balls
    factors, room = np.ones((4, 800)), np.full(800, np.inf)
    factors[:, felt.nodes], room[felt.nodes] = felt.factor, felt.room_m
    for factor, own in zip(factors[::2], ([2], [0, 1]), strict=True):
        apart = distances(bodies, points[:, own], limb.radii_m[own], 0.3, horizon_s)
        added = [
            ambient_factor(row, body.body.inradius + limb.radii_m[own].max(), 50.0) - 1
            for row, body in zip(apart, bodies, strict=True)
        ]
        assert_close_from_below(factor, 1 + sum(added))
    assert (felt.factor[0] > 5 * felt.factor[2]).any() and (felt.factor[2] > 5 * felt.factor[0]).any()
    nearest = distances(bodies, points, limb.radii_m, 0.3, horizon_s).min(axis=0)
    assert_rooms_where_they_matter(room, nearest - 0.02, 0.04)  # whichever block the nearest ball belongs to


def test_a_soft_constraint_closes_nothing_and_no_obstacle_is_felt_nowhere():
    some = poses(300)
    soft = feel([ball()], Balls(BOTTLE.points(some), BOTTLE), Constraint(0.02, False, 100.0), 0.04, 0.0)
    assert np.isinf(soft.room_m).all() and soft.factor.max() > 10
    hard = feel([ball()], Balls(BOTTLE.points(some), BOTTLE), Constraint(0.02, True, 0.0), 0.04, 0.0)
    np.testing.assert_array_equal(hard.factor, 1.0)
    for bodies in ([], [ball(centre=(9.0, 9.0, 9.0))]):
        assert len(feel(bodies, Balls(BOTTLE.points(some), BOTTLE), Constraint(), 0.04, 0.0).nodes) == 0


def test_a_moving_obstacle_is_felt_where_it_gets_to():
    some = poses(4000)
    fast = MovingBody(
        "fast", Sphere(torch.zeros(3, dtype=torch.float64), 0.05), ConstantVelocity(np.array([0.6, 0, 0]))
    )
    now, soon = (
        feel([fast], Balls(Tool().points(some), Tool()), Constraint(0.01, True, 0.0, h), 0.02, 0.0) for h in (0.0, 0.5)
    )
    assert set(now.nodes) < set(soon.nodes)
    taken = soon.nodes[soon.room_m < 0]
    for time_s in np.linspace(0, 0.5, 40):
        inside = np.flatnonzero(fast.signed_distance(some.position_m, time_s) < 0.01)
        assert np.isin(inside, taken).all()


def test_a_tool_without_balls_or_with_negative_radii_is_refused():
    with pytest.raises(InvalidSetting, match="as many centres as radii"):
        Tool(np.zeros((2, 3)), np.zeros(1))
    with pytest.raises(InvalidSetting, match="as many centres as radii"):
        Tool(np.zeros((0, 3)), np.zeros(0))
    with pytest.raises(InvalidSetting, match="radii of 0 or more"):
        Tool(radii_m=np.array([-0.1]))
