"""Joints of an arm over the share of a path (Fig. 4.1, 4.8)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from geomotion.figures.style import COLOUR

NEARBY = 0.5  # of the shown range: limits farther from what is shown are left out
LIMIT: dict[str, Any] = {"color": COLOUR["euclidean"], "linewidth": 0.5, "linestyle": "-.", "zorder": 1}
JOINTS_PER_ROW, JOINT_MM = 4, 40.0


@dataclass(frozen=True)
class JointAxes:
    """What is known of joints.

    Attributes:
        names: As the URDF has them.
        lower_rad: Smallest positions [rad]; may be infinite.
        upper_rad: Largest positions [rad]; may be infinite.
    """

    names: tuple[str, ...]
    lower_rad: Float[np.ndarray, " joint"]
    upper_rad: Float[np.ndarray, " joint"]

    def near(self, joint: int, shown_rad: Sequence[Float[np.ndarray, " _"]]) -> list[float]:
        """Limits of a joint that are not far from positions [rad]."""
        values = np.concatenate(shown_rad)
        room = NEARBY * np.ptp(values)
        limits = float(self.lower_rad[joint]), float(self.upper_rad[joint])
        return [limit for limit in limits if values.min() - room <= limit <= values.max() + room]


def rows_of(count: int) -> tuple[int, int]:
    """Rows and columns of panels for so many joints, as even as can be."""
    rows = -(-count // JOINTS_PER_ROW)
    return rows, -(-count // rows)


def label_joint(ax: Axes, joints: JointAxes, joint: int, shown_rad: Sequence[Float[np.ndarray, " _"]]) -> None:
    """Name the axes of a joint over the share of the path, and draw its limits where they are near."""
    for limit in joints.near(joint, shown_rad):
        ax.axhline(limit, **LIMIT)
    ax.set(xlabel="share of the path [1]", ylabel=f"{joints.names[joint]} [rad]")
    ax.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    ax.margins(x=0.01)
