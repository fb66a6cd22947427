"""Probabilistic movement primitives: a planner, which knows whole motions and no velocities of states."""

import numpy as np
import torch
from movement_primitives.promp import ProMP
from torch import nn

from geomotion.errors import InvalidSetting
from geomotion.types import Curves, Float, State, Tensor, Trajectories, Velocity

START_VARIANCE = 1e-8  # of a given start, in units of the data
UNKNOWN_VARIANCE = 1e6
PHASES = 200  # of each demonstration
SHORTEST = 1e-3  # duration that a motion is planned for, in time units
WEIGHT_VARIANCE = 1e-4  # of each weight by itself, so that motions also begin where no mixture of demonstrations does
RIDGE = 1e-6  # of the regression of weights


class MovementPrimitive(nn.Module):
    """A Gaussian distribution of motions, conditioned on where one starts.

    The duration of a motion belongs to the distribution as a further coordinate, which stays the same: motions take as
    long as those that start alike. From its end on, a motion stays where it is.

    Args:
        dim: D.
        weights: Basis functions of each coordinate.

    Source: Paraschos, Daniel, Peters and Neumann, 2013; the library movement_primitives.
    """

    is_plan = True
    claim = (
        "A movement primitive is a plan for each start, a function of time. It has no velocity of a state, so "
        "contraction is neither claimed nor measured, and after a disturbance it has to be planned anew."
    )

    def __init__(self, dim: int, weights: int) -> None:
        super().__init__()
        self.dim = dim
        self.weights = weights
        size = weights * (dim + 1)
        self.mean = nn.Parameter(torch.zeros(size), requires_grad=False)
        self.covariance = nn.Parameter(torch.zeros(size, size), requires_grad=False)

    def forward(self, z: State) -> Velocity:
        expected = "a field with velocities; a movement primitive plans whole motions, for `train` and `eval` alone"
        raise InvalidSetting("field", "movement_primitive", expected)

    def start_from(self, times: Curves, states: Curves, velocities: Curves) -> None:
        """Fit the distribution to demonstrations: mean and covariance of the weights of each."""
        primitive = ProMP(self.dim + 1, self.weights)
        weights = []
        for time, curve in zip(times, states, strict=True):
            own = time.double().numpy() / float(time[-1])
            columns = [np.interp(_phases(), own, column) for column in curve.double().numpy().T]
            motion = np.stack([*columns, np.full(PHASES, float(time[-1]))], axis=-1)
            weights.append(primitive.weights(_phases(), motion, lmbda=RIDGE))
        deviation = np.stack(weights) - np.mean(weights, axis=0)
        self.mean.copy_(torch.as_tensor(np.mean(weights, axis=0)))
        covariance = deviation.T @ deviation / len(weights) + WEIGHT_VARIANCE * np.eye(deviation.shape[1])
        self.covariance.copy_(torch.as_tensor(covariance))

    def solve(self, start: State, times: Float[Tensor, "*#batch time"]) -> Trajectories:
        """Mean motions from given starts, shape (*batch, time, D)."""
        starts = start.detach().reshape(-1, self.dim).double().numpy()
        wanted = times.detach().double().expand(*start.shape[:-1], -1).reshape(len(starts), -1).numpy()
        motions = np.stack([self._motion(one, own) for one, own in zip(starts, wanted, strict=True)])
        return torch.as_tensor(motions).to(start).view(*start.shape[:-1], -1, self.dim)

    def _motion(self, start: Float[np.ndarray, " D"], times: Float[np.ndarray, " time"]) -> Float[np.ndarray, "time D"]:
        primitive = ProMP(self.dim + 1, self.weights)
        primitive.from_weight_distribution(self.mean.double().numpy(), self.covariance.double().numpy())
        variance = np.diag([START_VARIANCE] * self.dim + [UNKNOWN_VARIANCE])
        conditioned = primitive.condition_position(np.append(start, 0.0), variance, t=0.0, t_max=1.0)
        # the library takes the largest of the times for the end of the motion: it is asked for the whole
        motion = conditioned.mean_trajectory(_phases())
        shares = times / max(motion[0, -1], SHORTEST)
        return np.stack([np.interp(shares, _phases(), column) for column in motion.T[:-1]], axis=-1)


def _phases() -> Float[np.ndarray, " phase"]:
    return np.linspace(0.0, 1.0, PHASES)  # a new one each time, because the library divides in place
