"""A vector field as a policy of an arm: what its states are made of, and what its velocities ask for."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from geomotion.dynamics.fields import TimedVelocity
from geomotion.lie.poses import PoseCoordinates
from geomotion.robot.disturbances import Measured
from geomotion.robot.resolved_rate import Joints, TipVelocity
from geomotion.types import Float, Tensor

STRAIGHTENING_PER_S = 4.0  # rate at which an orientation that the state says nothing of is restored

Quaternion = Float[np.ndarray, "4"]
Poses = tuple[Float[np.ndarray, "point 3"], Float[np.ndarray, "point 4"]]


@runtime_checkable
class ArmStates(Protocol):
    """What states of a field are on an arm."""

    def state(self, measured: Measured) -> Float[np.ndarray, " D"]:
        """The state of an arm."""
        ...

    def command(
        self, x: Float[np.ndarray, " D"], velocity: Float[np.ndarray, " D"], measured: Measured
    ) -> TipVelocity | Joints:
        """What a velocity of the state asks the arm for."""
        ...


@dataclass
class PoseStates:
    """Vectors of poses of the tip.

    Attributes:
        coordinates: Of the poses.
        orientation_wxyz: At the start: from one measurement to the next, the sign of a quaternion does not change.
    """

    coordinates: PoseCoordinates
    orientation_wxyz: Quaternion

    def state(self, measured: Measured) -> Float[np.ndarray, "6"]:
        sign = np.copysign(1.0, measured.orientation_wxyz @ self.orientation_wxyz)
        self.orientation_wxyz = sign * measured.orientation_wxyz
        place = torch.from_numpy(measured.position_m), torch.from_numpy(self.orientation_wxyz)
        return np.asarray(self.coordinates.to_vector(*place).numpy())

    def command(self, x: Float[np.ndarray, "6"], velocity: Float[np.ndarray, "6"], measured: Measured) -> TipVelocity:
        twist = self.coordinates.twist(torch.from_numpy(x), torch.from_numpy(velocity))
        return TipVelocity(twist.velocity.numpy(), twist.omega.numpy())

    def poses(self, states: Float[np.ndarray, "point 6"]) -> Poses:
        """Positions [m] and orientations (wxyz)."""
        position, orientation = self.coordinates.to_pose(torch.from_numpy(states))
        return position.numpy(), orientation.numpy()


@dataclass(frozen=True)
class PositionStates:
    """Positions of the tip, whose orientation is held.

    Attributes:
        orientation_wxyz: Held.
    """

    orientation_wxyz: Quaternion

    def state(self, measured: Measured) -> Float[np.ndarray, "3"]:
        return measured.position_m

    def command(self, x: Float[np.ndarray, "3"], velocity: Float[np.ndarray, "3"], measured: Measured) -> TipVelocity:
        wanted = Rotation.from_quat(self.orientation_wxyz, scalar_first=True)
        turn = wanted * Rotation.from_quat(measured.orientation_wxyz, scalar_first=True).inv()
        return TipVelocity(velocity, STRAIGHTENING_PER_S * turn.as_rotvec())

    def poses(self, states: Float[np.ndarray, "point 3"]) -> Poses:
        """Positions [m] and orientations (wxyz)."""
        return states, np.tile(self.orientation_wxyz, (len(states), 1))


@dataclass(frozen=True)
class JointStates:
    """Positions of the joints."""

    def state(self, measured: Measured) -> Joints:
        return measured.joints_rad

    def command(self, x: Joints, velocity: Joints, measured: Measured) -> Joints:
        return velocity


@dataclass(frozen=True)
class FieldPolicy:
    """ẋ = f(x, t) on an arm, Algorithm 2 of the thesis.

    Attributes:
        field: f.
        states: What x is.
        dtype: Precision in which f is evaluated.
    """

    field: TimedVelocity
    states: ArmStates
    dtype: torch.dtype = torch.float32

    @torch.no_grad()
    def __call__(self, measured: Measured, time_s: float) -> TipVelocity | Joints:
        """Velocity of the tip, or of the joints, at a time since the start [s]."""
        x = self.states.state(measured)
        elapsed_s: Tensor = torch.tensor([time_s], dtype=self.dtype)
        velocity = self.field.velocity(torch.tensor(x, dtype=self.dtype), elapsed_s)
        return self.states.command(x, velocity.double().numpy(), measured)
