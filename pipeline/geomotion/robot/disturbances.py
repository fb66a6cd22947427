"""What goes wrong around an arm: somebody pushes it, sensors are noisy, and what they say comes late."""

from collections import deque
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.types import Float

Vector = Float[np.ndarray, "3"]
Profile = Literal["constant", "half_sine"]


@dataclass(frozen=True)
class Measured:
    """What a policy is told of the arm.

    Attributes:
        position_m: Of the tip, in the base frame.
        orientation_wxyz: A unit quaternion.
        joints_rad: Positions of the joints.
    """

    position_m: Vector
    orientation_wxyz: Float[np.ndarray, "4"]
    joints_rad: Float[np.ndarray, " joint"]


@dataclass(frozen=True)
class Push:
    """A force at the tip for a while.

    Attributes:
        time_s: When it begins.
        duration_s: How long it lasts.
        force_n: In the base frame; of a half sine, the largest.
        profile: How it changes meanwhile.
    """

    time_s: float
    duration_s: float
    force_n: Vector
    profile: Profile = "constant"

    @property
    def end_s(self) -> float:
        """When it is over."""
        return self.time_s + self.duration_s

    def force_at(self, time_s: float) -> Vector:
        """[N]; zero before and after."""
        share = (time_s - self.time_s) / self.duration_s
        if not 0 <= share < 1:
            return np.zeros(3)
        return self.force_n if self.profile == "constant" else np.sin(np.pi * share) * self.force_n


@dataclass(frozen=True)
class Displacement:
    """The tip is elsewhere from one moment to the next, its orientation kept.

    Attributes:
        time_s: When.
        offset_m: By how much, in the base frame.
    """

    time_s: float
    offset_m: Vector

    @property
    def end_s(self) -> float:
        """When it is over: at once."""
        return self.time_s


@dataclass
class Sensors:
    """Measurements with white noise, each handed on some control periods late.

    Attributes:
        position_std_m: Standard deviation of each coordinate of the position.
        angle_std_rad: The same of each coordinate of a small rotation, and of each joint.
        late_periods: How many periods old what is handed on is.
        seed: Of the noise.
    """

    position_std_m: float = 0.0
    angle_std_rad: float = 0.0
    late_periods: int = 0
    seed: int = 0
    _waiting: deque[Measured] = field(default_factory=deque)

    def __post_init__(self) -> None:
        self._generator = np.random.default_rng(self.seed)

    def read(self, true: Measured) -> Measured:
        """What arrives in the period in which `true` is measured; at first, the first measurement."""
        self._waiting.append(self._noisy(true))
        return self._waiting.popleft() if len(self._waiting) > self.late_periods else self._waiting[0]

    def _noisy(self, true: Measured) -> Measured:
        draw = self._generator.normal
        turn = Rotation.from_rotvec(self.angle_std_rad * draw(size=3))
        turned = turn * Rotation.from_quat(true.orientation_wxyz, scalar_first=True)
        return Measured(
            true.position_m + self.position_std_m * draw(size=3),
            turned.as_quat(scalar_first=True),
            true.joints_rad + self.angle_std_rad * draw(size=len(true.joints_rad)),
        )
