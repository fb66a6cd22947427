"""The decoder of configurations with its fixed layer of kinematics, and the metric that it is pulled back through."""

import functools

import numpy as np
import pytest
import torch
from torch.func import jacfwd, vmap

from geomotion import arms
from geomotion.config import ManifoldTraining, PandaArm, PlanarArm
from geomotion.networks.joint_vae import JointVAE, rotation_matrix
from geomotion.robot.arm import Arm
from geomotion.robot.kinematics import ForwardKinematics
from geomotion.training.manifold import JointReconstruction, JointSpreadLikelihood

SCALE_RAD, SCALE_M = 0.8, 0.2


@functools.cache
def arm(name: str) -> Arm:
    return arms.build(PandaArm() if name == "panda" else PlanarArm())


def network(name: str = "panda", latent_dim: int = 3, **changes) -> JointVAE:
    torch.manual_seed(0)
    built = arm(name)
    centre = [0.1, -0.5, 0.2, -2.0, 0.1, 1.6, 0.7] if name == "panda" else [0.4, 0.9]
    kinematics = ForwardKinematics(built, built.joint_points())
    made = JointVAE(kinematics, centre, SCALE_RAD, SCALE_M, latent_dim, (20, 10), 30, 100.0, **changes)
    made.place_kernels(torch.randn(30, latent_dim), 0.5)
    return made.double()


def codes(count: int = 6, latent_dim: int = 3) -> torch.Tensor:
    return torch.randn(count, latent_dim, generator=torch.Generator().manual_seed(1)).double()


@pytest.mark.parametrize(("name", "points"), [("panda", 8), ("planar", 3)])
def test_one_block_for_each_joint_and_the_tip(name, points):
    body, rest = network(name).blocks(codes())
    assert body.shape == (6, points, 4) and rest.shape == (6, 10)


def test_blocks_are_where_the_arm_is_in_the_decoded_configuration():
    made, z = network(), codes()
    body, _ = made.blocks(z)
    joints_rad = made.joints_rad(z).detach().numpy()
    expected = arm("panda").chain.points(joints_rad, arm("panda").joint_points())
    np.testing.assert_allclose(SCALE_M * body[..., :3].detach().numpy(), expected, atol=1e-6)
    np.testing.assert_allclose(made.positions(z).detach().numpy(), expected, atol=1e-6)


def test_the_metric_is_that_of_the_kinematics_composed_with_the_decoder():
    """J_FK J_μ of Eq. (4.3), column by column, and what the spread of the joints adds."""
    made, z = network(), codes()
    of_body, of_turn = vmap(jacfwd(made.blocks))(z)
    joints = vmap(jacfwd(made.joints_rad))(z)
    spread_rad = SCALE_RAD * vmap(jacfwd(made.std))(z)
    _, of_points, turn = made.kinematics.jacobians(made.joints_rad(z))
    for block in range(8):
        through = of_points[:, block] @ joints / SCALE_M
        spread = made.lever[block] * spread_rad[:, None] / SCALE_M
        expected = through.mT @ through + spread.mT @ spread
        found = of_body[:, block].mT @ of_body[:, block]
        torch.testing.assert_close(found, expected, rtol=1e-8, atol=1e-10)
    # turning by an angle α moves a unit quaternion by α/2
    through, spread = turn @ joints / 2, made.turn * spread_rad[:, None] / 2
    torch.testing.assert_close(of_turn.mT @ of_turn, through.mT @ through + spread.mT @ spread, rtol=1e-8, atol=1e-10)


def test_the_spread_counts_as_far_as_it_moves_the_body():
    """E‖p_b(θ + σε) - p_b(θ)‖² → ‖J_b‖_F² σ² at the mean configuration, ε standard normal."""
    made = network()
    noise = 1e-3 * torch.randn(20_000, 7, generator=torch.Generator().manual_seed(0)).double()
    moved, _ = made.kinematics(made.centre_rad + noise)
    still, _ = made.kinematics(made.centre_rad)
    found = (moved - still).square().sum(dim=-1).mean(dim=0).sqrt() / 1e-3
    torch.testing.assert_close(found, made.lever, rtol=0.03, atol=1e-6)


def test_rotation_matrices_do_not_know_the_sign_and_are_as_far_apart_as_quaternions():
    q = torch.nn.functional.normalize(torch.randn(50, 4).double(), dim=-1)
    other = torch.nn.functional.normalize(q + 1e-4 * torch.randn(50, 4).double(), dim=-1)
    turned = rotation_matrix(q)
    torch.testing.assert_close(turned, rotation_matrix(-q))
    torch.testing.assert_close(turned @ turned.mT, torch.eye(3).double().expand(50, 3, 3))
    chords = (rotation_matrix(other) - turned).flatten(1).norm(dim=1) / 8**0.5
    torch.testing.assert_close(chords, (other - q).norm(dim=1), rtol=1e-6, atol=1e-12)


def test_far_from_the_kernels_the_spread_is_the_largest():
    made = network()
    far = made.std(torch.full((1, 3), 50.0).double())
    assert float(far.detach()) == pytest.approx(100.0) and (made.std(made.precision.centres) < 1).all()


def test_configurations_are_encoded_with_their_progress_if_asked_for():
    joints = torch.randn(5, 7).double()
    early, late = torch.zeros(5).double(), torch.ones(5).double()
    with_it, without = network(), network(encodes_progress=False)
    assert not torch.allclose(with_it.encode(joints, early)[0], with_it.encode(joints, late)[0])
    torch.testing.assert_close(without.encode(joints, early), without.encode(joints, late))


class TestObjective:
    def losses(self, made: JointVAE, **changes) -> dict[str, torch.Tensor]:
        joints, progress = torch.zeros(20, made.centre_rad.shape[0]).double(), torch.linspace(0, 1, 20).double()
        settings = ManifoldTraining(batch_points=16, **changes)
        return dict(JointReconstruction(joints, progress, settings)(made, 0.5, torch.Generator().manual_seed(0)))

    def test_the_volume_is_that_of_the_decoded_configurations(self):
        made = network()
        losses = self.losses(made, volume_points=16, volume_weight=2.0)
        without = self.losses(made, volume_weight=0.0)
        assert "volume" not in without and losses["joints"] == without["joints"]
        generator = torch.Generator().manual_seed(0)
        chosen = torch.randint(20, (16,), generator=generator)
        mean, log_variance = made.encode(torch.zeros(16, 7).double(), torch.linspace(0, 1, 20).double()[chosen])
        z = mean + torch.randn(mean.shape, generator=generator) * (log_variance / 2).exp()
        expected = 2 * made.kinematics.log_volume(made.joints_rad(z), 1e-3).mean()
        torch.testing.assert_close(losses["volume"], expected)

    def test_singular_configurations_leave_finite_gradients(self):
        """A stretched planar arm: the tip's Jacobian loses its rank, Sec. 4.3.2."""
        made = network("planar", latent_dim=2)
        with torch.no_grad():
            made.centre_rad.zero_()
            for parameter in made.decoder.parameters():
                parameter.zero_()
        losses = self.losses(made, volume_points=16)
        sum(losses.values()).backward()
        gradients = [one.grad for one in made.parameters() if one.grad is not None]
        assert gradients and all(gradient.isfinite().all() for gradient in gradients)

    def test_the_best_spread_is_how_far_the_means_are_off(self):
        made = network()
        joints, progress = 0.1 * torch.randn(200, 7).double(), torch.rand(200).double()
        objective = JointSpreadLikelihood(joints, progress, 200)
        made.precision.place(torch.zeros(30, 3), 1e3, 1.0)  # so wide that σ is the same everywhere
        scales = torch.linspace(0.2, 5, 200).double()
        found = []
        for scale in scales:
            made.precision.place(torch.zeros(30, 3), 1e3, float(scale))
            found.append(float(objective(made, 0.0, torch.Generator().manual_seed(0))["std"].detach()))
        generator = torch.Generator().manual_seed(0)
        chosen = torch.randint(200, (200,), generator=generator)
        mean, log_variance = made.encode(joints[chosen], progress[chosen])
        z = mean + torch.randn(mean.shape, generator=generator) * (log_variance / 2).exp()
        missed = (made.reconstruct(z)[0] - joints[chosen]).square().mean().sqrt()
        assert float(scales[int(np.argmin(found))]) == pytest.approx(1 / float(missed.detach()), rel=0.05)
