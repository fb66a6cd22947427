"""Rotations against another implementation, near the identity, near the cut, and their derivatives."""

import math

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting
from geomotion.lie.rotations import (
    angular_velocity,
    inverse,
    mean_quaternion,
    product,
    quaternion,
    rotation_vector,
)

ANGLES = (0.0, 1e-9, 1e-4, 0.0099, 0.0101, 1.0, 3.0, math.pi - 1e-6)


def turns(count: int, seed: int = 0) -> Rotation:
    return Rotation.random(count, random_state=seed)


def wxyz(rotation: Rotation) -> torch.Tensor:
    return torch.tensor(rotation.as_quat(scalar_first=True, canonical=True))


@pytest.mark.parametrize("angle", ANGLES)
def test_log_and_exp_are_inverse_at_any_angle(angle: float) -> None:
    axis = torch.tensor([0.6, -0.64, 0.48], dtype=torch.float64)
    turn = angle * axis
    expected = Rotation.from_rotvec(turn.numpy()).as_quat(scalar_first=True)
    torch.testing.assert_close(quaternion(turn), torch.tensor(expected), atol=1e-15, rtol=0)
    torch.testing.assert_close(rotation_vector(quaternion(turn)), turn, atol=1e-13, rtol=1e-13)


def test_log_agrees_with_another_implementation() -> None:
    rotations = turns(100)
    expected = torch.tensor(rotations.as_rotvec())
    torch.testing.assert_close(rotation_vector(wxyz(rotations)), expected, atol=1e-13, rtol=1e-13)


def test_log_of_the_other_sign_turns_the_other_way() -> None:
    one = torch.tensor([0.3, 0.2, -0.1], dtype=torch.float64)
    long = rotation_vector(-quaternion(one))
    assert float(long.norm()) == pytest.approx(2 * math.pi - float(one.norm()))
    torch.testing.assert_close(quaternion(long), -quaternion(one))


def test_single_precision_keeps_its_digits_near_the_cut() -> None:
    turn = torch.tensor([math.pi - 1e-3, 0.0, 0.0])
    torch.testing.assert_close(rotation_vector(quaternion(turn)), turn, atol=1e-6, rtol=0)


def test_products_turn_one_after_the_other() -> None:
    first, second = turns(20), turns(20, seed=1)
    torch.testing.assert_close(
        rotation_vector(product(wxyz(second), wxyz(first))).norm(dim=-1).remainder(2 * math.pi).sin().abs(),
        torch.tensor(np.abs(np.sin((second * first).magnitude()))),
    )
    unit = product(wxyz(first), inverse(wxyz(first)))
    torch.testing.assert_close(unit, torch.tensor([1.0, 0, 0, 0], dtype=torch.float64).expand(20, 4))


@pytest.mark.parametrize("angle", [0.0, 1e-5, 0.5, 3.0, 5.0])
def test_angular_velocity_is_the_rate_of_the_rotation(angle: float) -> None:
    turn = angle * torch.tensor([0.6, -0.64, 0.48], dtype=torch.float64)
    rate = torch.tensor([0.3, 0.7, -0.2], dtype=torch.float64)
    step = 1e-6
    moved = product(quaternion(turn + step * rate), inverse(quaternion(turn - step * rate)))
    omega = angular_velocity(turn, rate)
    torch.testing.assert_close(omega, rotation_vector(moved) / (2 * step), atol=1e-8, rtol=1e-8)


def test_mean_does_not_mind_signs() -> None:
    around = Rotation.from_rotvec(0.2 * np.random.default_rng(0).standard_normal((50, 3)))
    quaternions = wxyz(around)
    mean = mean_quaternion(quaternions)
    torch.testing.assert_close(mean_quaternion(torch.cat([-quaternions[:25], quaternions[25:]])), mean)
    torch.testing.assert_close(rotation_vector(mean), torch.tensor(around.mean().as_rotvec()), atol=1e-12, rtol=0)


def test_rotations_without_a_middle_are_refused() -> None:
    with pytest.raises(InvalidSetting, match="those that have a mean"):
        mean_quaternion(torch.eye(4, dtype=torch.float64))
