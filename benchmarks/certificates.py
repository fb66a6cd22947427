"""Search for violations of what is claimed to hold by construction: every exactly contracting field, in every chart.

Run as ``python benchmarks/certificates.py [--draws N] [--states N]``, or ``make certify``; exits with 1 if there is a
violation. For random parameters of all sizes and random states, in double precision:

- *condition*: the largest eigenvalue of M⁻¹(MJ + JᵀM + Ṁ)/2 is at most -τ, with the Jacobian J of the field in the
  robot's coordinates and M = DψᵀDψ, all by automatic differentiation;
- *decay*: ‖ψ(x_t) - ψ(y_t)‖ ≤ e^{-τt} ‖ψ(x_0) - ψ(y_0)‖ for pairs along rollouts, in closed form where there is one,
  otherwise by RK4 with steps of `STEP` over the norm of the Jacobian at the starts.

An excess counts as a violation where it is larger than what rounding and the solver's own error explain. Where these
could hide the whole claim, because the parameters are extreme, nothing is decided; the table shows the share that does
decide. Draws are spread over all cores.
"""

import argparse
import math
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial, reduce
from itertools import product
from multiprocessing import get_context
from operator import add

import torch
from torch import Tensor

from geomotion import config as schema
from geomotion import models
from geomotion.dynamics.certificate import slowest_rate
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.rollout import rollout
from geomotion.models import ModelConfig
from geomotion.scores.jacobians import field_jacobian, generalised_jacobian, symmetric_eigenvalues
from geomotion.training.data import Geometry

DIMENSIONS = (2, 3, 8)
DRAWS, STATES, AT_ONCE = 20, 100_000, 5_000
FIELDS: dict[str, schema.FieldConfig] = {
    "linear": schema.LinearField(),
    "embedded": schema.LinearField(skill_dim=1),  # all other coordinates decay
    "potential": schema.PotentialField(),
}
CHARTS: dict[str, schema.ChartConfig] = {
    "identity": schema.IdentityChart(),
    "flow": schema.FlowChart(layers=4, features=16),
}
DURATION_S = 3.0
FIELD_DECADES, CHART_DECADES = (-2.0, 1.0), (-2.0, -0.5)  # of the parameters' standard deviations
ROUNDING = 100 * torch.finfo(torch.float64).eps  # allowed, relative to the sizes that may cancel
TIMES, SUBSTEPS, STEP = 5, 2, 0.05
MOST_ALLOWED = 0.01  # share of the bound; pairs whose rounding or solver error allows more decide nothing
SOLVER_SAFETY = 10.0  # allowed, times the difference that halving the step makes


@dataclass(frozen=True)
class Finding:
    """What one draw of parameters came to, or several.

    Attributes:
        count: States of the condition, or pairs at a time of the decay.
        deciding: How many of them rounding leaves open to a violation.
        worst: Largest excess over the claim among those [1/s for the condition, share of e^{-τt} for the decay].
        violations: How many excesses neither rounding nor the solver's error explains.
    """

    count: int
    deciding: int
    worst: float
    violations: int

    def __add__(self, other: "Finding") -> "Finding":
        worst = max(self.worst, other.worst)
        return Finding(
            self.count + other.count, self.deciding + other.deciding, worst, self.violations + other.violations
        )


def judged(excess: Tensor, unexplained: Tensor, deciding: Tensor) -> Finding:
    """Excesses over a claim, what remains of them after what is allowed, and which of them matter."""
    worst = float(excess[deciding].max()) if deciding.any() else -math.inf
    violations = ~(unexplained <= 0) & deciding  # an excess that is not a number is one, too
    return Finding(excess.numel(), int(deciding.sum()), worst, int(violations.sum()))


def draw(field: schema.FieldConfig, chart: schema.ChartConfig, dim: int, seed: int) -> ChartedField:
    """A model whose parameters are normal, each tensor with a size of its own, small to extreme."""
    origin = (0.0,) * dim
    config = ModelConfig(chart, field, schema.NoRegulariser(), seed)
    model = models.build(config, Geometry(origin, 1.0, origin, origin, DURATION_S)).double()
    generator = torch.Generator().manual_seed(seed)
    for part, (low, high) in ((model.field, FIELD_DECADES), (model.chart, CHART_DECADES)):
        for parameter in part.parameters():
            size = 10 ** (low + (high - low) * float(torch.rand((), generator=generator)))
            parameter.data.copy_(size * torch.randn(parameter.shape, generator=generator, dtype=torch.float64))
    return model.eval().requires_grad_(False)


def random_states(count: int, dim: int, seed: int) -> Tensor:
    """Normal, with spreads from a tenth of the demonstrations' size to its tenfold."""
    generator = torch.Generator().manual_seed(seed)
    spread = 10 ** (2 * torch.rand(count, 1, generator=generator, dtype=torch.float64) - 1)
    return spread * torch.randn(count, dim, generator=generator, dtype=torch.float64)


def condition(model: ChartedField, x: Tensor) -> Finding:
    """The differential condition at states."""
    rate = proven_rate(model)
    matrices, size = generalised_jacobian(model, model.chart, x)
    excess = symmetric_eigenvalues(matrices)[:, -1] + rate
    allowed = ROUNDING * size
    return judged(excess, excess - allowed, allowed < rate)


def decay(model: ChartedField, x: Tensor) -> Finding:
    """Distances of the first half of the states to the second half along rollouts, relative to the bound."""
    pairs = len(x) // 2
    if model.is_solvable:
        pace = torch.full((pairs,), DURATION_S, dtype=torch.float64)
    else:  # every pair at its own pace, as the stiffness of the field at its starts demands
        pace = STEP * SUBSTEPS * (TIMES - 1) / field_jacobian(model, x).norm(dim=(-2, -1)).view(2, pairs).amax(0)
    distance, size = _distances(model, x, pace, SUBSTEPS)
    change = 0 * distance if model.is_solvable else _distances(model, x, pace, 2 * SUBSTEPS)[0] - distance
    bound = torch.exp(-proven_rate(model) * pace[:, None] * _progress()) * distance[:, :1]
    excess = distance / bound - 1
    allowed = (SOLVER_SAFETY * change.abs() + ROUNDING * size) / bound
    return judged(excess[:, 1:], (excess - allowed)[:, 1:], (allowed < MOST_ALLOWED)[:, 1:])


def _distances(model: ChartedField, x: Tensor, pace: Tensor, substeps: int) -> tuple[Tensor, Tensor]:
    """Latent distances of pairs over time, and the size of what rounding acts on."""
    both = pace.repeat(2)[:, None]
    if model.is_solvable:
        states = model.solve(x, both * _progress())
    else:
        states = rollout(Paced(model, both), x, _progress(), substeps=substeps).states
    latent = model.chart.to_latent(states)
    jacobian = field_jacobian(model.chart.to_latent, states.flatten(0, 1))
    stretch, back = (
        matrix.norm(dim=(-2, -1)).view(states.shape[:2]) for matrix in (jacobian, torch.linalg.inv(jacobian))
    )
    first, second = latent.view(2, len(pace), *latent.shape[1:])
    # what rounding does to latent states goes through ψ⁻¹ and back, which a linear field's closed form does once each
    size = latent.norm(dim=-1) * (1 + stretch * back) + stretch * states.norm(dim=-1)
    return (first - second).norm(dim=-1), size.view(2, len(pace), -1).sum(0)


def _progress() -> Tensor:
    return torch.linspace(0, 1, TIMES, dtype=torch.float64)


@dataclass(frozen=True)
class Paced:
    """A field whose every trajectory has a time unit of its own [s], shape (trajectory, 1)."""

    field: ChartedField
    pace: Tensor

    @property
    def dim(self) -> int:
        return self.field.dim

    def __call__(self, x: Tensor) -> Tensor:
        velocity: Tensor = self.field(x) * self.pace
        return velocity


def proven_rate(model: ChartedField) -> float:
    """τ of the certificate [1/s]."""
    return slowest_rate(model) / model.time_unit_s


def examine(states: int, task: tuple[str, str, int, int]) -> tuple[tuple[str, str, int], Finding, Finding]:
    """Both claims for one draw of parameters."""
    torch.set_num_threads(1)
    field, chart, dim, seed = task
    model = draw(FIELDS[field], CHARTS[chart], dim, seed)
    parts = random_states(states, dim, seed).split(AT_ONCE)
    found = [reduce(add, (claim(model, part) for part in parts)) for claim in (condition, decay)]
    return (field, chart, dim), found[0], found[1]


def table(draws: int, states: int, workers: int) -> Iterator[tuple[str, int]]:
    """Rows for people, each with the number of violations in it."""
    tasks = list(product(FIELDS, CHARTS, DIMENSIONS, range(draws)))
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        results = pool.map(partial(examine, states), tasks)
        for name in dict.fromkeys(task[:3] for task in tasks):
            found = [next(results) for _ in range(draws)]
            for claim, column in (("condition", 1), ("decay", 2)):
                total = reduce(add, (result[column] for result in found))
                yield _row(name, claim, draws, total), total.violations


def _row(name: tuple[str, str, int], claim: str, draws: int, found: Finding) -> str:
    field, chart, dim = name
    share, unit = found.deciding / found.count, "1/s" if claim == "condition" else ""
    cells = f"{field:<11}{chart:<10}{dim:>2}  {claim:<11}{draws:>6}{found.count:>11}{100 * share:>10.2f} %"
    return f"{cells}{found.worst:>12.1e} {unit:<4}{found.violations:>10}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=DRAWS, help="of parameters, for each field, chart and dimension")
    parser.add_argument("--states", type=int, default=STATES, help="for each draw, an even number")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    arguments = parser.parse_args()
    print("field      chart      D  claim       draws     checked    deciding     worst excess   violations")
    violations = 0
    for line, found in table(arguments.draws, arguments.states, arguments.workers):
        print(line, flush=True)
        violations += found
    sys.exit(f"{violations} violations" if violations else 0)


if __name__ == "__main__":
    main()
