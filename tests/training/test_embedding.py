import numpy as np
import pytest
import torch

from geomotion.config import EncoderConfig
from geomotion.training.data import TrainingSet
from geomotion.training.embedding import Embedding, Seen, Shown, barycentric, embedded, fit_embedding

PLACES_M = np.array([(0.0, 0.0), (0.3, 0.0), (0.0, 0.2)])
FEATURES = 40


class Straight:
    """Motions from their start to the goal of their condition, evenly within a second."""

    def trajectories(self, start, condition, times):
        goal = condition @ torch.tensor(PLACES_M, dtype=torch.float32)
        return start[..., None, :] + times[..., None] * (goal - start)[..., None, :]


def shown():
    times = torch.linspace(0, 1, 20)
    goals = torch.tensor(PLACES_M, dtype=torch.float32)
    states = tuple(torch.outer(times, goal) + 0.1 * (1 - times)[:, None] for goal in goals)
    data = TrainingSet((times,) * 3, states, tuple(torch.zeros_like(one) for one in states))
    return Shown(Straight(), data, np.arange(3), 0.3)


def seen(between, generator):
    """Features that are linear in the place, with noise."""
    place = np.concatenate([np.arange(3).repeat(20), np.full(between, -1)])
    object_m = np.concatenate([PLACES_M[place[:60]], generator.dirichlet(np.ones(3), between) @ PLACES_M])
    mixing = np.random.default_rng(5).standard_normal((2, FEATURES))
    features = object_m @ mixing + 0.001 * generator.standard_normal((len(place), FEATURES))
    coordinates = barycentric(object_m, PLACES_M)
    return Seen(torch.tensor(features).float(), torch.tensor(place), torch.tensor(coordinates)), object_m


def test_barycentric_coordinates_give_back_the_point():
    points = np.random.default_rng(0).standard_normal((5, 2))
    coordinates = barycentric(points, PLACES_M)
    np.testing.assert_allclose(coordinates.sum(axis=1), 1.0)
    np.testing.assert_allclose(coordinates @ PLACES_M, points)


@pytest.mark.parametrize("outputs", [3, 7])
def test_entries_add_up_to_one(outputs):
    condition = embedded(torch.randn(11, outputs, generator=torch.Generator().manual_seed(0)), 3)
    torch.testing.assert_close(condition.sum(-1), torch.ones(11))


def test_places_are_told_apart_without_pictures_between():
    pictures, _ = seen(0, np.random.default_rng(0))
    model, losses = fit_embedding(pictures, shown(), EncoderConfig())
    assert not model.knows_elsewhere and set(losses) == {"class", "weights", "trajectory"}
    unseen, _ = seen(0, np.random.default_rng(1))
    assert (model.scores(unseen.features).argmax(-1) == unseen.place).all()


def test_objects_between_are_measured_and_those_at_places_are_named():
    pictures, _ = seen(60, np.random.default_rng(0))
    model, _ = fit_embedding(pictures, shown(), EncoderConfig(weight_penalty=1e-6))
    unseen, object_m = seen(60, np.random.default_rng(1))
    apart = np.linalg.norm(model(unseen.features).detach().numpy() @ PLACES_M - object_m, axis=1)
    assert np.median(apart[60:]) < 0.01 and apart[:60].max() < 0.02


def test_the_trajectory_loss_alone_finds_the_places():
    pictures, object_m = seen(0, np.random.default_rng(0))
    model, losses = fit_embedding(pictures, shown(), EncoderConfig(class_weight=0.0, weight_penalty=1e-6))
    assert isinstance(model, Embedding) and losses["trajectory"] < 1e-3
    apart = np.linalg.norm(model(pictures.features).detach().numpy() @ PLACES_M - object_m, axis=1)
    assert apart.max() < 0.03
