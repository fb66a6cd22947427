"""Shortest paths on decoded grids: against networkx, closed forms, and what obstacles must not break."""

import math

import networkx
import numpy as np
import pytest
import torch

from geomotion.errors import ShapeMismatch
from geomotion.manifolds.graph import GeodesicGraph, GraphPath
from geomotion.manifolds.grid import LatentGrid, memory_bytes

ANISOTROPY = 1 / math.cos(math.pi / 8)  # 1.082: length of a path in eight directions over that of the straight line
NONE = np.zeros(0, dtype=np.intp), np.zeros((1, 0)), np.zeros(0)


def random_graph(seed: int = 0, points: int = 8, dim: int = 2, blocks: int = 1) -> GeodesicGraph:
    """Random embeddings, factors and travel."""
    generator = np.random.default_rng(seed)
    grid = LatentGrid(np.zeros(dim), np.ones(dim), points)
    count, edges = points**dim, len(grid.edges)
    position, rest = generator.normal(size=(count, blocks, 3)), generator.normal(size=(count, 4))
    return GeodesicGraph(grid, position, rest, generator.uniform(0.5, 2, count), generator.uniform(0.1, 1, edges))


def flat_graph(points: int = 21) -> tuple[LatentGrid, GeodesicGraph]:
    """The unit square with its own metric."""
    grid = LatentGrid(np.zeros(2), np.ones(2), points)
    travel = np.linalg.norm(np.diff(grid.nodes[grid.edges], axis=1)[:, 0], axis=1)
    return grid, GeodesicGraph(grid, grid.nodes[:, None], np.zeros((points**2, 1)), np.ones(points**2), travel)


def feel_at_random(graph: GeodesicGraph, generator: np.random.Generator) -> None:
    """Obstacles on a third of the nodes, scattered or side by side, some of them closing edges."""
    some = generator.choice(graph.nodes, graph.nodes // 3, replace=False)
    nodes = some if generator.random() < 0.5 else np.arange(some.min(), some.min() + graph.nodes // 3) % graph.nodes
    factor = 1 + generator.exponential(20, (len(graph.factor), len(nodes)))
    graph.feel(nodes, factor, generator.uniform(-0.1, 1.0, len(nodes)))


def as_networkx(graph: GeodesicGraph) -> networkx.Graph:
    found = networkx.Graph()
    found.add_nodes_from(range(graph.nodes))
    weighted = zip(*graph.edges.T.tolist(), graph.weights.tolist(), strict=True)
    found.add_weighted_edges_from(one for one in weighted if math.isfinite(one[2]))
    return found


@pytest.mark.parametrize(("points", "dim", "blocks"), [(8, 2, 1), (5, 3, 1), (8, 2, 4)])
@pytest.mark.parametrize("seed", range(3))
def test_paths_cost_what_networkx_finds_on_the_same_weights(points, dim, blocks, seed):
    graph, generator = random_graph(seed, points, dim, blocks), np.random.default_rng(seed)
    for _ in range(10):
        feel_at_random(graph, generator)
        graph.close(generator.random(graph.nodes) < 0.2)
        start, goal = (int(node) for node in generator.choice(graph.nodes, 2, replace=False))
        oracle = networkx.single_source_dijkstra_path_length(as_networkx(graph), start)
        found = graph.shortest_path(start, goal)
        assert found.cost == pytest.approx(oracle.get(goal, math.inf), rel=1e-12)
        expected = [oracle.get(node, math.inf) for node in range(graph.nodes)]
        np.testing.assert_allclose(graph.costs_from(start), expected, rtol=1e-12)


@pytest.mark.parametrize("blocks", [1, 2, 8])
def test_weights_are_the_lengths_of_chords_under_the_factors_of_all_blocks(blocks):
    generator = np.random.default_rng(0)
    grid = LatentGrid(np.zeros(2), np.ones(2), 4)
    position, rest = generator.normal(size=(16, blocks, 3)), generator.normal(size=(16, 2))
    conformal = generator.random(16) + 1
    graph = GeodesicGraph(grid, position, rest, conformal, np.zeros(len(grid.edges)))
    factor = 1 + 20 * generator.random((blocks, 16))
    graph.feel(np.arange(16), factor, np.full(16, np.inf))
    for (i, j), weight in zip(grid.edges, graph.weights, strict=True):
        chords = position[j] - position[i]
        weighted = sum((m[i] + m[j]) / 2 * chord @ chord for m, chord in zip(factor, chords, strict=True))
        middle = math.sqrt(weighted + np.square(rest[j] - rest[i]).sum())
        assert weight == pytest.approx((conformal[i] + conformal[j]) / 2 * middle)
    np.testing.assert_allclose(graph.factor, factor)


def test_blocks_with_one_factor_are_one_block():
    generator = np.random.default_rng(0)
    grid = LatentGrid(np.zeros(2), np.ones(2), 6)
    position, others = generator.normal(size=(36, 3, 4)), (generator.normal(size=(36, 2)), generator.random(36) + 1)
    parts, whole = (
        GeodesicGraph(grid, one, *others, np.zeros(len(grid.edges))) for one in (position, position.reshape(36, 1, 12))
    )
    factor, room = 1 + 20 * generator.random(36), np.full(36, np.inf)
    parts.feel(np.arange(36), np.tile(factor, (3, 1)), room)
    whole.feel(np.arange(36), factor[None], room)
    np.testing.assert_allclose(parts.weights, whole.weights, rtol=1e-12)


def test_a_path_on_a_flat_metric_is_at_most_eight_percent_longer_than_the_straight_line():
    grid, graph = flat_graph()
    generator, ratios = np.random.default_rng(0), []
    for _ in range(100):
        start, goal = (int(node) for node in generator.choice(graph.nodes, 2, replace=False))
        found = graph.shortest_path(start, goal)
        ratios.append(found.cost / np.linalg.norm(grid.nodes[goal] - grid.nodes[start]))
    assert min(ratios) >= 1 - 1e-12
    assert max(ratios) <= ANISOTROPY + 1e-12
    assert max(ratios) > 1.07  # the stencil's own error, at any resolution


def test_a_path_on_a_sphere_is_nearly_a_great_circle(sphere):
    grid = LatentGrid(np.array([0.9, 0.0]), np.array([2.2, 1.3]), 60)
    anisotropy = 1 / math.cos(math.atan(1 / math.sin(2.2)) / 2)  # of cells that are not square
    position = sphere().positions(torch.from_numpy(grid.nodes)).numpy()
    graph = GeodesicGraph(grid, position, np.zeros((3600, 1)), np.ones(3600), np.zeros(len(grid.edges)))
    generator = np.random.default_rng(0)
    for _ in range(20):
        start, goal = (int(node) for node in generator.choice(3600, 2, replace=False))
        angle = math.acos(position[start, 0] @ position[goal, 0])
        cost = graph.shortest_path(start, goal).cost
        assert 0.9999 * angle <= cost <= 1.001 * anisotropy * angle  # chords are shorter than arcs


@pytest.mark.parametrize("blocks", [1, 3])
def test_obstacles_that_are_gone_leave_the_weights_as_they_were_to_the_last_bit(blocks):
    graph, generator = random_graph(blocks=blocks), np.random.default_rng(0)
    before = graph.weights.copy()
    for _ in range(5):
        feel_at_random(graph, generator)
        assert (graph.weights != before).any()
    graph.feel(*NONE)
    np.testing.assert_array_equal(graph.weights, before)
    np.testing.assert_array_equal(graph.factor, 1.0)
    assert graph.is_free(np.arange(graph.nodes)).all()


def test_the_weights_depend_on_the_last_obstacles_alone():
    graph, fresh = random_graph(), random_graph()
    for seed in range(5):
        feel_at_random(graph, np.random.default_rng(seed))
    feel_at_random(fresh, np.random.default_rng(4))
    np.testing.assert_array_equal(graph.weights, fresh.weights)
    start, goal = 0, graph.nodes - 1
    assert graph.shortest_path(start, goal).cost == fresh.shortest_path(start, goal).cost


def test_closed_nodes_are_on_no_path_until_they_are_opened():
    grid, graph = flat_graph(11)
    wall = np.abs(grid.nodes[:, 0] - 0.5) < 0.01
    corner, other = 0, graph.nodes - 1
    free = graph.shortest_path(corner, other)
    graph.close(wall)
    blocked = graph.shortest_path(corner, other)
    assert not blocked.exists and len(blocked.nodes) == 0 and blocked.cost == math.inf
    assert graph.is_free(np.flatnonzero(~wall)).all() and not graph.is_free(np.flatnonzero(wall)).any()
    graph.close(wall & (grid.nodes[:, 1] < 0.95))
    around = graph.shortest_path(corner, other)
    assert not wall[around.nodes].all() and around.exists
    assert (wall[around.nodes] <= (grid.nodes[around.nodes, 1] > 0.95)).all()
    graph.close(np.zeros(graph.nodes, dtype=bool))
    assert graph.shortest_path(corner, other).cost == free.cost


@pytest.mark.filterwarnings("error")
def test_shut_nodes_are_on_no_path_until_obstacles_are_put_anew():
    graph, other = random_graph(points=10), random_graph(points=10)
    felt = np.arange(30, 60), np.full((1, 30), 3.0), np.full(30, 0.9)
    graph.feel(*felt)
    found = graph.shortest_path(0, 99)
    inner = found.nodes[1:-1]
    graph.shut(inner[:2])
    graph.shut(inner[2:])  # also those shut before stay so
    around = graph.shortest_path(0, 99, found)
    assert around.exists and around.cost > found.cost
    assert not np.isin(around.nodes, inner).any() and not graph.is_free(inner).any()
    assert np.isinf(graph.weights[np.isin(graph.edges, inner).any(axis=1)]).all()
    for put in (felt, NONE):
        for one in (graph, other):
            one.feel(*put)
        np.testing.assert_array_equal(graph.weights, other.weights)
    assert graph.is_free(np.arange(100)).all()


def test_closing_and_obstacles_do_not_undo_each_other():
    graph = random_graph()
    closed = np.random.default_rng(1).random(graph.nodes) < 0.3
    graph.close(closed)
    weights = graph.weights.copy()
    feel_at_random(graph, np.random.default_rng(2))
    graph.feel(*NONE)
    np.testing.assert_array_equal(graph.weights, weights)
    assert np.isinf(weights[closed[graph.edges].any(axis=1)]).all()


@pytest.mark.parametrize("blocks", [1, 2])
@pytest.mark.parametrize("batch", range(4))
def test_a_guess_changes_nothing_but_the_speed(batch, blocks):
    graph, generator = random_graph(batch, 10, blocks=blocks), np.random.default_rng(batch)
    last: GraphPath | None = None
    start, goal = 0, graph.nodes - 1
    graph.close(generator.random(graph.nodes) < 0.3)
    for step in range(50):
        feel_at_random(graph, generator)
        if step % 5 == 4:  # a start beside the last path, other closed nodes, another tool
            start = int(generator.integers(goal))
            graph.close(generator.random(graph.nodes) < generator.uniform(0, 0.4))
            graph.set_travel(generator.uniform(0.1, 1, len(graph.edges)))
        found = graph.shortest_path(start, goal, last)
        exact = networkx.single_source_dijkstra_path_length(as_networkx(graph), start).get(goal, math.inf)
        assert found.cost == pytest.approx(exact, rel=1e-12)
        assert graph.cost(found.nodes) == (found.cost if found.exists else 0.0)
        last = found if found.exists and generator.random() < 0.8 else last


def test_a_guess_between_other_nodes_is_ignored():
    graph = random_graph()
    other = graph.shortest_path(3, 20)
    assert graph.shortest_path(0, 63, other).cost == graph.shortest_path(0, 63).cost
    assert graph.shortest_path(0, 63, GraphPath(np.zeros(0, dtype=np.intp), math.inf)).exists


def test_the_cost_of_a_path_is_the_sum_of_its_weights():
    graph, generator = random_graph(points=10), np.random.default_rng(0)
    feel_at_random(graph, generator)
    costs = graph.costs_from(0)
    for goal in range(1, graph.nodes, 7):
        found = graph.shortest_path(0, goal)
        assert found.cost == costs[goal]
        if found.exists:
            assert graph.cost(found.nodes) == pytest.approx(found.cost, rel=1e-12)
            assert graph.cost(found.nodes[::-1]) == pytest.approx(found.cost, rel=1e-12)
            assert (found.nodes[0], found.nodes[-1]) == (0, goal)
    assert graph.cost(np.array([5])) == 0
    assert graph.cost(np.array([0, 55])) == math.inf  # no neighbours


def test_a_path_to_where_it_starts_is_one_node():
    found = random_graph().shortest_path(5, 5)
    assert found.exists and found.cost == 0
    np.testing.assert_array_equal(found.nodes, [5])


@pytest.mark.parametrize("seed", range(5))
def test_whole_open_edges_keep_the_clearance(seed):
    generator = np.random.default_rng(seed)
    grid = LatentGrid(np.zeros(2), np.ones(2), 15)
    bent = np.column_stack([grid.nodes, np.sin(3 * grid.nodes[:, 0]) + 0.3 * generator.random(225)])
    travel = np.linalg.norm(np.diff(bent[grid.edges], axis=1)[:, 0], axis=1)
    graph = GeodesicGraph(grid, bent[:, None], np.zeros((225, 1)), np.ones(225), travel)
    clearance_m, opened, closed = 0.05, 0, 0
    for _ in range(10):
        centres, radii = bent[generator.choice(225, 3)] + 0.1, generator.uniform(0.05, 0.3, 3)

        def distance(points: np.ndarray, centres=centres, radii=radii) -> np.ndarray:
            return (np.linalg.norm(points[..., None, :] - centres, axis=-1) - radii).min(axis=-1)

        graph.feel(np.arange(225), np.ones((1, 225)), distance(bent) - clearance_m)
        is_open = np.isfinite(graph.weights)
        ends = bent[grid.edges[is_open]]
        along = generator.random((50, len(ends), 1))
        assert distance(ends[:, 0] + along * (ends[:, 1] - ends[:, 0])).min() >= clearance_m - 1e-12
        opened, closed = opened + is_open.sum(), closed + (~is_open).sum()
    assert opened > 100 and closed > 100


def test_more_travel_closes_edges_and_less_opens_them():
    _, graph = flat_graph()
    graph.feel(np.arange(graph.nodes), np.ones((1, graph.nodes)), np.full(graph.nodes, 0.03))
    travel = graph.travel_m
    assert np.isfinite(graph.weights[travel < 0.06]).all() and np.isinf(graph.weights[travel > 0.06]).all()
    graph.set_travel(2 * travel)
    assert np.isinf(graph.weights).all()
    graph.set_travel(0.1 * travel)
    assert np.isfinite(graph.weights).all()


@pytest.mark.parametrize(("points", "dim", "blocks"), [(100, 2, 1), (30, 3, 1), (30, 3, 8), (20, 3, 30)])
def test_a_graph_takes_no_more_memory_than_was_estimated(points, dim, blocks):
    graph = random_graph(points=points, dim=dim, blocks=blocks)
    estimate = memory_bytes(points, dim, blocks)
    assert 0.2 * estimate < graph.memory_bytes <= estimate


def test_arrays_of_other_lengths_are_refused():
    grid = LatentGrid(np.zeros(2), np.ones(2), 3)
    position, rest = np.zeros((9, 1, 3)), np.zeros((9, 4))
    arrays = {"position": position, "rest": rest, "conformal": np.ones(9), "travel_m": np.zeros(20)}
    for name in arrays:
        with pytest.raises(ShapeMismatch, match=f"{name} of a geodesic graph"):
            GeodesicGraph(grid, **(arrays | {name: arrays[name][:-1]}))
