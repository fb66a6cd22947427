"""Decode the latent grid once, and measure what planning has to know about it."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from geomotion import manifold_models
from geomotion.config import GraphConfig, MetricConfig
from geomotion.demos import storage
from geomotion.figures.latent import LatentMaps, save_latent_figure
from geomotion.files import atomic, read_json, write_json
from geomotion.manifold_models import PoseManifold, PoseSkill
from geomotion.manifolds.grid import LatentGrid, memory_bytes, require_memory
from geomotion.manifolds.metric import PullbackMetric, log_magnification
from geomotion.planning.manifold import DecodedPath, Surface
from geomotion.planning.planner import energy
from geomotion.scores.paths import PosePath
from geomotion.scores.pose_support import PoseSupport, leave_one_out
from geomotion.stages.train_manifold import training_set
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun

CROSSING = 10.0  # times the longest demonstration's length: a path that long crosses a region without data
LEAST_CAP_SHARE = 0.05  # of the size of the data: demonstrations may be more alike than a manifold is exact
LEAST_CAP_RAD = float(np.radians(5))
END_ROOM = 3.0  # times how far demonstrations are from each other: how far start and goal may be from them
MAP_POINTS = 4000  # at most, in one batch of Jacobians


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
        maps: log10 σ and log √det M at the nodes of a plane; None in three dimensions.
    """

    skill: PoseSkill
    manifold: PoseManifold
    surface: Surface
    limits: Mapping[str, Any]
    maps: tuple[np.ndarray, np.ndarray] | None = None

    def latent_maps(self, cap_m: float, cap_rad: float) -> LatentMaps | None:
        """What a picture of the latent plane shows; None in three dimensions."""
        return None if self.maps is None else latent_maps(self.manifold, self.surface, self.maps, cap_m, cap_rad)


def graph(config: GraphStageConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``surface.npz``, ``graph.json`` and the picture of the latent space.

    Raises:
        TooLargeForMemory: If the grid would not fit; before anything is allocated.
    """
    skill = manifold_models.load(inputs["train"].path("model.pt"))
    require_memory(config.graph.points_per_axis, skill.config.latent_dim, memory_limit_bytes(config.graph))
    demonstrations = storage.load(inputs["ingest"].folder)
    manifold = PoseManifold(skill, training_set(demonstrations, skill.train_demos, skill.config), config.metric)
    begun = time.perf_counter()
    grid = LatentGrid.around(manifold.all_codes, config.graph.points_per_axis, config.graph.margin)
    surface = Surface.of(manifold, grid, PoseSupport.of(_both_signs(manifold)))
    seconds = time.perf_counter() - begun
    _save(surface, run)
    cap_m, cap_rad = _cap(manifold.data.paths, manifold.scale_m)
    end_cap_m, end_cap_rad = _cap(manifold.data.originals, manifold.scale_m)
    lengths = [float(np.sqrt(energy(manifold, codes.numpy()))) for codes in manifold.codes]
    document = {
        "points_per_axis": grid.points_per_axis,
        "nodes": grid.points_per_axis**grid.dim,
        "edges": len(grid.edges),
        "build_s": seconds,
        "memory_bytes": memory_bytes(grid.points_per_axis, grid.dim),
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
    if grid.dim == 2:
        log_std, log_volume = _spread_and_volume(manifold, surface)
        with atomic(run.folder / "maps.npz") as temporary:
            np.savez_compressed(temporary, allow_pickle=False, log_std=log_std, log_magnification=log_volume)
        save_latent_figure(
            latent_maps(manifold, surface, (log_std, log_volume), cap_m, cap_rad), run.folder / "figures"
        )


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
    demonstrations = storage.load(inputs["ingest"].folder)
    manifold = PoseManifold(skill, training_set(demonstrations, skill.train_demos, skill.config), metric)
    with np.load(inputs["graph"].path("surface.npz"), allow_pickle=False) as stored:
        arrays = dict(stored)
    grid = LatentGrid(arrays["low"], arrays["high"], int(arrays["points_per_axis"]))
    decoded = DecodedPath(PosePath(arrays["position_m"], arrays["orientation"]), arrays["progress"])
    names = ("position", "rest", "stretch", "apart_m", "apart_rad")
    surface = Surface(grid, decoded, *(arrays[name] for name in names))
    maps = None
    if grid.dim == 2:
        with np.load(inputs["graph"].path("maps.npz"), allow_pickle=False) as stored:
            maps = stored["log_std"], stored["log_magnification"]
    return Skilled(skill, manifold, surface, read_json(inputs["graph"].path("graph.json")), maps)


def _save(surface: Surface, run: StageRun) -> None:
    arrays = {
        "low": surface.grid.low,
        "high": surface.grid.high,
        "points_per_axis": np.array(surface.grid.points_per_axis),
        "position_m": surface.decoded.poses.position_m,
        "orientation": surface.decoded.poses.orientation,
        "progress": surface.decoded.progress,
        "position": surface.position,
        "rest": surface.rest,
        "stretch": surface.stretch,
        "apart_m": surface.apart_m,
        "apart_rad": surface.apart_rad,
    }
    with atomic(run.folder / "surface.npz") as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **arrays)


def _cap(paths: Sequence[PosePath], scale_m: float) -> tuple[float, float]:
    """How far demonstrations, each held out in turn, go from all the others: the farthest of them.

    Demonstrations that hardly differ, in orientation for example, would leave no room for what learning misses.
    """
    steps_m = max(float(np.linalg.norm(np.diff(path.position_m, axis=0), axis=1).max()) for path in paths)
    apart_m, apart_rad = leave_one_out(paths) if len(paths) > 1 else (np.zeros(1), np.zeros(1))
    return max(float(apart_m.max()), steps_m, LEAST_CAP_SHARE * scale_m), max(float(apart_rad.max()), LEAST_CAP_RAD)


def _both_signs(manifold: PoseManifold) -> list[PosePath]:
    """The demonstrations, on S² with their antipodes where those were shown, too."""
    paths = list(manifold.data.paths)
    if manifold.shows_both_signs and manifold.data.geometry.orientation_dim == 3:
        paths += [PosePath(path.position_m, -path.orientation) for path in paths]
    return paths


def _spread_and_volume(manifold: PoseManifold, surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """log10 σ and log √det M at the nodes of a plane, in double precision."""
    nodes = torch.from_numpy(surface.grid.nodes)
    metric = PullbackMetric(manifold)
    log_std = manifold.network.std(nodes).log10().numpy()
    batches = [log_magnification(metric(batch)) for batch in torch.split(nodes, MAP_POINTS)]
    return log_std.reshape(surface.grid.shape), torch.cat(batches).numpy().reshape(surface.grid.shape)


def latent_maps(
    manifold: PoseManifold, surface: Surface, maps: tuple[np.ndarray, np.ndarray], cap_m: float, cap_rad: float
) -> LatentMaps:
    """What a picture of the latent plane shows."""
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
