"""Shape names used in every signature of the library (checked by beartype in the tests)."""

from collections.abc import Sequence

from jaxtyping import Bool, Float, Int
from torch import Tensor

__all__ = [
    "Bool",
    "Curves",
    "Float",
    "Int",
    "Latent",
    "Matrix",
    "State",
    "States",
    "Tensor",
    "Times",
    "Trajectories",
    "Velocity",
]

State = Float[Tensor, "*batch D"]  # robot coordinates [m] unless a docstring says otherwise
Velocity = Float[Tensor, "*batch D"]  # [m/s]
Latent = Float[Tensor, "*batch d"]  # coordinates of a chart [-], as many as the state has or fewer
Matrix = Float[Tensor, "*batch D D"]
States = Float[Tensor, "point D"]
Times = Float[Tensor, " time"]  # [s], increasing
Trajectories = Float[Tensor, "*batch time D"]
Curves = Sequence[Float[Tensor, "..."]]  # one entry for each demonstration
