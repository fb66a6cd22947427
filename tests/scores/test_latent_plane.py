import numpy as np
import pytest
import torch

from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.embedded import EmbeddedField
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.linear import LinearField
from geomotion.scores.array_field import ArrayField
from geomotion.scores.latent_plane import latent_plane
from geomotion.scores.reproduction import Judged

TIME_S = np.linspace(0, 1, 30)
STARTS = np.array([[1.0, 0.0, 2.0, 0.0], [0.5, 0.0, -3.0, 0.0], [0.8, 0.1, 0.0, 0.0]])


def embedded(skill_dim):
    field = EmbeddedField(LinearField(skill_dim, 1.0, 2.0), 4, transverse_rate=5.0)
    return ArrayField(ChartedField(IdentityChart(4), field.double(), 1.0))


def demonstration():
    states = np.zeros((30, 4))
    states[:, 0] = np.exp(-2 * TIME_S)
    return Judged(TIME_S, states, states, states, states, True)


@pytest.mark.parametrize("skill_dim", [1, 2])
def test_motions_in_the_plane_follow_the_field_of_the_plane(skill_dim):
    arrays = latent_plane(embedded(skill_dim), demonstration(), STARTS, skill_dim).arrays
    assert arrays["latent_paths"].shape == (4, 30, 2)
    assert arrays["latent_is_skill"].tolist() == [True, skill_dim > 1]
    rates = torch.linalg.lstsq(*map(torch.tensor, (arrays["latent_points"], arrays["latent_velocity"]))).solution
    decay = torch.linalg.matrix_exp(rates * TIME_S[-1]).numpy()
    np.testing.assert_allclose(arrays["latent_paths"][:, -1], arrays["latent_paths"][:, 0] @ decay, atol=1e-9)


def test_beside_a_skill_of_one_dimension_the_direction_is_that_of_the_starts():
    arrays = latent_plane(embedded(1), demonstration(), STARTS[:2], 1).arrays
    np.testing.assert_allclose(np.abs(arrays["latent_paths"][1:, 0]), np.abs(STARTS[:2][:, [0, 2]]), atol=1e-9)
    np.testing.assert_allclose(arrays["latent_demonstrated"][:, 1], 0, atol=1e-12)
