"""A sphere beside the arm: does a whole arm planned in joint space keep clear, and one planned for its hand alone?

Run as ``python benchmarks/whole_arm.py [free placements [blocked placements]]``; 20 and 6 by default, ``100 30`` for a
study. Two skills are learned from the same generated demonstrations, reaching to grasp with the elbow at three swivel
angles that share start and goal, with the default settings of `gms` and seed 0: one of configurations, which plans for
all links (``planning.tool=hand``), and one of poses, which plans for the hand and hands its path to inverse kinematics.
Both keep 1 cm. Inverse kinematics goes on from where the arm stands at the start; from the home configuration, or from
the branch that keeps farther from joint limits; or from random joint positions, at some poses of the path.

Every placement of a sphere of 5 cm radius has a seed. The query, start and goal of one of the three held-out
demonstrations, is seed modulo three. The demonstrations that were learned from are carried to its ends, as planning
carries the manifold, and the sphere is drawn near the elbow or forearm of one of them, in the middle of its way, again
and again until

* the balls around hand and fingers keep the clearance at every state of every demonstration,
* every link keeps it along at least one demonstration, by PyBullet's distances, looked at every 5 mm of travel, and
* elbow or forearm touch the sphere on at least one other, by PyBullet.

Placements that leave no demonstration are drawn near any point of the arm, until by PyBullet no demonstration keeps the
clearance with all links, while start and goal do. No placement is left out beyond that; those whose best
demonstration keeps 2.5 cm are counted a second time, because the balls that stand for the links in planning exceed them
by up to 1.5 cm. What is planned is judged by PyBullet's distances of all links. A way that is found where no
demonstration was free mixes demonstrated solutions; it is a success where PyBullet finds it free. One core.
"""

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from geomotion import config as schema
from geomotion.demos import storage
from geomotion.obstacles.motion import MovingBody
from geomotion.obstacles.solids import Sphere
from geomotion.planning.carrying import Offsets
from geomotion.planning.obstruction import Tool, distances
from geomotion.planning.plan import Plan
from geomotion.planning.planner import Planner
from geomotion.robot import panda
from geomotion.robot.arm_failures import arm_failures
from geomotion.robot.inverse_kinematics import solve_path, solve_pose
from geomotion.robot.panda_arm import panda_arm
from geomotion.robot.path_check import check_path
from geomotion.robot.scene import ArmScene
from geomotion.robot.whole_arm import WholeArm
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import MotionPath, PosePath
from geomotion.stages import planners
from geomotion.stages.gms_verbs import GMS
from geomotion.stages.graph import Skilled, load_skilled
from geomotion.stages.session import open_session
from geomotion.stages.states import state_paths

FREE, BLOCKED = 20, 6
RADIUS_M, CLEARANCE_M = 0.05, 0.01
MIDDLE = (0.25, 0.75)  # share of a demonstration at which the sphere is near the arm
ELBOW, WRIST = 3, 5  # points of the arm, between which the forearm lies
ELBOW_AND_FOREARM = ("panda_link3", "panda_link4", "panda_link5")
BESIDE_M = 0.12  # from the axis of the forearm to the centre of the sphere, at most
APART_M = 0.005  # between two looks at a demonstration
ROOMY_M = 0.025  # kept by demonstrations whose room is not used up by what the balls around links exceed them
BETWEEN_STATES_M = 0.01  # by which a link may come nearer between two states of a demonstration
RANDOM_AT, RANDOM_SOLUTIONS = 12, 20  # poses of a path of the hand, joint solutions of each
SPHERE = "sphere"
DATASET = "dataset=panda/reach_to_grasp_overlap"


@dataclass(frozen=True)
class Placement:
    """A sphere, and between which states the arm should move.

    Attributes:
        seed: Of the draw.
        query: Number of the held-out demonstration whose ends are asked for.
        centre_m: Of the sphere.
        draws: How many spheres were drawn.
        room_m: Distance that the best demonstration keeps, see :meth:`Demonstrated.best_room_m`.
    """

    seed: int
    query: int
    centre_m: np.ndarray
    draws: int
    room_m: float = np.nan

    @property
    def body(self) -> MovingBody:
        return MovingBody.at_its_velocity(SPHERE, Sphere(torch.from_numpy(self.centre_m), RADIUS_M))


@dataclass(frozen=True)
class Trial:
    """What came of one placement.

    Attributes:
        placement: Where the sphere was.
        plan: In joint space.
        seconds: That planning took.
        nearest_m: Smallest distance of a link to the sphere along the plan, by PyBullet; infinite without a plan.
        hand_planned: Whether task space had a path for the hand.
        touched: Links that touch the sphere on that path, by PyBullet, where inverse kinematics follows the branch of
            the home configuration that keeps farthest from the limits.
        touched_from_start: The same where it follows the arm from where it stands.
        worst_share: Of random joint solutions of a pose on that path, those that touch; at the worst pose.
    """

    placement: Placement
    plan: Plan
    seconds: float
    nearest_m: float
    hand_planned: bool
    touched: tuple[str, ...]
    touched_from_start: tuple[str, ...]
    worst_share: float


class Demonstrated:
    """Demonstrations carried to the ends of a query, and how near they come to spheres."""

    def __init__(self, skilled: Skilled, shape: WholeArm, wanted: ConfigurationPath, scene: ArmScene) -> None:
        self.shape, self.scene = shape, scene
        data = skilled.manifold.data
        self.paths = [
            Offsets.between(path, wanted, progress).carry(path, progress)
            for path, progress in zip(data.originals, data.progress, strict=True)
        ]
        self.ends = wanted.with_vectors(wanted.vectors[[0, -1]])
        hand = Tool(*panda.hand_balls("grasp_target"))
        self._hand_m, self._hand_radii_m = np.concatenate([hand.points(path) for path in self.paths]), hand.radii_m
        self._balls_m = np.stack([shape.points(path) for path in self.paths])
        chain, joints = shape.arm.chain, shape.arm.joint_points()
        self.points_m = np.stack([chain.points(path.vectors, joints) for path in self.paths])

    def hand_is_free(self, body: MovingBody) -> bool:
        """Whether the balls around the hand keep the clearance everywhere."""
        return bool(distances([body], self._hand_m, self._hand_radii_m, 0.0).min() >= CLEARANCE_M)

    def rooms_m(self, body: MovingBody) -> np.ndarray:
        """Distance of the balls around all links, at every state of every demonstration: never more than theirs."""
        return np.stack([distances([body], balls, self.shape.radii_m, 0.0)[0] for balls in self._balls_m])

    def nearest_m(self, path: ConfigurationPath, links: Sequence[str] = ()) -> float:
        """Smallest distance of links, of all if none is named, to the sphere where it stands; by PyBullet."""
        nearest_m = np.inf
        for joints_rad in self._finely(path):
            self.scene.set_joints(joints_rad)
            found = self.scene.clearances_from(SPHERE, BESIDE_M)
            nearest_m = min([nearest_m, *(apart for link, apart in found.items() if not links or link in links)])
        return nearest_m

    def _finely(self, path: ConfigurationPath) -> np.ndarray:
        """Joints along a path, between which no ball moves farther than 5 mm."""
        steps_m = np.linalg.norm(np.diff(self.shape.points(path), axis=0), axis=2).max(axis=1)
        counts = np.ceil(steps_m / APART_M).astype(int).clip(min=1)
        parts = [row + np.arange(n) / n for row, n in enumerate(counts.tolist())]
        places = np.concatenate([*parts, [len(counts)]])
        return np.stack([np.interp(places, np.arange(len(path)), joint) for joint in path.joints_rad.T], axis=1)

    def leaves_a_solution(self, body: MovingBody) -> bool:
        """Whether all links keep the clearance on one demonstration."""
        rooms_m = self.rooms_m(body)
        return any(self._keeps(one, rooms_m[one], CLEARANCE_M) for one in np.argsort(-rooms_m.min(axis=1)))

    def best_room_m(self, body: MovingBody) -> float:
        """Smallest distance of any link to the sphere, on the demonstration that keeps farthest from it; by PyBullet.

        Start and goal belong to all of them. Distances above 12 cm are not told apart.
        """
        rooms_m, best_m = self.rooms_m(body).min(axis=1), 0.0
        for number in np.argsort(-rooms_m):
            best_m = max(best_m, self.nearest_m(self.paths[number]))
            if best_m >= ROOMY_M:
                break
        return best_m

    def blocks_an_elbow(self, body: MovingBody) -> bool:
        """Whether elbow or forearm touch the sphere on one demonstration."""
        rooms_m = self.rooms_m(body)
        return any(
            not self._keeps(one, rooms_m[one], 0.0, ELBOW_AND_FOREARM) for one in np.argsort(rooms_m.min(axis=1))
        )

    def _keeps(self, number: int, rooms_m: np.ndarray, wanted_m: float, links: Sequence[str] = ()) -> bool:
        """Whether links keep a distance on a demonstration; only where the balls come nearer is it looked at."""
        near = np.flatnonzero(rooms_m < wanted_m + BETWEEN_STATES_M)
        if len(near) == 0:
            return True
        part = slice(max(near[0] - 1, 0), near[-1] + 2)
        return self.nearest_m(self.paths[number][part], links) >= wanted_m


def skill(*overrides: str) -> tuple[Skilled, list]:
    """A skill with its decoded grid, and the states of all demonstrations, as `gms graph` makes them."""
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        composed = compose("gms", overrides=[DATASET, *overrides])
    with tempfile.TemporaryDirectory() as folder:
        config: schema.GmsConfig = OmegaConf.to_object(composed)
        config.tracking.root = folder
        with open_session(GMS, "graph", config, []) as session:
            done = {name: session.produce(name) for name in ("ingest", "train", "graph")}
            skilled, demonstrations = load_skilled(done, config.metric), storage.load(done["ingest"].folder)
    return skilled, state_paths(demonstrations, skilled.skill.config.points, skilled.skill.arm)


def planner_of(skilled: Skilled) -> Planner:
    """For the whole arm, or for the hand."""
    planning = schema.PlanningConfig(tool=schema.ToolShape.hand, clearance_m=CLEARANCE_M)
    return planners.planner(skilled, planning, schema.EndEffectorFrame.grasp_target)


class Placements:
    """Draws spheres, and looks in the simulator what they do to demonstrations.

    Args:
        skilled: Of configurations.
        shape: The whole arm.
        asked: Demonstrations whose ends are asked for.
    """

    def __init__(self, skilled: Skilled, shape: WholeArm, asked: Sequence[ConfigurationPath]) -> None:
        self.scene = ArmScene(panda_arm())
        self.scene.add_obstacle(SPHERE, Sphere(torch.zeros(3, dtype=torch.float64), RADIUS_M))
        self.demonstrated = [Demonstrated(skilled, shape, one, self.scene) for one in asked]

    def place(self, seed: int, leaves_a_solution: bool, query: int | None = None) -> Placement:
        """The first sphere of a seeded row that is as the protocol says."""
        draw = np.random.default_rng((seed, leaves_a_solution))
        number = seed % len(self.demonstrated) if query is None else query
        demonstrated, draws = self.demonstrated[number], 0
        while True:
            draws += 1
            found = Placement(seed, number, self._near_the_arm(demonstrated, draw, leaves_a_solution), draws)
            self.scene.move_obstacle(SPHERE, found.centre_m)
            if (self._is_free if leaves_a_solution else self._is_blocked)(demonstrated, found.body):
                return replace(found, room_m=demonstrated.best_room_m(found.body))

    def _near_the_arm(self, demonstrated: Demonstrated, draw: np.random.Generator, is_of_elbow: bool) -> np.ndarray:
        points_m = demonstrated.points_m[draw.integers(len(demonstrated.points_m))]
        places_m = points_m[int(draw.uniform(*MIDDLE) * len(points_m))]
        first = ELBOW if is_of_elbow else int(draw.integers(ELBOW, len(places_m) - 1))
        last = WRIST if is_of_elbow else first + 1
        beside = draw.normal(size=3)
        beside *= BESIDE_M * draw.uniform() / np.linalg.norm(beside)
        return places_m[first] + draw.uniform() * (places_m[last] - places_m[first]) + beside

    def _is_free(self, demonstrated: Demonstrated, body: MovingBody) -> bool:
        return (
            demonstrated.hand_is_free(body)
            and demonstrated.blocks_an_elbow(body)
            and demonstrated.leaves_a_solution(body)
        )

    def _is_blocked(self, demonstrated: Demonstrated, body: MovingBody) -> bool:
        if any(demonstrated.nearest_m(end) < CLEARANCE_M for end in (demonstrated.ends[:1], demonstrated.ends[1:])):
            return False
        return not demonstrated.leaves_a_solution(body)


class Study:
    """Two planners, and a simulator that judges them.

    Args:
        placements: Spheres and the simulator.
        whole_arm: Plans configurations.
        of_hand: Plans poses.
        asked: Demonstrations whose ends are asked for.
    """

    def __init__(
        self, placements: Placements, whole_arm: Planner, of_hand: Planner, asked: Sequence[ConfigurationPath]
    ) -> None:
        self.placements, self.whole_arm, self.of_hand, self.asked = placements, whole_arm, of_hand, asked
        self.queries = [whole_arm.query(one[:1], one[-1:]) for one in asked]

    def run(self, placement: Placement) -> Trial:
        """Plan in both spaces, and look at the paths in the simulator."""
        body, query, asked = placement.body, self.queries[placement.query], self.asked[placement.query]
        self.placements.scene.move_obstacle(SPHERE, placement.centre_m)
        begun = time.perf_counter()
        plan = self.whole_arm.plan(query, [body])
        seconds = time.perf_counter() - begun
        nearest_m = np.inf
        if plan.path is not None:
            found = check_path(self.placements.scene, plan.path.states.vectors).clearances
            nearest_m = min((one.distance_m for one in found), default=np.inf)
        hand = self._path_of_hand(asked, body)
        if hand is None:
            return Trial(placement, plan, seconds, nearest_m, False, (), (), np.nan)
        return Trial(placement, plan, seconds, nearest_m, True, *self._behind(hand, asked))

    def _path_of_hand(self, asked: ConfigurationPath, body: MovingBody) -> MotionPath | None:
        ends = PosePath(asked.position_m, asked.orientation)
        plan = self.of_hand.plan(self.of_hand.query(ends[:1], ends[-1:]), [body])
        return None if plan.path is None else plan.path.states

    def _behind(self, hand: MotionPath, asked: ConfigurationPath) -> tuple[tuple[str, ...], tuple[str, ...], float]:
        """Links that touch on the arm's way from home's branch, and from where it stands; worst share at random."""
        touched = []
        for joints_rad in (solve_path(hand.position_m, hand.orientation).joints_rad, followed(hand, asked)):
            found = check_path(self.placements.scene, joints_rad, up_to_m=CLEARANCE_M).clearances
            touched.append(tuple(one.bodies[0] for one in found if one.distance_m < 0))
        some = hand.resampled(RANDOM_AT)
        random = arm_failures(self.placements.scene, some.position_m, some.orientation, RANDOM_SOLUTIONS)
        return touched[0], touched[1], float(np.nanmax(random.share))


def followed(hand: MotionPath, asked: ConfigurationPath) -> np.ndarray:
    """Joint positions for a path of the hand, each searched from the one before, the first from the arm's start."""
    joints = [asked.joints_rad[0]]
    for position_m, orientation in zip(hand.position_m, hand.orientation, strict=True):
        joints.append(solve_pose(position_m, orientation, joints[-1]).joints_rad[0])
    return np.stack(joints[1:])


def summary(trials: Sequence[Trial], *, free: bool) -> list[tuple[str, str]]:
    """Rows of the table."""
    count = len(trials)
    found = [trial for trial in trials if trial.plan.found]
    roomy = [trial for trial in trials if trial.placement.room_m >= ROOMY_M]
    kept = [trial for trial in found if trial.nearest_m >= CLEARANCE_M]
    nearest = f"; nearest {min(1e3 * trial.nearest_m for trial in found):.1f} mm" if found else ""
    seconds = np.array([trial.seconds for trial in trials])
    others = Counter(trial.plan.status.name for trial in trials if not trial.plan.found)
    of_hand = [trial for trial in trials if trial.hand_planned]
    by_link = Counter(link for trial in of_hand for link in trial.touched_from_start)
    shares = [trial.worst_share for trial in of_hand] or [np.nan]
    rows = [
        ("joint space: planned", f"{len(found)} of {count}"),
        (f"  where {1e3 * ROOMY_M:.0f} mm are free", f"{sum(one.plan.found for one in roomy)} of {len(roomy)}"),
        ("  every link keeps 1 cm", f"{len(kept)} of {len(found)}{nearest}"),
        ("  not planned", ", ".join(f"{name}: {number}" for name, number in others.items()) or "none"),
        ("  time of a plan", f"{np.median(seconds):.2f} s median, {np.percentile(seconds, 90):.2f} s p90"),
        ("task space: hand planned", f"{len(of_hand)} of {count}"),
        ("  arm touches the sphere", f"{sum(bool(trial.touched_from_start) for trial in of_hand)} of {len(of_hand)}, "
                                     f"{sum(bool(trial.touched) for trial in of_hand)} from home's branch"),
        ("  of random solutions", f"{np.mean(shares):.0%} at the worst pose of a path on average, "
                                  f"{max(shares):.0%} at most"),
        ("  links that touch", ", ".join(f"{link}: {number}" for link, number in sorted(by_link.items())) or "none"),
    ]  # fmt: skip
    return rows if free else [rows[0], *rows[2:5]]


def main() -> None:
    torch.set_num_threads(1)
    counts = [int(one) for one in sys.argv[1:]]
    free, blocked = (*counts, *(FREE, BLOCKED)[len(counts) :])
    skilled, paths = skill()
    asked = [paths[number] for number in skilled.skill.test_demos]
    whole_arm = planner_of(skilled)
    placements = Placements(skilled, whole_arm.settings.shape, asked)
    study = Study(placements, whole_arm, planner_of(skill("space=pose")[0]), asked)
    for count, is_free in ((free, True), (blocked, False)):
        begun, trials = time.perf_counter(), []
        kind = "leave a demonstrated solution" if is_free else "leave none"
        print(f"\n{count} spheres that {kind}")
        for seed in range(count):
            trials.append(study.run(placements.place(seed, is_free)))
            if trials[-1].plan.found != is_free:
                print(f"  seed {seed}: {trials[-1].plan.reason}", flush=True)
        for name, value in summary(trials, free=is_free):
            print(f"{name:<28}{value}")
        print(f"{'took':<28}{time.perf_counter() - begun:.0f} s", flush=True)


if __name__ == "__main__":
    main()
