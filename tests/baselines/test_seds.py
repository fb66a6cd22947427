"""SEDS: stability for all parameters, and a start that a linear system is recovered by."""

import pytest
import torch
from torch.testing import assert_close

from geomotion.baselines.clusters import nearest_centres
from geomotion.baselines.seds import StableGaussianMixture
from geomotion.errors import InvalidSetting

RATE = 0.3


def random_mixture(seed: int, dim: int = 3, components: int = 4) -> StableGaussianMixture:
    torch.manual_seed(seed)
    mixture = StableGaussianMixture(dim, components, RATE).double()
    with torch.no_grad():
        for parameter in mixture.parameters():
            parameter.normal_()
    return mixture


@pytest.mark.parametrize("seed", range(5))
def test_the_distance_to_the_goal_falls_at_every_state_whatever_the_parameters(seed):
    mixture, x = random_mixture(seed), 2 * torch.randn(200, 3, dtype=torch.float64)
    falling = (x * mixture(x)).sum(-1)
    assert (falling <= -RATE * x.square().sum(-1) + 1e-9).all()


def test_but_two_trajectories_may_part():
    x, y = torch.randn(2, 1000, 2, dtype=torch.float64)
    parting = [
        ((x - y) * (mixture(x) - mixture(y))).sum(-1).max() for mixture in (random_mixture(s, 2) for s in range(5))
    ]
    assert max(parting) > 0


def test_weights_are_those_of_the_gaussians():
    mixture, x = random_mixture(0, dim=2, components=2), torch.randn(5, 2, dtype=torch.float64)
    roots = mixture.state_root.tril(-1) + mixture.state_root.diagonal(dim1=-2, dim2=-1).exp().diag_embed()
    gaussians = [
        torch.distributions.MultivariateNormal(mean, precision_matrix=root.T @ root)
        for mean, root in zip(mixture.means, roots, strict=True)
    ]
    joint = mixture.log_priors.softmax(-1) * torch.stack([one.log_prob(x) for one in gaussians], -1).exp()
    expected = torch.einsum("bk,kij,bj->bi", joint / joint.sum(-1, keepdim=True), mixture.matrices, x)
    assert_close(mixture(x), expected)


def test_the_start_recovers_a_stable_linear_system():
    matrix = torch.tensor([[-1.0, 2.0], [-2.0, -0.8]])
    x = torch.randn(3, 400, 2)
    mixture = StableGaussianMixture(2, 2, 0.01)
    mixture.start_from([torch.arange(400.0)] * 3, list(x), list(x @ matrix.T))
    assert_close(mixture(x), x @ matrix.T, atol=0.02, rtol=0)


def test_the_start_makes_an_unstable_one_stable():
    x = torch.randn(100, 2)
    mixture = StableGaussianMixture(2, 1, 0.01)
    mixture.start_from([torch.arange(100.0)], [x], [x])
    assert ((x * mixture(x)).sum(-1) < 0).all()


def test_clusters_are_those_that_lie_apart():
    torch.manual_seed(0)
    places = torch.tensor([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]])
    points = places.repeat_interleave(20, 0) + 0.1 * torch.randn(60, 2)
    member = nearest_centres(points, 3)
    assert [len(member[20 * k : 20 * k + 20].unique()) for k in range(3)] == [1, 1, 1]
    assert len(member.unique()) == 3


def test_no_cluster_is_empty_where_points_coincide():
    points = torch.cat([torch.zeros(50, 2), torch.tensor([[1.0, 0.0], [0.0, 1.0]])])
    assert len(nearest_centres(points, 3).unique()) == 3


def test_more_components_than_different_states_are_refused():
    states = torch.tensor([[1.0, 0.0], [0.5, 0.0]])[:, None].expand(-1, 30, -1)
    mixture = StableGaussianMixture(2, 3, RATE)
    with pytest.raises(InvalidSetting, match=r"field\.components=3 .* at most 2"):
        mixture.start_from([torch.arange(30.0)] * 2, list(states), list(states))
