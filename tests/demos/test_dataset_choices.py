import pytest
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from geomotion.config import LASA_SHAPES, LETTERS, ROBOTASKS9_TASKS
from geomotion.demos.readers import read
from geomotion.errors import UnknownName

GENERATED = ("panda/reach_to_grasp", "panda/pouring_3x3", "generated/jc")
IN_JOINT_SPACE = ("panda/reach_to_grasp_joint", "panda/pouring_joint", "panda/circle_joint", "planar/s_curve")


def dataset(choice, *overrides):
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        return OmegaConf.to_object(compose("ncds", [f"dataset={choice}", *overrides]).dataset)


@pytest.mark.parametrize("shape", LASA_SHAPES)
def test_every_shape_has_a_choice_in_lower_case(shape):
    assert dataset(f"lasa/{shape.lower()}").shapes == [shape]


@pytest.mark.parametrize("task", ROBOTASKS9_TASKS)
def test_every_task_has_a_choice(task):
    assert dataset(f"robotasks9/{task}").task == task
    assert dataset(f"robotasks9_joint/{task}").name == f"robotasks9_joint/{task}"


@pytest.mark.parametrize("letter", LETTERS)
def test_every_letter_has_a_choice_and_can_be_read(letter):
    demonstrations = read(dataset(f"letters/{letter}", "dataset.demos=2"))
    assert demonstrations.name == f"letters/{letter}"


@pytest.mark.parametrize("choice", [*GENERATED, *IN_JOINT_SPACE])
def test_every_generated_motion_has_a_choice_and_can_be_read(choice):
    demonstrations = read(dataset(choice, "dataset.demos=1", "dataset.points=10"))
    assert (demonstrations.name, len(demonstrations[0])) == (choice, 10)


def test_datasets_of_joint_space_hold_out_every_solution():
    assert [dataset(choice).held_out for choice in IN_JOINT_SPACE] == [3, 3, 3, 2]
    assert dataset("panda/reach_to_grasp_joint", "dataset.elbow.solutions=2", "dataset.targets=[0,2]").held_out == 4
    assert dataset("robotasks9_joint/scoop").held_out == 6
    assert dataset("robotasks9_joint/scoop", "dataset.elbow.solutions=2").held_out == 4
    assert dataset("robotasks9_joint/scoop").state_channels == ["joints_rad"]


def test_one_of_every_group_is_held_out_however_many_are_asked_for():
    assert dataset("panda/pouring_3x3").test_demos == [15, 16, 17]
    assert dataset("panda/pouring_3x3", "dataset.demos=9").train_demos == [0, 1, 2, 3, 4, 5]
    assert dataset("panda/pouring_3x3", "dataset.demos=5").test_demos is None
    assert dataset("panda/pouring_3x3", "dataset.train_demos=[0]").test_demos is None


@pytest.mark.parametrize(("choice", "count"), [("stacked_4d", 2), ("stacked_8d", 4)])
def test_stacked_shapes_can_be_chosen_and_changed(choice, count):
    assert len(dataset(f"lasa/{choice}").shapes) == count
    assert dataset(f"lasa/{choice}", "dataset.shapes=[Line,Worm]").shapes == ["Line", "Worm"]


def test_settings_of_a_choice_can_be_changed():
    found = dataset(
        "lasa/angle", "dataset.preprocess.trim_start_points=3", "dataset.train_demos=null", "dataset.root=/x"
    )
    assert (found.preprocess.trim_start_points, found.train_demos, found.root) == (3, None, "/x")


def test_a_misspelt_shape_in_a_stack_is_met_with_the_closest_one():
    with pytest.raises(UnknownName, match="Did you mean 'Sine'"):
        dataset("lasa/stacked_4d", "dataset.shapes=[Angle,Sinee]")
