"""Replanning around a moving ball on a decoded latent grid, with networkx beside it.

Run as ``python benchmarks/geodesics.py``. A manifold is trained on generated reaching motions of the Panda; a ball of
5 cm radius runs along the path that is free without it and swings across it, so that it stands on the path, beside it
and away from it. One cycle is: the obstacle has moved, which nodes feel it, new weights, shortest path, spline, decoded
poses, clearance checked. networkx stands in for the graph alone, everything before and after is the same. It weighs the
edges in reach one after the other, as its users do, or is handed the new weights of the same array code and only stores
them. One core.
"""

import ctypes
import gc
import math
import os
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import networkx
import numpy as np
import torch

from geomotion import config as schema
from geomotion import manifold_models
from geomotion.demos.poses import pose_paths
from geomotion.demos.preprocessing import preprocess
from geomotion.demos.readers import read
from geomotion.learned_manifold import LearnedManifold
from geomotion.manifold_models import Skill
from geomotion.manifolds.graph import GeodesicGraph, GraphPath
from geomotion.manifolds.grid import LatentGrid
from geomotion.obstacles.motion import MovingBody, Waypoints
from geomotion.obstacles.solids import Sphere
from geomotion.planning.ends import NOTHING
from geomotion.planning.manifold import Surface
from geomotion.planning.obstruction import Constraint
from geomotion.planning.planner import Planner, PlannerSettings
from geomotion.planning.replanner import Replanner
from geomotion.scores.paths import PosePath
from geomotion.scores.pose_support import PoseSupport, leave_one_out
from geomotion.training.manifold_fit import fit_manifold
from geomotion.training.poses import PoseSpace
from geomotion.training.states import TrainingSet

TRAINING_STEPS = 1500
GRIDS = (100, 150)
CONSTRAINTS = {"hard": Constraint(), "hard and soft": Constraint(gain=100.0)}
WARM_UP_CYCLES, CYCLES = 20, 300
NETWORKX_EVERY = 6  # cycles, to keep the benchmark short
RADIUS_M, SWING_M, SWINGS = 0.05, 0.12, 4
PARTS = ("distances", "weights", "search", "curve", "clearance")
GRAPH = slice(2, 4)  # of a cycle's row: weights and search


class NetworkxGraph:
    """What a planner asks of a graph whose positions are one block, answered by networkx.

    Args:
        graph: The same graph in arrays. It is kept up to date because the curve is checked against it, which takes
            about a hundredth of a cycle.
        stores_only: Whether it is handed new weights instead of computing them.
    """

    def __init__(self, graph: GeodesicGraph, stores_only: bool) -> None:
        graph.feel(*NOTHING)
        self.graph, self.stores_only, self.pairs = graph, stores_only, graph.edges.tolist()
        names = ("position", "rest", "stretch", "travel", "weight")
        columns = (*graph._position, graph._rest, graph._stretch, graph.travel_m, graph.weights)
        rows = zip(*(column.tolist() for column in columns), strict=True)
        self.networkx = networkx.Graph()
        self.networkx.add_nodes_from(range(graph.nodes))
        kept = names[-1:] if stores_only else names
        for (first, second), row in zip(self.pairs, rows, strict=True):
            self.networkx.add_edge(first, second, **{name: row[names.index(name)] for name in kept})
        self._felt: list[int] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.graph, name)

    def feel(self, nodes: np.ndarray, factor: np.ndarray, room_m: np.ndarray) -> None:
        before = self.graph.weights.copy()
        self.graph.feel(nodes, factor, room_m)
        if self.stores_only:
            self._store(np.flatnonzero(self.graph.weights != before))
        else:
            self._weigh(nodes.tolist(), factor[0].tolist(), room_m.tolist())

    def shut(self, nodes: np.ndarray) -> None:
        before = self.graph.weights.copy()
        self.graph.shut(nodes)
        if self.stores_only:
            self._store(np.flatnonzero(self.graph.weights != before))
        else:
            for _, _, edge in self.networkx.edges(nodes.tolist(), data=True):
                edge["weight"] = math.inf
            self._felt = [*self._felt, *nodes.tolist()]

    def shortest_path(self, start: int, goal: int, guess: GraphPath | None = None) -> GraphPath:
        nodes = np.array(networkx.shortest_path(self.networkx, start, goal, weight="weight"))
        cost = self.graph.cost(nodes)
        return GraphPath(nodes if math.isfinite(cost) else nodes[:0], cost)

    def _store(self, changed: np.ndarray) -> None:
        for edge, weight in zip(changed.tolist(), self.graph.weights[changed].tolist(), strict=True):
            first, second = self.pairs[edge]
            self.networkx[first][second]["weight"] = weight

    def _weigh(self, nodes: list[int], factor: list[float], room_m: list[float]) -> None:
        factors, rooms = dict(zip(nodes, factor, strict=True)), dict(zip(nodes, room_m, strict=True))
        is_open = self.graph._open
        for first, second, edge in self.networkx.edges({*self._felt, *nodes}, data=True):
            mean = (factors.get(first, 1.0) + factors.get(second, 1.0)) / 2
            fits = rooms.get(first, math.inf) + rooms.get(second, math.inf) >= edge["travel"]
            length = edge["stretch"] * math.sqrt(mean * edge["position"] + edge["rest"])
            edge["weight"] = length if fits and is_open[first] and is_open[second] else math.inf
        self._felt = nodes


class Stopwatch:
    """Adds up how long the parts of a planner's cycle take [s]."""

    def __init__(self, planner: Planner) -> None:
        self.spent: dict[str, float] = defaultdict(float)
        for owner, method, part in (
            (planner, "sense", "distances"), (planner.graph, "feel", "weights"),
            (planner.graph, "shut", "shut"), (planner.graph, "shortest_path", "search"), (planner, "fit", "curve"),
            (planner, "clearances", "clearance"),
        ):  # fmt: skip
            setattr(owner, method, self._timed(getattr(owner, method), part))

    def read(self) -> list[float]:
        """Seconds of each part since the last reading."""
        self.spent["distances"] -= self.spent["weights"]  # happens within it
        self.spent["weights"] += self.spent["shut"]
        spent = [self.spent[part] for part in PARTS]
        self.spent.clear()
        return spent

    def _timed(self, call: Callable[..., Any], part: str) -> Callable[..., Any]:
        def timed(*inputs: Any, **named: Any) -> Any:
            begun = time.perf_counter()
            found = call(*inputs, **named)
            self.spent[part] += time.perf_counter() - begun
            return found

        return timed


def trained() -> tuple[LearnedManifold, TrainingSet]:
    """A manifold of reaching motions."""
    dataset = schema.PandaReachDataset(name="panda/reach_to_grasp")
    demonstrations = preprocess(read(dataset), dataset.preprocess)
    config = manifold_models.settled(schema.ManifoldConfig(), arm=None)
    paths = pose_paths(demonstrations, config.points)
    data = TrainingSet.of(PoseSpace.of(paths), paths, demonstrations.groups, config.carry_ends)
    with tempfile.TemporaryDirectory() as folder:
        fitted = fit_manifold(
            data,
            config,
            schema.ManifoldTraining(steps=TRAINING_STEPS),
            lambda seed: manifold_models.build(config, data.space, seed),
            0,
            Path(folder) / "checkpoint",
            lambda step, values: None,
        )
    skill = Skill(fitted.network, config, data.space, tuple(range(len(data.paths))), ())
    return LearnedManifold(skill, data, schema.MetricConfig()), data


def planner_on(manifold: LearnedManifold, data: TrainingSet, surface: Surface, constraint: Constraint) -> Planner:
    """A planner with the support cap that `gms graph` would find."""
    cap_m, cap_rad = (apart.max() for apart in leave_one_out(data.paths))
    settings = PlannerSettings(cap_m, cap_rad, constraint=constraint)
    ends = manifold.anchors(0), manifold.anchors(-1)
    return Planner(manifold, surface, PoseSupport.of(data.originals), *ends, settings)


def ball_along(position_m: np.ndarray) -> MovingBody:
    """A ball that runs along the middle of a path in one second and swings across it."""
    time_s = np.linspace(0, 1, CYCLES)
    shares = np.linspace(0, 1, len(position_m))
    middle = np.stack([np.interp(0.2 + 0.6 * time_s, shares, axis) for axis in position_m.T], axis=1)
    across = np.cross(position_m[-1] - position_m[0], [0.0, 0.0, 1.0])
    swing_m = SWING_M * np.sin(2 * np.pi * SWINGS * time_s)
    body = Sphere(torch.zeros(3, dtype=torch.float64), RADIUS_M)
    return MovingBody("ball", body, Waypoints(time_s, middle + swing_m[:, None] * across / np.linalg.norm(across)))


def cycles(planner: Planner, demonstration: PosePath, every: int = 1) -> tuple[np.ndarray, float]:
    """Milliseconds of each cycle and of its parts, shape (cycle, 1 + part), and the share of cycles with a path."""
    replanner = Replanner(planner, demonstration[:1], demonstration[-1:])
    free = replanner.replan((), 0.0)
    assert free is not None
    ball, stopwatch = ball_along(free.path.states.position_m), Stopwatch(planner)
    times_s = np.linspace(0, 1, CYCLES)
    for time_s in times_s[: WARM_UP_CYCLES if every == 1 else 1]:
        replanner.replan([ball], time_s)
    stopwatch.read()
    rows, found = [], 0
    for time_s in times_s[::every]:
        begun = time.perf_counter()
        found += replanner.replan([ball], time_s) is not None
        rows.append([time.perf_counter() - begun, *stopwatch.read()])
    return 1e3 * np.array(rows), found / len(rows)


def grown_mib(make: Callable[[], Any]) -> tuple[Any, float, float]:
    """What was made, by how much this process grew [MiB], and how long it took [s]."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)  # what was freed before would otherwise be used again, and not counted
    before, begun = _resident_mib(), time.perf_counter()
    made = make()
    seconds = time.perf_counter() - begun
    return made, _resident_mib() - before, seconds


def _resident_mib() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def build_row(manifold: LearnedManifold, data: TrainingSet, points: int) -> tuple[str, Surface]:
    """What a grid costs in time and memory, and what the same graph costs in networkx."""
    grid = LatentGrid.around(manifold.all_codes, points, schema.GraphConfig().margin)
    begun = time.perf_counter()
    surface = Surface.of(manifold, grid, PoseSupport.of(data.paths))
    decoded_s = time.perf_counter() - begun
    planner, own_mib, graph_s = grown_mib(lambda: planner_on(manifold, data, surface, Constraint()))
    _, other_mib, other_s = grown_mib(lambda: NetworkxGraph(planner.graph, stores_only=True))
    held_mib = planner.graph.memory_bytes / 2**20
    seconds = "".join(f"{value:>10.2f}" for value in (decoded_s, graph_s, decoded_s + graph_s, other_s))
    mib = "".join(f"{value:>10.1f}" for value in (held_mib, own_mib, other_mib))
    return f"{f'{points}x{points}':<10}{seconds}{mib}", surface


def cycle_rows(points: int, name: str, planner: Planner, demonstration: PosePath) -> tuple[str, str]:
    """Own cycles, and those of networkx around the same ball."""
    label = f"{f'{points}x{points}':<9}{name:<15}"
    own, found = cycles(planner, demonstration)
    medians, slow = np.median(own, axis=0), np.percentile(own[:, 0], 90)
    cells = []
    graph = planner.graph
    for stores_only in (False, True):
        planner.graph = NetworkxGraph(graph, stores_only)  # type: ignore[assignment]
        others = cycles(planner, demonstration, NETWORKX_EVERY)[0]
        other = np.median(others, axis=0)
        cells.append(f"{other[0]:>10.1f}{np.percentile(others[:, 0], 90):>8.1f}{other[0] / medians[0]:>8.1f}x")
        cells.append(f"{other[GRAPH].sum() / medians[GRAPH].sum():>8.1f}x")
    of_parts = "".join(f"{part:>11.2f}" for part in medians[1:])
    return f"{label}{medians[0]:>8.2f}{slow:>8.2f}{of_parts}{found:>8.0%}", label + "".join(cells)


def main() -> None:
    torch.set_num_threads(1)
    manifold, data = trained()
    print("Building [s] and memory [MiB]; networkx is given decoded nodes")
    heads = ("decoding", "graph", "both", "networkx", "arrays", "process", "networkx")
    print(f"{'grid':<10}" + "".join(f"{head:>{10}}" for head in heads))
    surfaces = {}
    for points in GRIDS:
        row, surfaces[points] = build_row(manifold, data, points)
        print(row, flush=True)
    left = f"{'grid':<9}{'constraint':<15}"
    print(f"\nReplanning cycle [ms], {CYCLES} of them; medians of its parts")
    print(f"{left}{'median':>8}{'p90':>8}" + "".join(f"{part:>11}" for part in PARTS) + f"{'found':>8}")
    beside = []
    for points, surface in surfaces.items():
        for name, constraint in CONSTRAINTS.items():
            planner = planner_on(manifold, data, surface, constraint)
            own, other = cycle_rows(points, name, planner, data.originals[0])
            print(own, flush=True)
            beside.append(other)
    print("\nThe same with networkx [ms], and how many times as long the cycle takes, and weights and search alone")
    print(f"{'':24}{'edge by edge':^35}{'handed its weights':^35}")
    print(left + 2 * f"{'median':>10}{'p90':>8}{'cycle':>9}{'graph':>9}")
    print("\n".join(beside))


if __name__ == "__main__":
    main()
