"""The search for violations: none where contraction is by construction, and it finds those that are there."""

import importlib.util
import sys
from pathlib import Path

import pytest

from geomotion.dynamics.fields import ChartedField

PATH = Path(__file__).resolve().parents[2] / "benchmarks/certificates.py"


@pytest.fixture(scope="module")
def search():
    spec = importlib.util.spec_from_file_location("certificates", PATH)
    module = sys.modules["certificates"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    del sys.modules["certificates"]


@pytest.mark.parametrize("dim", [2, 3, 8])
@pytest.mark.parametrize("chart", ["identity", "flow"])
@pytest.mark.parametrize("field", ["linear", "potential"])
def test_exact_fields_violate_neither_claim(search, field, chart, dim):
    for found in search.examine(30, (field, chart, dim, dim))[1:]:
        assert found.violations == 0
        assert found.deciding > 0.8 * found.count


class Slowed(ChartedField):
    """A field that contracts at half of the rate that it claims, and has no closed form."""

    is_solvable = False

    def __init__(self, model: ChartedField) -> None:
        super().__init__(model.chart, model.field, model.time_unit_s)

    def forward(self, x):
        return 0.5 * super().forward(x)


@pytest.mark.parametrize("claim", ["condition", "decay"])
def test_a_rate_that_is_twice_too_high_is_found_out(search, claim):
    model = search.draw(search.FIELDS["linear"], search.CHARTS["flow"], 2, 0)
    found = getattr(search, claim)(Slowed(model), search.random_states(30, 2, 0))
    assert found.violations > 0
    assert found.worst > 0
