"""Forward kinematics as a layer: values, closed-form Jacobians, the volume measure and its gradient."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from geomotion import arms
from geomotion.config import PandaArm, PlanarArm
from geomotion.errors import ShapeMismatch
from geomotion.robot.arm import Arm
from geomotion.robot.body import BodyPoints
from geomotion.robot.kinematics import ForwardKinematics

from .arms import some_joints


def layer_of(arm: Arm, between: int = 1) -> ForwardKinematics:
    return ForwardKinematics(arm, arm.joint_points(between))


def test_points_and_orientation_are_those_of_the_chain(arm):
    q = some_joints(arm, 40).reshape(4, 10, -1)
    points, orientation = layer_of(arm)(torch.from_numpy(q))
    np.testing.assert_allclose(points, arm.chain.points(q, arm.joint_points(1)), atol=1e-12)
    np.testing.assert_allclose(points[..., -1, :], arm.chain.pose(q)[0], atol=1e-12)
    np.testing.assert_allclose(orientation, arm.chain.pose(q)[1], atol=1e-12)
    assert (orientation[..., 0] >= 0).all()


def test_jacobians_are_derivatives(arm):
    layer, q = layer_of(arm), torch.from_numpy(some_joints(arm, 5))
    points, of_points, of_turn = layer.jacobians(q)
    expected = torch.stack([torch.autograd.functional.jacobian(lambda x: layer(x)[0], row) for row in q])
    torch.testing.assert_close(of_points, expected)
    torch.testing.assert_close(points, layer(q)[0])
    step = 1e-6
    for joint, direction in enumerate(step * torch.eye(q.shape[-1], dtype=q.dtype)):
        ahead, behind = (
            Rotation.from_quat(layer(q + sign * direction)[1].numpy(), scalar_first=True) for sign in (1, -1)
        )
        turn = (ahead * behind.inv()).as_rotvec() / (2 * step)
        np.testing.assert_allclose(of_turn[..., joint], turn, atol=1e-8)


def test_the_jacobian_of_the_tip_is_that_of_pytorch_kinematics():
    import pytorch_kinematics

    from geomotion.robot import panda
    from geomotion.robot.quiet import quiet

    arm = arms.build(PandaArm())
    with quiet():
        text = panda.urdf_path().read_bytes()
        reference = pytorch_kinematics.build_serial_chain_from_urdf(text, "panda_grasptarget", "panda_link0")
    q = torch.from_numpy(some_joints(arm, 20))
    _, of_points, of_turn = layer_of(arm, 0).jacobians(q)
    both = torch.cat([of_points[:, -1], of_turn], dim=-2)
    torch.testing.assert_close(both, reference.to(dtype=torch.float64).jacobian(q), atol=1e-6, rtol=0)


def test_what_is_trained_through_the_layer_has_the_right_gradients(arm):
    layer = layer_of(arm, 0)
    q = torch.from_numpy(some_joints(arm, 2)).requires_grad_()
    assert torch.autograd.gradcheck(layer, q)
    assert torch.autograd.gradcheck(lambda x: layer.log_volume(x, 1e-3), q)
    assert torch.autograd.gradgradcheck(lambda x: layer.log_volume(x, 1e-3), q)


def test_the_volume_of_two_links_in_a_plane_is_known():
    upper, fore, weight = 0.3, 0.25, 1e-4
    elbow = torch.linspace(-2.5, 2.5, 11, dtype=torch.float64)
    q = torch.stack([torch.zeros_like(elbow) + 0.7, elbow], dim=-1)
    tip_square = upper**2 + fore**2 + 2 * upper * fore * elbow.cos()
    shoulder = upper**2 + tip_square + 1 + weight  # ‖∂p/∂q₁‖² of elbow and tip, and of the turn, which both share
    both = fore**2 + upper * fore * elbow.cos() + 1
    determinant = shoulder * (fore**2 + 1 + weight) - both**2
    torch.testing.assert_close(layer_of(arms.build(PlanarArm()), 0).log_volume(q, weight), determinant.log() / 2)


def test_at_singular_configurations_the_volume_and_its_gradient_are_finite():
    """Of the tip's pose alone, the stretched panda: joints 1, 3, 5 and 7 turn about one line."""
    arm = arms.build(PandaArm())
    points = arm.joint_points()
    tip = BodyPoints(points.frame[-1:], points.offset_m[-1:], points.radius_m[-1:])
    layer = ForwardKinematics(arm, tip)
    q = torch.zeros(1, 7, dtype=torch.float64, requires_grad=True)
    _, of_points, of_turn = layer.jacobians(q)
    J = torch.cat([of_points[0, 0], of_turn[0]]).detach()
    rank, weight = int(torch.linalg.matrix_rank(J, atol=1e-9)), 1e-6
    assert rank < 6
    volume = layer.log_volume(q, weight)
    squares = torch.linalg.svdvals(J) ** 2 + weight
    expected = (squares.log().sum() + (7 - len(squares)) * np.log(weight)) / 2
    torch.testing.assert_close(volume.detach(), expected[None], atol=1e-6, rtol=0)
    volume.sum().backward()
    assert q.grad.isfinite().all()


def test_single_precision_follows_the_input(arm):
    layer, q = layer_of(arm), torch.from_numpy(some_joints(arm, 5))
    for exact, single in zip(
        (*layer(q), *layer.jacobians(q), layer.log_volume(q, 1e-3)),
        (*layer(q.float()), *layer.jacobians(q.float()), layer.log_volume(q.float(), 1e-3)),
        strict=True,
    ):
        assert single.dtype == torch.float32
        torch.testing.assert_close(single.double(), exact, atol=1e-4, rtol=1e-4)


def test_a_layer_has_nothing_to_train_and_nothing_to_store(arm):
    layer = layer_of(arm)
    assert not list(layer.parameters()) and not layer.state_dict()


def test_the_number_of_angles_is_checked(arm):
    with pytest.raises(ShapeMismatch, match="joint positions"):
        layer_of(arm)(torch.zeros(2, len(arm.joint_names) + 1))
