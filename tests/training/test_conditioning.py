import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from geomotion import config as schema
from geomotion import models
from geomotion.errors import DatasetError, InvalidSetting
from geomotion.models import ModelConfig
from geomotion.training.conditioning import Conditioning, with_conditions
from geomotion.training.data import Geometry, Surroundings, TrainingSet
from geomotion.training.trajectories import TrajectoryReproduction

TARGETS = np.array([[0.0, 0.0], [0.2, 0.1], [-0.1, 0.3], [0.1, 0.1]])


def ending_at(
    ends: np.ndarray, sizes_m: np.ndarray | float = 0.2, durations_s: np.ndarray | float = 1.0
) -> TrainingSet:
    """Straight motions along the first axis."""
    parts = []
    for end, size_m, duration_s in zip(ends, *np.broadcast_arrays(sizes_m, durations_s, ends[:, 0])[:2], strict=True):
        times = torch.linspace(0, float(duration_s), 5)
        velocity = torch.tensor([2 * size_m / duration_s, 0.0], dtype=torch.float32)
        states = torch.tensor(end, dtype=torch.float32) + (times - duration_s)[:, None] * velocity
        parts.append((times, states, velocity.expand(5, -1)))
    return TrainingSet(*zip(*parts, strict=True))


def fitted(conditions: np.ndarray, data: TrainingSet, moves_frame: bool = True) -> Conditioning:
    distinct = {str(number): tuple(row) for number, row in enumerate(np.unique(conditions, axis=0).tolist())}
    names = [f"c{axis}" for axis in range(conditions.shape[1])]
    return Conditioning.fit(names, distinct, conditions, data, moves_frame)


@pytest.mark.parametrize("shapes", [2, 3, 7])
def test_each_label_has_an_entry_of_the_code_and_all_that_was_measured_for_itself(shapes):
    conditions = np.repeat(np.eye(shapes), 3, axis=0)
    generator = np.random.default_rng(0)
    ends = generator.normal(size=(shapes, 2)).repeat(3, axis=0)
    sizes_m, durations_s = generator.uniform(0.1, 3, (2, shapes)).repeat(3, axis=1)
    found = fitted(conditions, ending_at(ends, sizes_m, durations_s))
    assert found.context == shapes
    # names are given to conditions in the order of np.unique
    assert_allclose(np.abs(found.codes(np.eye(shapes))).sum(1), 1, atol=1e-12)
    assert_allclose(found.codes(np.eye(shapes)).max(1), 1)
    for number in range(shapes):
        frame = found.frame_at(np.eye(shapes)[number])
        assert_allclose(frame.shift_m, ends[3 * number], atol=1e-6)
        assert frame.stretch * found.size_m == pytest.approx(sizes_m[3 * number], rel=1e-5)
        assert frame.slowdown * found.duration_s == pytest.approx(durations_s[3 * number], rel=1e-5)


def test_codes_are_barycentric_coordinates_between_demonstrated_corners():
    found = fitted(TARGETS, ending_at(TARGETS))
    anywhere = np.random.default_rng(1).normal(size=(20, 2))
    assert_allclose(found.codes(anywhere).sum(1), 1)
    assert_allclose(
        found.codes(anywhere[:1] / 2 + anywhere[1:] / 2), (found.codes(anywhere[:1]) + found.codes(anywhere[1:])) / 2
    )
    corners = [target for target in TARGETS if np.isclose(found.codes(target).max(), 1)]
    assert len(corners) == found.context == 3
    assert np.abs(found.codes(TARGETS)).max() <= 2  # no demonstrated condition is far outside of them


def test_the_goal_is_the_target_where_the_condition_is():
    found = fitted(TARGETS, ending_at(TARGETS))
    for target in np.array([[0.05, -0.2], [1.0, 2.0]]):
        assert_allclose(found.goal_at(target), target, atol=1e-6)
        assert_allclose(found.frame_at(target).shift_m, target, atol=1e-6)
    fixed = fitted(TARGETS, ending_at(TARGETS), moves_frame=False).frame_at(np.array([1.0, 2.0]))
    assert (*fixed.shift_m, fixed.stretch, fixed.slowdown) == (0, 0, 1, 1)


def test_goals_that_are_not_affine_in_the_condition_are_met_in_the_mean():
    conditions, ends = np.array([[0.0], [1.0], [2.0]]), np.array([[0.0, 0.0], [0.0, 3.0], [0.0, 0.0]])
    found = fitted(conditions, ending_at(ends))
    assert_allclose([found.goal_at(row) for row in conditions], [[0, 1]] * 3, atol=1e-6)


def test_units_are_positive_for_every_condition():
    found = fitted(TARGETS, ending_at(TARGETS, np.array([0.1, 1.0, 0.2, 3.0]), np.array([0.5, 5.0, 2.0, 1.0])))
    for target in 10 * np.random.default_rng(2).normal(size=(20, 2)):
        assert found.frame_at(target).stretch > 0
        assert found.frame_at(target).slowdown > 0


def test_entries_that_never_change_have_no_say():
    conditions = np.array([[0.0, 5.0], [1.0, 5.0]])
    found = fitted(conditions, ending_at(np.zeros((2, 2))))
    assert found.context == 2
    assert_allclose(found.codes(np.array([1.0, 99.0])), found.codes(np.array([1.0, 5.0])))


def test_conditions_that_do_not_differ_are_refused():
    with pytest.raises(DatasetError, match="expected different ones"):
        fitted(np.ones((3, 2)), ending_at(np.zeros((3, 2))))


def test_a_condition_under_which_nothing_moves_is_refused():
    with pytest.raises(DatasetError, match="expected motion"):
        fitted(TARGETS, ending_at(TARGETS, sizes_m=np.array([0.1, 0.0, 0.1, 0.1])))


@pytest.mark.parametrize("wrong", [[1.0], [1.0, 2.0, 3.0], [np.nan, 1.0], [np.inf, 0.0], ["a", 1.0], []])
def test_a_condition_of_another_kind_is_refused_with_those_that_were_shown(wrong):
    with pytest.raises(InvalidSetting, match=r"rollout\.condition=.*expected 2 finite numbers \(c0, c1\), such as 0:"):
        fitted(TARGETS, ending_at(TARGETS)).checked(wrong, "rollout.condition")


def test_it_comes_back_from_plain_types():
    found = fitted(TARGETS, ending_at(TARGETS))
    assert Conditioning.from_document(found.document()) == found


def test_motions_are_alike_in_their_frames_and_carry_their_code():
    sizes_m, durations_s = np.array([0.1, 0.5, 0.2, 0.4]), np.array([1.0, 3.0, 2.0, 2.0])
    data, conditions = ending_at(TARGETS, sizes_m, durations_s), np.eye(4)
    conditioning = fitted(conditions, data)
    joint, geometry = with_conditions(data, conditions, conditioning)
    scale_m, duration_s = geometry.scale_m, geometry.duration_s
    assert geometry.goal == geometry.centre == (0.0,) * 6
    assert (scale_m, duration_s) == (pytest.approx(0.004**0.25), pytest.approx(12**0.25))
    for times, states, velocities, condition in zip(
        joint.times, joint.states, joint.velocities, conditions, strict=True
    ):
        assert_allclose(times / duration_s, np.linspace(0, 1, 5), atol=1e-6)
        assert_allclose(states[:, :2] / scale_m, np.stack([np.linspace(-2, 0, 5), np.zeros(5)], 1), atol=1e-5)
        assert_allclose(states[:, 2:] / scale_m, np.tile(conditioning.codes(condition), (5, 1)), atol=1e-6)
        assert_allclose(velocities, np.tile([2 * scale_m / duration_s, 0, 0, 0, 0, 0], (5, 1)), atol=1e-5)


def test_without_frames_states_stay_and_codes_are_as_long_as_the_demonstrations():
    data = ending_at(TARGETS)
    conditioning = fitted(TARGETS, data, moves_frame=False)
    still, of_still = with_conditions(data, TARGETS, conditioning)
    plain = Geometry.of(data)
    assert of_still.centre[:2] == plain.centre
    for states, original, target in zip(still.states, data.states, TARGETS, strict=True):
        assert_allclose(states[:, :2], original)
        assert_allclose(states[:, 2:], np.tile(conditioning.codes(target) * plain.scale_m, (5, 1)), atol=1e-6)


def test_labels_share_no_parameters():
    """What is learned of one label changes nothing of another: weights of the flow, matrix and time law."""
    data, conditions = ending_at(TARGETS, np.array([0.1, 0.5, 0.2, 0.4])), np.eye(4)
    joint, geometry = with_conditions(data, conditions, fitted(conditions, data))
    label = int(joint.states[2][0, 2:].argmax())
    model = models.build(
        ModelConfig(
            schema.FlowChart(layers=2), schema.LinearField(), schema.NoRegulariser(), 0, schema.LearnedTimeLaw()
        ),
        geometry,
    ).train()
    with torch.no_grad():
        for parameter in model.parameters():
            parameter.add_(0.1 * torch.randn(parameter.shape, generator=torch.Generator().manual_seed(0)))
    alone = TrajectoryReproduction(joint.select([2]), geometry, schema.TrajectoryTraining(weight_penalty=0.0))
    sum(alone(model, 0.9, torch.Generator().manual_seed(0)).values()).backward()
    flow = model.chart.chart.outer
    gradients = (
        model.field.symmetric_roots.grad,
        model.field.skew_roots.grad,
        model.time_law.raw_speeds.grad,
        flow.weight.grad.unflatten(-1, (4, -1)).movedim(-2, 0),
    )
    for gradient in gradients:
        touched = gradient.flatten(1).norm(dim=1) > 1e-8
        assert touched.nonzero().flatten().tolist() == [label]


def test_surroundings_are_those_of_demonstrated_conditions():
    data, conditions = ending_at(TARGETS, np.array([0.1, 0.5, 0.2, 0.4])), np.eye(4)
    joint, geometry = with_conditions(data, conditions, fitted(conditions, data, moves_frame=False))
    drawn = Surroundings(joint, 0.1, geometry.context).draw(40, torch.Generator().manual_seed(0))
    for states in joint.states:
        own = drawn[(drawn[:, 2:] == states[0, 2:]).all(1), 0]
        assert len(own) == 10
        length = states[-1, 0] - states[0, 0]
        assert states[0, 0] - 0.1 * length <= own.min() < own.max() <= states[-1, 0] + 0.1 * length
