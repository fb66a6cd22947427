"""The decoded graph of a whole arm: what it costs to build, and to plan anew when an obstacle has moved.

Run as ``python benchmarks/joint_graph.py``. Configurations of generated reaching motions, learned with the default
settings of `gms` and seed 0, on a latent grid of 50³ nodes with eight points of the arm, joints and tip. A sphere of
5 cm radius goes straight from one to the next of eight seeded places beside the elbow, each of which leaves a
demonstrated solution (benchmarks/whole_arm.py), and so across ways of the arm. One cycle is: it has moved, which nodes
feel it with any of the balls that contain the links, new weights, shortest path, spline, decoded configurations,
clearance checked. Cycles that end without a way count as well. One core; processor time stands beside the wall's, for
machines that are busy.
"""

import time
from dataclasses import replace

import numpy as np
import torch
from geodesics import CONSTRAINTS, PARTS, Stopwatch, grown_mib
from whole_arm import Placements, planner_of, skill

from geomotion import config as schema
from geomotion.manifolds.grid import LatentGrid, memory_bytes
from geomotion.obstacles.motion import MovingBody
from geomotion.obstacles.solids import Sphere
from geomotion.planning.manifold import Surface
from geomotion.planning.replanner import Replanner
from geomotion.stages.graph import Skilled

POINTS_PER_AXIS, PLACES, MOVES = 50, 8, 100
RADIUS_M, QUERY = 0.05, 0


def building(skilled: Skilled) -> str:
    """Seconds and memory of a graph, beside what is estimated before it is built."""
    manifold = skilled.manifold
    grid = LatentGrid.around(manifold.all_codes, POINTS_PER_AXIS, schema.GraphConfig().margin)
    support = manifold.space.support(manifold.data.paths)
    surface, surface_mib, decoding_s = grown_mib(lambda: Surface.of(manifold, grid, support))
    skilled = Skilled(skilled.skill, manifold, surface, skilled.limits, skilled.maps)
    planner, graph_mib, graph_s = grown_mib(lambda: planner_of(skilled))
    blocks = surface.position.shape[1]
    estimated, held = memory_bytes(POINTS_PER_AXIS, grid.dim, blocks) / 2**20, planner.graph.memory_bytes / 2**20
    return (
        f"{POINTS_PER_AXIS}^3 nodes, {len(grid.edges)} edges, {blocks} points: decoded in {decoding_s:.1f} s, "
        f"graph in {graph_s:.1f} s, {decoding_s + graph_s:.1f} s together\n"
        f"memory: process grown by {surface_mib:.0f} + {graph_mib:.0f} MiB, of which the graph's arrays "
        f"{held:.0f} MiB; estimated from above {estimated:.0f} MiB"
    )


def moves(places_m: np.ndarray) -> list[MovingBody]:
    """Spheres on straight ways from place to place."""
    along = np.linspace(0, len(places_m) - 1, MOVES)
    centres_m = np.stack([np.interp(along, np.arange(len(places_m)), axis) for axis in places_m.T], axis=1)
    spheres = (Sphere(torch.from_numpy(centre_m), RADIUS_M) for centre_m in centres_m)
    return [MovingBody.at_its_velocity("sphere", sphere) for sphere in spheres]


def main() -> None:
    torch.set_num_threads(1)
    skilled, paths = skill()
    print(building(skilled), flush=True)
    planner, asked = planner_of(skilled), [paths[number] for number in skilled.skill.test_demos]
    placements = Placements(skilled, planner.settings.shape, asked)
    spheres = moves(np.stack([placements.place(seed, True, QUERY).centre_m for seed in range(PLACES)]))
    stopwatch = Stopwatch(planner)
    print(f"\nReplanning cycle [ms], {MOVES} moves; medians of its parts; {len(planner.settings.shape.radii_m)} balls")
    print(
        f"{'constraint':<15}{'median':>8}{'p90':>8}{'CPU':>8}"
        + "".join(f"{one:>11}" for one in PARTS)
        + f"{'found':>8}"
    )
    for name, constraint in CONSTRAINTS.items():
        planner.settings = replace(planner.settings, constraint=constraint)
        replanner = Replanner(planner, asked[QUERY][:1], asked[QUERY][-1:])
        replanner.replan((), 0.0)
        stopwatch.read()
        rows, processor, found = [], [], 0
        for sphere in spheres:
            begun, worked = time.perf_counter(), time.process_time()
            found += replanner.replan([sphere], 0.0) is not None
            processor.append(1e3 * (time.process_time() - worked))
            rows.append([time.perf_counter() - begun, *stopwatch.read()])
        cycle, *parts = np.median(1e3 * np.array(rows), axis=0)
        slow, cells = 1e3 * np.percentile([row[0] for row in rows], 90), "".join(f"{one:>11.1f}" for one in parts)
        worked_ms = np.median(processor)
        print(f"{name:<15}{cycle:>8.1f}{slow:>8.1f}{worked_ms:>8.1f}{cells}{found / MOVES:>8.0%}", flush=True)


if __name__ == "__main__":
    main()
