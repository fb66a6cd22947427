"""Decode the latent grid once, and measure what planning has to know about it."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from geomotion import manifold_models
from geomotion.config import GraphConfig, MetricConfig
from geomotion.demos import storage
from geomotion.figures.latent import LatentMaps, save_latent_figure
from geomotion.figures.latent_scene import save_latent_scene
from geomotion.figures.latent_space import save_latent_space_figure
from geomotion.files import atomic, read_json, write_json
from geomotion.learned_manifold import LearnedManifold
from geomotion.manifold_models import Skill
from geomotion.manifolds.grid import LatentGrid, memory_bytes, require_memory
from geomotion.manifolds.grid_metric import metric_on_grid
from geomotion.manifolds.metric import PullbackMetric, log_magnification
from geomotion.planning.manifold import NODES_AT_ONCE, DecodedPath, Surface
from geomotion.planning.planner import energy
from geomotion.scores.paths import DIRECTION, MotionPath, PosePath
from geomotion.scores.pose_support import Support, leave_one_out
from geomotion.stages.train_manifold import training_set
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.configurations import ConfigurationSpace

CROSSING = 10.0  # times the longest demonstration's length: a path that long crosses a region without data
LEAST_CAP_SHARE = 0.05  # of the size of the data: demonstrations may be more alike than a manifold is exact
LEAST_CAP_RAD = float(np.radians(5))
END_ROOM = 3.0  # times how far demonstrations are from each other: how far start and goal may be from them
POINTS_PER_AXIS = {2: 100, 3: 50}  # by latent dimension, if the configuration leaves it open; Fig. 3.3
JACOBIANS_AT_ONCE = 4000
LATENT_SCENE = "latent.html"


@dataclass(frozen=True)
class GraphStageConfig:
    """What the graph stage needs."""

    graph: GraphConfig
    metric: MetricConfig


@dataclass(frozen=True)
class Skilled:
    """Everything that planning starts from.

    Attributes:
        skill: The trained network.
        manifold: The same for planning.
        surface: Its decoded grid.
        limits: What ``graph.json`` says.
        maps: log10 σ and log √det M at the nodes.
    """

    skill: Skill
    manifold: LearnedManifold
    surface: Surface
    limits: Mapping[str, Any]
    maps: tuple[np.ndarray, np.ndarray]

    def latent_maps(self, cap_m: float, cap_rad: float) -> LatentMaps:
        """What a picture of the latent plane or space shows."""
        return latent_maps(self.manifold, self.surface, self.maps, cap_m, cap_rad)


def graph(config: GraphStageConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``surface.npz``, ``graph.json``, ``maps.npz`` and the picture of the latent space.

    In three dimensions that is also an interactive one, ``latent.html``.

    Raises:
        TooLargeForMemory: If the grid would not fit; before anything is allocated.
    """
    skill = manifold_models.load(inputs["train"].path("model.pt"))
    points_per_axis = config.graph.points_per_axis or POINTS_PER_AXIS[skill.network.latent_dim]
    manifold = _manifold(skill, inputs, config.metric)
    blocks = manifold.embed(np.zeros((1, manifold.latent_dim)))[0].shape[1]
    require_memory(points_per_axis, manifold.latent_dim, memory_limit_bytes(config.graph), blocks)
    begun = time.perf_counter()
    grid = LatentGrid.around(manifold.all_codes, points_per_axis, config.graph.margin)
    surface = Surface.of(manifold, grid, manifold.space.support(_both_signs(manifold)))
    seconds = time.perf_counter() - begun
    _save(surface, run)
    cap_m, cap_rad = _cap(manifold, manifold.data.paths)
    end_cap_m, end_cap_rad = _cap(manifold, manifold.data.originals)
    lengths = [float(np.sqrt(energy(manifold, codes.numpy()))) for codes in manifold.codes]
    document = {
        "points_per_axis": grid.points_per_axis,
        "nodes": grid.points_per_axis**grid.dim,
        "edges": len(grid.edges),
        "build_s": seconds,
        "memory_bytes": memory_bytes(grid.points_per_axis, grid.dim, blocks),
        "cap_m": cap_m,
        "cap_rad": cap_rad,
        "end_cap_m": END_ROOM * end_cap_m,
        "end_cap_rad": END_ROOM * end_cap_rad,
        "open_share": float(surface.within(cap_m, cap_rad).mean()),
        "demonstration_lengths": lengths,
        "crossing_length": CROSSING * max(lengths),
        "latent_spacing": manifold.spacing,
    }
    write_json(run.folder / "graph.json", document)
    log_std, log_volume = _spread_and_volume(manifold, surface)
    with atomic(run.folder / "maps.npz") as temporary:
        np.savez_compressed(temporary, allow_pickle=False, log_std=log_std, log_magnification=log_volume)
    maps = latent_maps(manifold, surface, (log_std, log_volume), cap_m, cap_rad)
    if maps.dim == 2:
        save_latent_figure(maps, run.folder / "figures")
    else:
        save_latent_space_figure(maps, run.folder / "figures")
        save_latent_scene(maps, run.folder / LATENT_SCENE)


def memory_limit_bytes(config: GraphConfig) -> int:
    """How much memory a graph may take."""
    return int(config.memory_limit_gib * 2**30)


def graph_table(document: Mapping[str, Any]) -> str:
    """What was built, in lines for people."""
    cap = f"{1000 * document['cap_m']:.1f} mm, {np.degrees(document['cap_rad']):.1f} deg"
    lengths = document["demonstration_lengths"]
    return aligned(
        [
            ("nodes", f"{document['nodes']} ({document['points_per_axis']} an axis), {document['edges']} edges"),
            ("built in", f"{document['build_s']:.2f} s, at most {document['memory_bytes'] / 2**20:.0f} MiB"),
            ("support cap", f"{cap} from the demonstrations; {document['open_share']:.1%} of the nodes are within it"),
            (
                "demonstrations",
                f"{min(lengths):.2f} to {max(lengths):.2f} long; crossing above {document['crossing_length']:.0f}",
            ),
        ]
    )


def load_skilled(inputs: Mapping[str, Artefacts], metric: MetricConfig) -> Skilled:
    """What stages after the graph start from."""
    skill = manifold_models.load(inputs["train"].path("model.pt"))
    manifold = _manifold(skill, inputs, metric)
    with np.load(inputs["graph"].path("surface.npz"), allow_pickle=False) as stored:
        arrays = dict(stored)
    grid = LatentGrid(arrays["low"], arrays["high"], int(arrays["points_per_axis"]))
    decoded = DecodedPath(manifold.data.paths[0].with_vectors(arrays["states"]), arrays["progress"])
    names = ("position", "rest", "stretch", "apart_m", "apart_rad")
    surface = Surface(grid, decoded, *(arrays[name] for name in names))
    with np.load(inputs["graph"].path("maps.npz"), allow_pickle=False) as stored:
        maps = stored["log_std"], stored["log_magnification"]
    return Skilled(skill, manifold, surface, read_json(inputs["graph"].path("graph.json")), maps)


def _save(surface: Surface, run: StageRun) -> None:
    arrays = {
        "low": surface.grid.low,
        "high": surface.grid.high,
        "points_per_axis": np.array(surface.grid.points_per_axis),
        "states": surface.decoded.states.vectors,
        "progress": surface.decoded.progress,
        "position": surface.position,
        "rest": surface.rest,
        "stretch": surface.stretch,
        "apart_m": surface.apart_m,
        "apart_rad": surface.apart_rad,
    }
    with atomic(run.folder / "surface.npz") as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **arrays)


def _manifold(skill: Skill, inputs: Mapping[str, Artefacts], metric: MetricConfig) -> LearnedManifold:
    demonstrations = storage.load(inputs["ingest"].folder)
    return LearnedManifold(skill, training_set(demonstrations, skill.train_demos, skill.config, skill.arm), metric)


def _cap(manifold: LearnedManifold, paths: Sequence[MotionPath]) -> tuple[float, float]:
    """How far demonstrations, each held out in turn, go from all the others: the farthest of them.

    Demonstrations that hardly differ, in orientation for example, would leave no room for what learning misses.
    """
    steps_m = max(float(np.linalg.norm(np.diff(path.position_m, axis=0), axis=1).max()) for path in paths)
    support_of: Callable[[Sequence[MotionPath]], Support] = manifold.space.support
    apart_m, apart_rad = [steps_m, LEAST_CAP_SHARE * manifold.scale_m], [LEAST_CAP_RAD]
    for alike in _repetitions(manifold, paths):
        if len(alike) > 1:
            in_m, in_rad = leave_one_out(alike, support_of)
            apart_m.append(float(in_m.max()))
            apart_rad.append(float(in_rad.max()))
    return max(apart_m), max(apart_rad)


def _repetitions(manifold: LearnedManifold, paths: Sequence[MotionPath]) -> list[list[MotionPath]]:
    """Demonstrations that are compared with each other: all poses; configurations within their groups.

    Several solutions of an arm may lead its hand along one and the same path, which says nothing of how people vary it.
    """
    if not isinstance(manifold.space, ConfigurationSpace):
        return [list(paths)]
    groups = manifold.data.groups
    return [[path for path, own in zip(paths, groups, strict=True) if own == one] for one in dict.fromkeys(groups)]


def _both_signs(manifold: LearnedManifold) -> list[MotionPath]:
    """The demonstrations, on S² with their antipodes where those were shown, too."""
    paths = list(manifold.data.paths)
    if manifold.shows_both_signs and paths[0].orientation.shape[1] == DIRECTION:
        paths += [PosePath(path.position_m, -path.orientation) for path in paths]
    return paths


def _spread_and_volume(manifold: LearnedManifold, surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """log10 σ and log √det M in the thesis' metric at the nodes, in double precision.

    Exact in a plane; in space, Jacobians of all nodes would take minutes, and differences of the surface do.
    """
    grid, nodes = surface.grid, torch.from_numpy(surface.grid.nodes)
    log_std = torch.cat([manifold.network.std(batch) for batch in torch.split(nodes, NODES_AT_ONCE)]).log10()
    if grid.dim == 2:
        pulled_back = PullbackMetric(manifold)
        metric = torch.cat([pulled_back(batch) for batch in torch.split(nodes, JACOBIANS_AT_ONCE)])
    else:
        metric = torch.from_numpy(metric_on_grid(grid, surface.position, surface.rest))
    return log_std.numpy().reshape(grid.shape), log_magnification(metric).numpy().reshape(grid.shape)


def latent_maps(
    manifold: LearnedManifold, surface: Surface, maps: tuple[np.ndarray, np.ndarray], cap_m: float, cap_rad: float
) -> LatentMaps:
    """What a picture of the latent plane or space shows."""
    ends = zip(surface.grid.low, surface.grid.high, strict=True)
    return LatentMaps(
        axes=tuple(np.linspace(low, high, surface.grid.points_per_axis) for low, high in ends),
        log_std=maps[0],
        log_magnification=maps[1],
        within=surface.within(cap_m, cap_rad).reshape(surface.grid.shape),
        codes=[codes.numpy() for codes in manifold.codes],
        other_codes=manifold.other_codes,
        groups=list(manifold.data.groups),
    )
