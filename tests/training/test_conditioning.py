import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from geomotion.errors import DatasetError, InvalidSetting
from geomotion.training.conditioning import Conditioning, with_conditions
from geomotion.training.data import Geometry, TrainingSet

TARGETS = np.array([[0.0, 0.0], [0.2, 0.1], [-0.1, 0.3], [0.1, 0.1]])


def fitted(conditions: np.ndarray, ends: np.ndarray, follows_goal: bool = True) -> Conditioning:
    distinct = {str(number): tuple(row) for number, row in enumerate(np.unique(conditions, axis=0).tolist())}
    names = [f"c{axis}" for axis in range(conditions.shape[1])]
    return Conditioning.fit(names, distinct, conditions, ends, follows_goal)


@pytest.mark.parametrize("shapes", [2, 3, 7])
def test_labels_lose_no_end_point_and_need_one_number_less_than_there_are(shapes):
    conditions = np.repeat(np.eye(shapes), 3, axis=0)
    ends = np.random.default_rng(0).normal(size=(shapes, 2)).repeat(3, axis=0)
    found = fitted(conditions, ends)
    assert found.context == shapes - 1
    codes = found.codes(np.eye(shapes))
    assert_allclose(np.linalg.norm(codes, axis=1), 1)
    between = np.linalg.norm(codes[:, None] - codes, axis=-1)[~np.eye(shapes, dtype=bool)]
    assert_allclose(between, between[0])  # all labels are equally far from each other
    assert_allclose([found.goal_at(row) for row in np.eye(shapes)], ends[::3], atol=1e-12)


def test_the_goal_is_the_target_where_the_condition_is():
    found = fitted(TARGETS, TARGETS)
    for target in np.array([[0.05, -0.2], [1.0, 2.0]]):
        assert_allclose(found.goal_at(target), target, atol=1e-12)
        assert_allclose(found.shift_at(target), target - found.goal, atol=1e-12)
    assert np.linalg.norm(found.codes(TARGETS), axis=1).max() == pytest.approx(1)
    assert_allclose(fitted(TARGETS, TARGETS, follows_goal=False).shift_at(np.array([1.0, 2.0])), 0)


def test_goals_that_are_not_affine_in_the_condition_are_met_in_the_mean():
    conditions, ends = np.array([[0.0], [1.0], [2.0]]), np.array([[0.0, 0.0], [0.0, 3.0], [0.0, 0.0]])
    assert_allclose([fitted(conditions, ends).goal_at(row) for row in conditions], [[0, 1]] * 3, atol=1e-12)


def test_entries_that_never_change_have_no_say():
    conditions = np.array([[0.0, 5.0], [1.0, 5.0]])
    found = fitted(conditions, np.zeros((2, 2)))
    assert found.context == 1
    assert_allclose(found.codes(np.array([1.0, 99.0])), found.codes(np.array([1.0, 5.0])))


def test_conditions_that_do_not_differ_are_refused():
    with pytest.raises(DatasetError, match="expected different ones"):
        fitted(np.ones((3, 2)), np.zeros((3, 2)))


@pytest.mark.parametrize("wrong", [[1.0], [1.0, 2.0, 3.0], [np.nan, 1.0], [np.inf, 0.0], ["a", 1.0], []])
def test_a_condition_of_another_kind_is_refused_with_those_that_were_shown(wrong):
    with pytest.raises(InvalidSetting, match=r"rollout\.condition=.*expected 2 finite numbers \(c0, c1\), such as 0:"):
        fitted(TARGETS, TARGETS).checked(wrong, "rollout.condition")


def test_it_comes_back_from_plain_types():
    found = fitted(TARGETS, TARGETS)
    assert Conditioning.from_document(found.document()) == found


def test_states_carry_their_code_and_end_at_one_goal():
    times = torch.linspace(0, 1, 5)
    paths = [torch.tensor(target, dtype=torch.float32) * times[:, None] + 0.3 for target in TARGETS]
    data = TrainingSet((times,) * 4, tuple(paths), tuple(torch.ones(5, 2) for _ in paths))
    conditioning = fitted(TARGETS, TARGETS + 0.3)
    joint, geometry = with_conditions(data, TARGETS, conditioning)
    assert geometry.context == 2
    ends = torch.stack([states[-1, :2] for states in joint.states])
    assert_allclose(ends, ends[:1].expand(4, -1), atol=1e-6)
    assert_allclose(geometry.goal, [*ends[0].tolist(), 0, 0], atol=1e-6)
    assert geometry.centre == geometry.goal
    for states, velocities, target in zip(joint.states, joint.velocities, TARGETS, strict=True):
        assert_allclose(states[:, 2:], np.tile(conditioning.codes(target) * geometry.scale_m, (5, 1)), atol=1e-6)
        assert_allclose(velocities[:, 2:], 0)
    still, of_still = with_conditions(data, TARGETS, fitted(TARGETS, TARGETS + 0.3, follows_goal=False))
    assert_allclose(still.states[1][:, :2], data.states[1])
    assert of_still.centre[:2] == Geometry.of(data).centre
