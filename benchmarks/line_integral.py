"""Speed of the line integral of Eq. (5.2) for one state: quadrature against torchdiffeq at equal accuracy.

Run as ``python benchmarks/line_integral.py [--model model.pt]``. For each field and number type, every integrator gets
its cheapest setting whose error is at most `MAX_RELATIVE_ERROR`, the error being that of a velocity's integral,
relative to its own length, the largest over `STATES` states, against `REFERENCE_NODES` nodes in double precision.
One core.
"""

import argparse
import copy
import statistics
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import torch
from torch import Tensor, nn

from geomotion.dynamics.line_integral import DormandPrince, LineIntegralField, LineIntegrator, RungeKutta4
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.dynamics.regularisers import ConstantRegulariser
from geomotion.networks.mlp import JacobianRoot

MAX_RELATIVE_ERROR = 1e-4
REFERENCE_NODES = 200
STATES = 30
HIDDEN_UNITS = (500, 500)
WARM_UP_CALLS, TIMED_CALLS = 20, 100
TRAINING_STEPS = 300

TOLERANCES = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6, 5e-7, 2e-7, 1e-7)

# From cheap to dear.
SETTINGS: dict[str, list[tuple[str, LineIntegrator]]] = {
    "quadrature": [(f"{n} nodes", GaussLegendre(n)) for n in (2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64)],
    "rk4": [(f"{n} steps", RungeKutta4(n)) for n in (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)],
    "dopri5": [(f"tolerance {t:.0e}", DormandPrince(t, t)) for t in TOLERANCES],
}


@dataclass(frozen=True)
class Row:
    """One timed velocity query.

    Attributes:
        name: Field, number type and integrator.
        setting: Nodes, steps or tolerance.
        relative_error: Largest error over the states.
        median_ms: Median duration of a call [ms].
        spread_ms: Interquartile range of the durations [ms].
        ratio: Median duration over that of the quadrature of the same field and number type.
    """

    name: str
    setting: str
    relative_error: float
    median_ms: float
    spread_ms: float
    ratio: float


def measure(call: Callable[[], object], calls: int = TIMED_CALLS) -> tuple[float, float]:
    """Median and interquartile range of the duration of a call [ms], after a warm-up."""
    for _ in range(WARM_UP_CALLS):
        call()
    durations = []
    for _ in range(calls):
        start = time.perf_counter()
        call()
        durations.append(1e3 * (time.perf_counter() - start))
    lower, middle, upper = statistics.quantiles(durations, n=4)
    return middle, upper - lower


def rows(fields: Iterable[tuple[str, LineIntegralField]]) -> Iterator[Row]:
    """All integrators on each field, in single and double precision; quadrature first."""
    torch.set_num_threads(1)
    for name, field in fields:
        for dtype in (torch.float32, torch.float64):
            quadrature_ms = None
            for method, settings in SETTINGS.items():
                chosen = _cheapest_accurate(field, dtype, settings)
                if chosen is None:
                    continue
                setting, error, query = chosen
                with torch.inference_mode():
                    median_ms, spread_ms = measure(query)
                quadrature_ms = quadrature_ms or median_ms
                label = f"{name}, {str(dtype).removeprefix('torch.')}, {method}"
                yield Row(label, setting, error, median_ms, spread_ms, median_ms / quadrature_ms)


def _cheapest_accurate(
    field: LineIntegralField, dtype: torch.dtype, settings: list[tuple[str, LineIntegrator]]
) -> tuple[str, float, Callable[[], Tensor]] | None:
    states = _states(field)
    reference = _with_integrator(field, GaussLegendre(REFERENCE_NODES), torch.float64)
    with torch.inference_mode():
        exact = reference(states)
        lengths = (exact - reference.base_velocity).norm(dim=-1)
        for setting, integrator in settings:
            candidate = _with_integrator(field, integrator, dtype)
            inputs = states.to(dtype)
            # One state at a time: an adaptive step would otherwise be shared by all.
            found = torch.stack([candidate(state) for state in inputs]).double()
            error = float(((found - exact).norm(dim=-1) / lengths).max())
            if error <= MAX_RELATIVE_ERROR:
                turn = cycle(inputs)  # an adaptive solver takes longer for some states than for others
                return setting, error, lambda field=candidate, turn=turn: field(next(turn))
    return None


def _states(field: LineIntegralField) -> Tensor:
    generator = torch.Generator().manual_seed(0)
    return 2 * torch.rand(STATES, field.dim, generator=generator, dtype=torch.float64) - 1


def _with_integrator(field: LineIntegralField, integrator: LineIntegrator, dtype: torch.dtype) -> LineIntegralField:
    parts = copy.deepcopy((field.jacobian_root, field.regulariser, field.base_point, field.base_velocity, integrator))
    return LineIntegralField(*parts).to(dtype)


def random_field(dim: int) -> LineIntegralField:
    """An untrained field with the usual initial weights."""
    torch.manual_seed(0)
    root, regulariser = JacobianRoot(dim, HIDDEN_UNITS), ConstantRegulariser(0.01, dim)
    return LineIntegralField(root, regulariser, torch.zeros(dim), nn.Parameter(torch.zeros(dim)), GaussLegendre(10))


def trained_field(dim: int) -> LineIntegralField:
    """A field trained on the velocities of a hook in each pair of axes, scaled to [-1, 1] (Eq. 5.3)."""
    field = random_field(dim)
    t = torch.linspace(0, 1, 200)[:, None]
    progress = 10 * t**3 - 15 * t**4 + 6 * t**5
    phase = torch.arange(dim) * torch.pi / 2 + torch.arange(dim).div(2, rounding_mode="floor")
    positions = (1 - progress) * torch.cos(1.5 * torch.pi * progress + phase)
    velocities = torch.gradient(positions, spacing=(t[1, 0] - t[0, 0]).item(), dim=0)[0]
    optimiser = torch.optim.Adam(field.parameters(), lr=1e-3)
    for _ in range(TRAINING_STEPS):
        optimiser.zero_grad()
        (field(positions) - velocities).square().sum(-1).mean().backward()
        optimiser.step()
    return field


def fields(model: str | None) -> Iterator[tuple[str, LineIntegralField]]:
    """Random and trained fields in two and eight dimensions, and the one of a trained model if its path is given."""
    for dim in (2, 8):
        yield f"random {dim}-D", random_field(dim)
        yield f"trained {dim}-D", trained_field(dim)
    if model is not None:
        from geomotion.models import load

        field = load(Path(model)).field.field
        if not isinstance(field, LineIntegralField):
            raise SystemExit(
                f"{model}: expected a model trained with field=line_integral, found {type(field).__name__}"
            )
        yield model, field


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", help="model.pt of a trained run with field=line_integral")
    print(f"{'':42}{'setting':18}{'error':>9}{'median ms':>11}{'spread ms':>11}{'ratio':>8}")
    for row in rows(fields(parser.parse_args().model)):
        print(
            f"{row.name:42}{row.setting:18}{row.relative_error:9.1e}{row.median_ms:11.3f}{row.spread_ms:11.3f}{row.ratio:8.1f}"
        )


if __name__ == "__main__":
    main()
