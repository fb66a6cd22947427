"""Paths of an arm's joints, scores of them against demonstrations, and a baseline for them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from geomotion.errors import InvalidSetting
from geomotion.scores.curves import dtwd_per_point
from geomotion.scores.paths import LEVER_M, MotionPath, Orientations, PosePath, Positions, of_one_sign

Joints = Float[np.ndarray, "state joint"]
Kinematics = Callable[[Joints], tuple[Positions, Orientations]]
"""Joint positions [rad] → positions [m] and orientations (wxyz) of the end effector."""
Leading = Callable[[Joints, Positions, Orientations], Joints]
"""Joint positions that nearly take poses → joint positions that do."""
LEAF = 32  # configurations; for thousands of queries in a row faster than the usual 16


@dataclass(frozen=True)
class ConfigurationPath:
    """Configurations of an arm in the order in which they are passed; a :class:`geomotion.scores.paths.MotionPath`.

    Joints are taken as coordinates of a vector space: a turn by 2π is another configuration, as it is for an arm with
    limits.

    Attributes:
        joints_rad: [rad].
        kinematics: Where the end effector is.
        leading: Brings the end effector to poses nearby; None where the arm has too few joints for that.

    Raises:
        InvalidSetting: If there is no configuration.
    """

    joints_rad: Joints
    kinematics: Kinematics = field(repr=False, compare=False)
    leading: Leading | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        if len(self) == 0:
            raise InvalidSetting("path", "no configuration", "one configuration or more")

    def __len__(self) -> int:
        return len(self.joints_rad)

    def __getitem__(self, part: slice) -> "ConfigurationPath":
        """Part of the path; ``path[:1]`` is its first configuration."""
        return self.with_vectors(self.joints_rad[part])

    @cached_property
    def _end_effector(self) -> tuple[Positions, Orientations]:
        position_m, orientation = self.kinematics(self.joints_rad)
        return position_m, of_one_sign(orientation)

    @property
    def position_m(self) -> Positions:
        """Of the end effector [m]."""
        return self._end_effector[0]

    @property
    def orientation(self) -> Orientations:
        """Of the end effector, wxyz."""
        return self._end_effector[1]

    @property
    def vectors(self) -> Joints:
        """Joint positions [rad]."""
        return self.joints_rad

    def with_vectors(self, values: Float[np.ndarray, "other_state joint"]) -> "ConfigurationPath":
        """Other configurations of the same arm."""
        return ConfigurationPath(values, self.kinematics, self.leading)

    @property
    def hand(self) -> PosePath:
        """Poses of the end effector."""
        return PosePath(*self._end_effector)

    def led_along(self, hand: PosePath) -> "ConfigurationPath":
        """Configurations near these whose end effector takes poses; these themselves, if the arm cannot be led."""
        if self.leading is None:
            return self
        return self.with_vectors(self.leading(self.joints_rad, hand.position_m, hand.orientation))

    def with_signs_of(self, known: "ConfigurationPath") -> "ConfigurationPath":
        """As it is: a configuration is one vector only."""
        return self

    def resampled(self, count: int) -> "ConfigurationPath":
        """Interpolated at equal shares of the duration."""
        shares, wanted = np.linspace(0, 1, len(self)), np.linspace(0, 1, count)
        return self.with_vectors(np.stack([np.interp(wanted, shares, joint) for joint in self.joints_rad.T], axis=1))

    def residuals(self, other: "ConfigurationPath") -> tuple[Float[np.ndarray, " state"], Float[np.ndarray, " state"]]:
        """Distances of end effectors [m] and of joint vectors [rad], configuration by configuration."""
        apart_m = np.linalg.norm(self.position_m - other.position_m, axis=1)
        return apart_m, np.linalg.norm(self.joints_rad - other.joints_rad, axis=1)

    def steps_m(self) -> Float[np.ndarray, " step"]:
        """Lengths of the steps [m]: of the end effector, joints counted by a lever."""
        turned_rad = np.linalg.norm(np.diff(self.joints_rad, axis=0), axis=1)
        return np.asarray(np.hypot(np.linalg.norm(np.diff(self.position_m, axis=0), axis=1), LEVER_M * turned_rad))


class ConfigurationSupport:
    """The demonstrated configurations; a :class:`geomotion.scores.pose_support.Support`.

    Args:
        joints_rad: [rad].
        position_m: Where the end effector is then [m].
    """

    def __init__(self, joints_rad: Joints, position_m: Positions) -> None:
        self.joints, self.tree = cKDTree(joints_rad, leafsize=LEAF), cKDTree(position_m, leafsize=LEAF)

    @classmethod
    def of(cls, demonstrations: Sequence[MotionPath]) -> "ConfigurationSupport":
        """All configurations of some demonstrations."""
        return cls(
            np.concatenate([demo.vectors for demo in demonstrations]),
            np.concatenate([demo.position_m for demo in demonstrations]),
        )

    def distances(self, path: MotionPath) -> tuple[Float[np.ndarray, " state"], Float[np.ndarray, " state"]]:
        """Distances of end effectors to the nearest demonstrated one [m], of joint vectors to the nearest [rad]."""
        return np.asarray(self.tree.query(path.position_m)[0]), np.asarray(self.joints.query(path.vectors)[0])

    def share_within(self, position_m: Positions, radius_m: float) -> float:
        """Share of the end effector's positions with a demonstrated one no farther than a radius."""
        distances, _ = self.tree.query(position_m)
        return float((distances <= radius_m).mean())


def joint_dtwd(path: ConfigurationPath, other: ConfigurationPath) -> float:
    """DTWD per point of joint positions [rad], as in :func:`geomotion.scores.curves.dtwd_per_point`.

    Source:
        Thesis Sec. 6.4, definition of DTWD.
    """
    return dtwd_per_point(path.joints_rad, other.joints_rad)


def mean_configurations_with_blended_ends(
    demonstrations: Sequence[ConfigurationPath], start: ConfigurationPath, goal: ConfigurationPath, count: int = 200
) -> ConfigurationPath:
    """The baseline: mean configuration of the demonstrations at equal shares of their durations, led to other ends.

    What is missing at the start fades out linearly over the path, and what is missing at the goal fades in.
    """
    mean = np.mean([demo.resampled(count).joints_rad for demo in demonstrations], axis=0)
    share = np.linspace(0, 1, count)[:, None]
    at_start, at_goal = start.joints_rad[0] - mean[0], goal.joints_rad[-1] - mean[-1]
    return start.with_vectors(mean + (1 - share) * at_start + share * at_goal)
