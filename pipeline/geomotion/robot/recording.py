"""What is written down while the simulated arm moves."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.robot.film import Film
from geomotion.robot.scene import ArmScene
from geomotion.robot.self_collision import Pair
from geomotion.types import Float

Times = Float[np.ndarray, " time"]
Joints = Float[np.ndarray, "time joint"]
Positions = Float[np.ndarray, "time 3"]
Quaternions = Float[np.ndarray, "time 4"]
Motions = Mapping[str, Callable[[float], Float[np.ndarray, "3"]]]

AT_REST: Motions = {}
MAX_CLEARANCE_M = 0.1
CLEARANCE_EVERY = 8  # steps, so 30 times a second


@dataclass(frozen=True)
class Tracking:
    """What the arm did, at 240 Hz from the first step on, and what it should have done at the same times.

    Attributes:
        time_s: [s].
        joints_rad: Measured [rad].
        commanded_joints_rad: [rad].
        position_m: Measured position of the tip [m].
        orientation_wxyz: Measured orientation.
        position_error_m: Distance to the commanded position [m].
        orientation_error_rad: Angle to the commanded orientation [rad].
        limit_margin_rad: Distance of the measured joint closest to a position limit [rad]; infinite without limits.
        clearance_time_s: When clearances were taken [s].
        clearance_m: For each link, and the grasped object, the distance to the nearest obstacle, 0.1 m if farther [m].
        self_clearance_m: Smallest distance of links of the arm that can collide [m], of those that come within 0.1 m.
        contact_steps: Obstacle or "table" -> link -> number of steps in which they touched; no entry without contact.
    """

    time_s: Times
    joints_rad: Joints
    commanded_joints_rad: Joints
    position_m: Positions
    orientation_wxyz: Quaternions
    position_error_m: Times
    orientation_error_rad: Times
    limit_margin_rad: Times
    clearance_time_s: Float[np.ndarray, " sample"]
    clearance_m: dict[str, Float[np.ndarray, " sample"]]
    self_clearance_m: dict[Pair, float]
    contact_steps: dict[str, dict[str, int]]

    @property
    def smallest_clearance_m(self) -> dict[str, float]:
        """For each link and the grasped object, over the motion [m]."""
        return {name: float(distances.min()) for name, distances in self.clearance_m.items()}


@dataclass
class Recorder:
    """Takes down each step of a simulation.

    Attributes:
        scene: What is simulated.
        motions: Obstacle -> its offset [m] at a time [s]; the others rest.
        film: Takes pictures, if given.
    """

    scene: ArmScene
    motions: Motions
    film: Film | None
    _rows: list[tuple[float, Float[np.ndarray, " joint"], Float[np.ndarray, " joint"]]] = field(default_factory=list)
    _poses: list[tuple[Float[np.ndarray, "3"], Float[np.ndarray, "4"]]] = field(default_factory=list)
    _clearances: list[tuple[float, dict[str, float]]] = field(default_factory=list)
    _self_clearances: dict[Pair, float] = field(default_factory=dict)
    _contacts: dict[str, Counter[str]] = field(default_factory=dict)

    def prepare(self, time_s: float) -> None:
        """Put the moving obstacles where they are at a time [s]."""
        for name, offset_m in self.motions.items():
            self.scene.move_obstacle(name, offset_m(time_s))

    def note(self, time_s: float, commanded_rad: Float[np.ndarray, " joint"]) -> None:
        """Take down the scene at a time [s], and where the joints should be [rad]."""
        scene = self.scene
        if len(self._rows) % CLEARANCE_EVERY == 0:
            self._clearances.append((time_s, scene.clearances(MAX_CLEARANCE_M)))
            for pair, apart_m in scene.self_clearances(MAX_CLEARANCE_M).items():
                self._self_clearances[pair] = min(apart_m, self._self_clearances.get(pair, np.inf))
        self._rows.append((time_s, scene.joints()[0], commanded_rad))
        self._poses.append(scene.end_effector_pose())
        for solid, links in scene.touching().items():
            counts = self._contacts.setdefault(solid, Counter())
            counts.update(links)
        if self.film is not None:
            self.film.watch(scene, time_s)

    def tracking(self) -> Tracking:
        """Everything that was taken down."""
        times, joints, commanded = (np.array(column) for column in zip(*self._rows, strict=True))
        positions, quaternions = (np.array(column) for column in zip(*self._poses, strict=True))
        wanted_m, wanted_wxyz = self.scene.arm.chain.pose(commanded)
        turns = (
            Rotation.from_quat(wanted_wxyz, scalar_first=True)
            * Rotation.from_quat(quaternions, scalar_first=True).inv()
        )
        return Tracking(
            time_s=times,
            joints_rad=joints,
            commanded_joints_rad=commanded,
            position_m=positions,
            orientation_wxyz=quaternions,
            position_error_m=np.linalg.norm(wanted_m - positions, axis=1),
            orientation_error_rad=turns.magnitude(),
            limit_margin_rad=self.scene.arm.limits.margin_rad(joints),
            clearance_time_s=np.array([time for time, _ in self._clearances]),
            clearance_m={
                name: np.array([found[name] for _, found in self._clearances]) for name in self.scene.body_names
            },
            self_clearance_m=dict(self._self_clearances),
            contact_steps={solid: dict(counts) for solid, counts in self._contacts.items()},
        )
