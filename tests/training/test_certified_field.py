import pytest
import torch

from geomotion import config as schema
from geomotion.demos import readers
from geomotion.demos.preprocessing import preprocess
from geomotion.dynamics.certificate import Claim, certify
from geomotion.dynamics.fields import ChartedField
from geomotion.models import ModelConfig, build
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.trainer import Schedule, fit
from geomotion.training.trajectories import TrajectoryReproduction


@pytest.fixture(scope="module")
def letters() -> TrainingSet:
    config = schema.LettersDataset(name="letters/s", letter="s", points=200)
    demonstrations = preprocess(readers.read(config), config.preprocess)
    return TrainingSet.from_demonstrations(demonstrations.select(range(5)), ("position_m",))


@pytest.fixture(scope="module")
def trained(letters, tmp_path_factory) -> ChartedField:
    """A field fitted to letters for a few seconds."""
    geometry = Geometry.of(letters)
    model = build(ModelConfig(schema.FlowChart(layers=6), schema.LinearField(), schema.NoRegulariser(), 0), geometry)
    objective = TrajectoryReproduction(letters, geometry, schema.TrajectoryTraining())
    schedule = Schedule(200, 1e-2, 20, 1.0, 1000, 50, 0)
    history = fit(model, objective, schedule, tmp_path_factory.mktemp("train") / "checkpoint", lambda step, row: None)
    assert history.rows[-1]["velocity"] < 0.5 * history.rows[0]["velocity"]
    return model.double()


def random_pairs(letters: TrainingSet) -> tuple[torch.Tensor, torch.Tensor]:
    """Pairs of starts all over the place: in a box of three times the size of the data."""
    generator = torch.Generator().manual_seed(0)
    low, high = letters.all_states.amin(0).double(), letters.all_states.amax(0).double()
    unit = torch.rand(2, 200, 2, generator=generator, dtype=torch.float64)
    x, y = low - (high - low) + 3 * (high - low) * unit
    return x, y


def test_trajectories_of_a_trained_field_contract_at_the_certified_rate(letters, trained):
    certificate = certify(trained, letters.all_states.double())
    assert certificate.claim is Claim.by_construction
    x, y = random_pairs(letters)
    times = torch.linspace(0, 6, 60, dtype=torch.float64)
    with torch.no_grad():
        first, second = (trained.chart.to_latent(trained.solve(start, times)) for start in (x, y))
        initial = (trained.chart.to_latent(x) - trained.chart.to_latent(y)).norm(dim=-1)
    distance = (first - second).norm(dim=-1)
    bound = torch.exp(-certificate.rate_per_s * times) * initial[:, None]
    assert (distance <= bound * (1 + 1e-6) + 1e-9).all()
    assert (distance[:, 1:] > 0.5 * bound[:, 1:]).any()  # the bound is not met by being far too large


def test_the_velocity_field_leads_along_the_closed_form(letters, trained):
    start = letters.states[0][0].double()
    times = torch.tensor([0.0, 0.5, 0.5 + 1e-6], dtype=torch.float64)
    with torch.no_grad():
        _, before, after = trained.solve(start, times)
        torch.testing.assert_close((after - before) / 1e-6, trained(before), rtol=1e-3, atol=1e-5)


def test_every_trajectory_ends_at_the_goal(letters, trained):
    x, _ = random_pairs(letters)
    goal = torch.stack([states[-1] for states in letters.states]).mean(0).double()
    with torch.no_grad():
        ends = trained.solve(x, torch.tensor([0.0, 200.0], dtype=torch.float64))[:, -1]
    torch.testing.assert_close(ends, goal.expand_as(ends), rtol=0, atol=1e-6)
