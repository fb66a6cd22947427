"""What a policy says is what its field, its pose and its obstacle say, and it knows where it was taught."""

import math

import pytest
import torch
from torch.testing import assert_close

from geomotion.lie.poses import PoseCoordinates
from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.solids import Sphere
from geomotion.obstacles.ways import own_way
from geomotion.policy.ports import Status

from .skills import EMBEDDED, LINEAR, REFERENCE, REMEMBERING, SIZE_M, ask, policy_of, pose_skill, skill_of, states_of


def measured(skill, states):
    position, orientation = skill.pose.to_pose(states)
    return {"position_m": position, "orientation_wxyz": orientation}


@pytest.mark.parametrize("config", [LINEAR, EMBEDDED])
def test_velocities_are_those_of_the_field(config):
    skill, states = skill_of(config, 3), states_of(3)
    answer = ask(policy_of(skill), state_m=states)
    assert_close(answer["velocity_m_per_s"], skill.field(states))
    assert set(answer["status"].tolist()) == {Status.ok}


def test_velocities_of_a_pose_are_its_twist_whatever_the_length_and_sign_of_the_quaternion():
    skill, states = pose_skill(), states_of(6)
    twist = skill.pose.twist(states, skill.field(states))
    told = measured(skill, states)
    told["orientation_wxyz"] = -1.01 * told["orientation_wxyz"]
    answer = ask(policy_of(skill), **told)
    assert_close(answer["velocity_m_per_s"], twist.velocity, rtol=1e-4, atol=1e-6)
    assert_close(answer["angular_velocity_rad_per_s"], twist.omega, rtol=1e-4, atol=1e-5)


def test_a_start_that_is_told_is_remembered():
    skill, states = pose_skill(REMEMBERING), states_of(6)
    policy, told, elapsed_s = policy_of(skill), measured(skill, states), torch.full((20, 1), 0.7)
    start = {f"start_{name}": values[:1] for name, values in told.items()}
    mean_start = skill.field.start_memory.mean_start[None]
    for asked, field in ((start, skill.field.begun(states[:1])), ({}, skill.field.begun(mean_start))):
        twist = skill.pose.twist(states, field.velocity(states, elapsed_s))
        answer = ask(policy, **told, **asked, elapsed_s=elapsed_s)
        assert_close(answer["velocity_m_per_s"], twist.velocity, rtol=1e-4, atol=1e-5)
        assert_close(answer["angular_velocity_rad_per_s"], twist.omega, rtol=1e-4, atol=1e-5)
    assert set(start) == {one.name for one in policy.inputs if one.name.startswith("start_")}


def test_joints_are_called_so_and_meet_no_balls():
    policy = policy_of(skill_of(LINEAR, 3, ("joints_rad",)))
    assert [one.name for one in policy.inputs] == ["joints_rad"]
    assert [one.name for one in policy.outputs] == ["joint_velocity_rad_per_s", "status"]


@pytest.mark.parametrize("radius_m", [0.0, 0.05])
def test_a_ball_modulates_as_it_does_in_a_rollout(radius_m):
    skill, states = skill_of(LINEAR, 3), states_of(3)
    centre, velocity = torch.tensor([0.1, 0.12, 0.08]), torch.tensor([0.02, 0.0, -0.01])
    asked = {"obstacle_centre_m": centre[None], "obstacle_velocity_m_per_s": velocity[None]}
    answer = ask(policy_of(skill), state_m=states, obstacle_radius_m=torch.tensor([[radius_m]]), **asked)
    expected = skill.field(states)
    if radius_m:
        field = ModulatedField(skill.field, [Sphere(centre, radius_m, velocity)])
        assert field.ways == [own_way]
        assert not torch.allclose(field(states), expected, rtol=0.1)
        expected = field(states)
    assert_close(answer["velocity_m_per_s"], expected, rtol=1e-5, atol=1e-6)


def test_a_pose_keeps_out_of_a_ball_by_its_position_alone():
    skill, states = pose_skill(), states_of(6)
    policy, told = policy_of(skill), measured(skill, states)
    free = ask(policy, **told)
    radius_m = 0.5 * SIZE_M
    away = torch.nn.functional.normalize(free["velocity_m_per_s"], dim=-1)
    centre = told["position_m"][:1] + radius_m * away[:1]  # straight ahead of the first, which touches it
    blocked = ask(policy, **told, obstacle_centre_m=centre, obstacle_radius_m=torch.tensor([[radius_m]]))
    assert abs(float(blocked["velocity_m_per_s"][0] @ away[0])) < 1e-4 * float(free["velocity_m_per_s"][0].norm())
    assert_close(blocked["angular_velocity_rad_per_s"], free["angular_velocity_rad_per_s"])


def test_the_distance_to_the_manifold_falls_at_the_rate_that_is_asked_for():
    skill, states = skill_of(EMBEDDED, 3), states_of(3)
    policy, step_s = policy_of(skill), 1e-4
    for rate in (5.0, 40.0):
        told = {"transverse_rate_per_duration": torch.tensor([[rate]])}
        now = ask(policy, state_m=states, **told)
        later = ask(policy, state_m=states + step_s * now["velocity_m_per_s"], **told)
        fall = (now["off_manifold_m"] - later["off_manifold_m"]) / step_s / now["off_manifold_m"]
        assert_close(fall, torch.full_like(fall, rate / skill.geometry.duration_s), rtol=0.1, atol=0.3)


class TestStatus:
    def test_outside_of_the_range_it_says_so_and_still_leads_back(self):
        states = torch.cat([states_of(3, 1), states_of(3, 1) + 10 * SIZE_M])
        answer = ask(policy_of(skill_of(LINEAR, 3)), state_m=states)
        assert answer["status"].tolist() == [Status.ok, Status.outside]
        assert answer["velocity_m_per_s"].isfinite().all()

    @pytest.mark.parametrize("bad", [math.nan, math.inf])
    def test_what_is_not_finite_gets_no_velocity(self, bad):
        states = torch.cat([states_of(3, 1), torch.tensor([[0.1, bad, 0.1]])])
        answer = ask(policy_of(skill_of(LINEAR, 3)), state_m=states)
        assert answer["status"].tolist() == [Status.ok, Status.undefined]
        assert not answer["velocity_m_per_s"][1].any()

    def test_beyond_the_cover_it_is_outside_and_without_a_rotation_undefined(self):
        skill = pose_skill()
        told = measured(skill, 0.1 * torch.ones(3, 6))
        half_a_turn = torch.tensor([0.0, 1.0, 0.0, 0.0])
        from_reference = torch.tensor([*skill.pose.reference.tolist()])
        w, x, y, z = from_reference
        turned = torch.stack([-x, w, -z, y])  # i times the reference: on the edge of the first cover
        assert abs(float(turned @ from_reference)) < 1e-6
        told["orientation_wxyz"] = torch.stack([told["orientation_wxyz"][0], turned, 0.0 * half_a_turn])
        answer = ask(policy_of(skill), **told)
        assert answer["status"].tolist()[0] == Status.ok
        assert answer["status"].tolist()[1] in (Status.outside, Status.undefined)
        assert answer["status"].tolist()[2] == Status.undefined
        assert answer["angular_velocity_rad_per_s"].isfinite().all()


def test_joints_and_the_pose_that_carries_them_have_their_own_velocities_and_meet_no_balls():
    pose = PoseCoordinates(torch.tensor(REFERENCE), lever_m=1.0)
    skill = skill_of(EMBEDDED, 9, ("joints_rad", "pose_m"), pose)
    states = states_of(9)
    position, orientation = pose.to_pose(states[:, 3:])
    policy = policy_of(skill)
    answer = ask(policy, joints_rad=states[:, :3], position_m=position, orientation_wxyz=orientation)
    velocity = skill.field(states)
    twist = pose.twist(states[:, 3:], velocity[:, 3:])
    assert_close(answer["joint_velocity_rad_per_s"], velocity[:, :3], rtol=1e-4, atol=1e-5)
    assert_close(answer["velocity_m_per_s"], twist.velocity, rtol=1e-4, atol=1e-5)
    assert_close(answer["angular_velocity_rad_per_s"], twist.omega, rtol=1e-4, atol=1e-5)
    assert not any(one.name.startswith("obstacle") for one in policy.inputs)
