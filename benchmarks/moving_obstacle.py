"""A sphere that crosses the way of the hand, in closed loop on the simulated Panda: contacts and replanning times.

Run as ``python benchmarks/moving_obstacle.py [trials]``; 100 by default. A manifold is trained on generated reaching
motions. In each seeded trial a sphere of 4 cm radius moves straight on at 5 to 15 cm/s, in a random direction across
the path that is free without it. It is aimed at a random point between 30 and 70 % of that path, to be there within
half a second of when the hand would be (but not in the first half second). No trial is left out, and each lasts four
times as long as the free motion, so what happens at the goal counts as well. Hand and fingers are protected; the arm's
other links are not, because planning in task space does not decide where they are: their contacts are counted apart.
The sphere does not push: what it touches is counted in every step, and the motion goes on as if it had not been there.
One core.
"""

import sys
import time
from collections import Counter
from dataclasses import dataclass

import numpy as np
import torch
from geodesics import trained

from geomotion import config as schema
from geomotion.demos.preprocessing import preprocess
from geomotion.demos.readers import read
from geomotion.manifolds.grid import LatentGrid
from geomotion.obstacles.motion import ConstantVelocity, MovingBody
from geomotion.obstacles.solids import Sphere
from geomotion.planning.controller import ControllerSettings, GeodesicController, Pace
from geomotion.planning.manifold import Surface
from geomotion.planning.obstruction import Constraint, Tool, distances
from geomotion.planning.planner import Planner, PlannerSettings
from geomotion.robot import panda
from geomotion.robot.closed_loop import closed_loop
from geomotion.robot.inverse_kinematics import solve_path
from geomotion.robot.panda_arm import panda_arm
from geomotion.robot.scene import ArmScene
from geomotion.scores.paths import PosePath
from geomotion.scores.pose_support import PoseSupport, leave_one_out
from geomotion.stages.replan import Pilot, demonstrated_pace

TRIALS = 100
RADIUS_M, SPEEDS_M_PER_S = 0.04, (0.05, 0.15)
AIMED_AT, EARLY_OR_LATE_S, EARLIEST_S = (0.3, 0.7), 0.5, 0.5
CONTROL_HZ, CONSTRAINT = 60.0, Constraint(clearance_m=0.01, horizon_s=1.0)
LEAVE_M, LEAVE_RAD = 0.02, 0.06  # how much farther from the data than the demonstrations themselves
LASTS = 4.0  # times the free motion
PROTECTED = ("panda_hand", "panda_leftfinger", "panda_rightfinger")


@dataclass(frozen=True)
class Task:
    """What all trials share: a free path in time, and what plans along it."""

    planner: Planner
    path: PosePath
    time_s: np.ndarray
    pace: Pace
    start_rad: np.ndarray


@dataclass(frozen=True)
class Trial:
    """What came of one sphere."""

    seed: int
    touched: tuple[str, ...]
    clearance_m: float
    unaware_m: float
    arrived: bool
    waited_s: float
    replanning_ms: tuple[float, ...]


def make_task() -> Task:
    """From the first to the last pose of the first demonstration."""
    manifold, data = trained()
    surface = Surface.of(manifold, LatentGrid.around(manifold.all_codes, 100, 0.1), PoseSupport.of(data.paths))
    centres_m, radii_m = panda.hand_balls("grasp_target")
    cap_m, cap_rad = (apart.max() for apart in leave_one_out(data.paths))
    settings = PlannerSettings(
        cap_m + LEAVE_M, cap_rad + LEAVE_RAD, shape=Tool(centres_m, radii_m), constraint=CONSTRAINT
    )
    ends = manifold.anchors(0), manifold.anchors(-1)
    planner = Planner(manifold, surface, PoseSupport.of(data.originals), *ends, settings)
    dataset = schema.PandaReachDataset(name="panda/reach_to_grasp")
    recorded = preprocess(read(dataset), dataset.preprocess).trajectories
    pace = demonstrated_pace(data.originals, data.progress, [one.duration_s for one in recorded])
    first = data.originals[0]
    path = planner.plan(planner.query(first[:1], first[-1:])).path
    assert path is not None
    steps_s = path.states.steps_m() / [pace(progress) for progress in path.progress[:-1]]
    joints = solve_path(path.states.position_m, path.states.orientation).joints_rad
    return Task(planner, path.states, np.concatenate([[0.0], np.cumsum(steps_s)]), pace, joints[0])


def sphere(task: Task, seed: int) -> MovingBody:
    """Aimed at the hand on its way."""
    draw = np.random.default_rng(seed)
    row = int(draw.uniform(*AIMED_AT) * (len(task.path) - 1))
    there_s = max(task.time_s[row] + draw.uniform(-EARLY_OR_LATE_S, EARLY_OR_LATE_S), EARLIEST_S)
    along = task.path.position_m[row + 3] - task.path.position_m[row - 3]
    along /= np.linalg.norm(along)
    across = draw.normal(size=3)
    across -= across @ along * along
    velocity = across / np.linalg.norm(across) * draw.uniform(*SPEEDS_M_PER_S)
    begin = torch.from_numpy(task.path.position_m[row] - velocity * there_s)
    return MovingBody("sphere", Sphere(begin, RADIUS_M), ConstantVelocity(velocity))


def unaware_m(task: Task, body: MovingBody) -> float:
    """Smallest distance between the sphere and the balls around hand and fingers, if these took the free path."""
    shape = task.planner.settings.shape
    poses = zip(shape.points(task.path)[:, None], task.time_s.tolist(), strict=True)
    return min(float(distances([body], points_m, shape.radii_m, time_s).min()) for points_m, time_s in poses)


def run(task: Task, seed: int) -> Trial:
    """One trial in the simulator."""
    body, ends = sphere(task, seed), (task.path[:1], task.path[-1:])
    controller = GeodesicController(task.planner, *ends, task.pace, ControllerSettings(1 / CONTROL_HZ))
    pilot = Pilot([controller], [body])
    with ArmScene(panda_arm()) as scene:
        scene.add_obstacle(body.name, body.body)
        for piece in scene.obstacles[body.name].pieces:
            scene.client.setCollisionFilterGroupMask(piece, -1, 0, 0)
        loop = closed_loop(
            scene,
            pilot,
            task.start_rad,
            LASTS * task.time_s[-1],
            CONTROL_HZ,
            motions={body.name: body.motion.offset},
        )
    clearance_m = min(loop.tracking.smallest_clearance_m[link] for link in PROTECTED)
    touched = tuple(loop.tracking.contact_steps.get(body.name, {}))
    milliseconds = tuple(1e3 * one for one in pilot.seconds)
    return Trial(seed, touched, clearance_m, unaware_m(task, body), pilot.reached_goal, pilot.waited_s, milliseconds)


def summary(trials: list[Trial]) -> str:
    """Contacts by link, room, arrival and times."""
    count = len(trials)
    by_link = Counter(link for trial in trials for link in trial.touched)
    of_hand = sum(any(link in PROTECTED for link in trial.touched) for trial in trials)
    of_arm = sum(any(link not in PROTECTED for link in trial.touched) for trial in trials)
    room_mm = 1e3 * np.array([trial.clearance_m for trial in trials])
    waited_s = np.array([trial.waited_s for trial in trials])
    replanning = np.concatenate([trial.replanning_ms for trial in trials])
    unaware = sum(trial.unaware_m < 0 for trial in trials)
    rows = [
        ("aimed well", f"{unaware} of {count} would come into the balls around the hand on the free path"),
        ("contact of hand or fingers", f"{of_hand} of {count} trials"),
        ("contact of another link", f"{of_arm} of {count} trials"),
        ("  by link", ", ".join(f"{link}: {number}" for link, number in sorted(by_link.items())) or "none"),
        ("smallest clearance of the hand", f"{room_mm.min():.1f} mm; of one trial in ten below "
                                           f"{np.percentile(room_mm, 10):.1f} mm"),
        ("arrived", f"{sum(trial.arrived for trial in trials)} of {count}"),
        ("waited", f"{waited_s.mean():.2f} s on average, {waited_s.max():.2f} s at most, "
                   f"{(waited_s > 0).sum()} trials at all"),
        ("replanning", f"{np.median(replanning):.1f} ms median, {np.percentile(replanning, 90):.1f} ms p90, "
                       f"{len(replanning) / count:.0f} times a trial"),
    ]  # fmt: skip
    return "\n".join(f"{name:<32}{value}" for name, value in rows)


def main() -> None:
    torch.set_num_threads(1)
    count = int(sys.argv[1]) if len(sys.argv) > 1 else TRIALS
    task, begun, trials = make_task(), time.perf_counter(), []
    print(f"A moving sphere, {count} seeded trials of {LASTS * task.time_s[-1]:.1f} s")
    for seed in range(count):
        trials.append(run(task, seed))
        if trials[-1].touched or not trials[-1].arrived:
            outcome = "arrived" if trials[-1].arrived else "not arrived"
            print(f"  seed {seed}: {outcome}, touched {', '.join(trials[-1].touched) or 'nothing'}", flush=True)
    print(summary(trials))
    print(f"{'took':<32}{time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
