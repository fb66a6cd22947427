"""Overrides: every offered choice composes, and every mistake gets one line that says what was meant."""

import json
from types import SimpleNamespace

import pytest
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from geomotion_cli.choices import CONFIG_TYPES, program_options
from geomotion_cli.dispatch import main

OPTIONS = [
    (program, f"{group}={option}")
    for program in CONFIG_TYPES
    for group, options in program_options(program).items()
    for option in options
]
CHOICES = {choice for _, choice in OPTIONS}

NEEDED = {  # what has no default
    "dataset=folder": ["dataset.root=recordings"],
    "dataset=mmm": ["dataset.path=walk.xml"],
    "experiment=thesis/fig_6_14": ["dataset.path=walk.xml"],
    "experiment=thesis/fig_6_15": ["dataset.path=walk.xml"],
    "dataset=robotasks9/other": ["dataset.task=navigation", "dataset.root=recordings"],
    "dataset=robotasks9_joint/other": ["dataset.task=navigation", "dataset.root=recordings"],
    "dataset=comanipulation/other": ["dataset.symbol=3", "dataset.root=recordings"],
    "field=custom": ["field.target=torch.nn.Linear"],
    "obstacle=sphere": ["obstacle.centre_m=[0,0]", "obstacle.radius_m=1"],
    "obstacle=ellipsoid": ["obstacle.centre_m=[0,0]", "obstacle.semi_axes_m=[1,2]"],
    "obstacle=box": ["obstacle.centre_m=[0,0]", "obstacle.sides_m=[1,2]"],
    "obstacle=polygon": ["obstacle.centre_m=[0,0]", "obstacle.vertices_m=[[0,0],[1,0],[0,1]]"],
    "obstacle=mesh": ["obstacle.file=duck.obj"],
    "obstacle=point_cloud": ["obstacle.file=scan.npy"],
    "obstacle=several": ["obstacle.bodies=[{shape:sphere,centre_m:[0,0],radius_m:1}]"],
}


@pytest.fixture
def configuration():
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        yield


@pytest.mark.parametrize(("program", "choice"), OPTIONS)
def test_every_choice_makes_a_typed_configuration(configuration, program, choice):
    config = OmegaConf.to_object(compose(program, overrides=[choice, *NEEDED.get(choice, ())]))
    assert type(config) is CONFIG_TYPES[program]


def test_choices_include_sub_folders_and_no_internals():
    assert {"dataset=lasa/angle", "dataset=folder", "experiment=thesis/ncds", "field=linear"} <= CHOICES
    assert ("gms", "experiment=thesis/fig_3_1") in OPTIONS
    assert ("ncds", "experiment=thesis/fig_3_1") not in OPTIONS
    assert not [option for option in CHOICES if option.endswith("_schema")]


MISTAKES = {
    "chart.layrs=3": "unknown setting 'chart.layrs'. Did you mean 'chart.layers'?",
    "fild=linear": "unknown setting 'fild'. Did you mean 'field'?",
    "experimnt=thesis/ncds": "unknown setting 'experimnt'. Did you mean 'experiment'?",
    "learning_rate=0.1": "unknown setting 'learning_rate'. Did you mean 'training.learning_rate'?",
    "dataset.preprocess.velocty=recorded": "Did you mean 'dataset.preprocess.velocity'?",
    "+chart.layrs=3": "unknown setting 'chart.layrs'. Did you mean 'chart.layers'?",
    "++colour=red": "unknown setting 'colour'.",
    "dataset=lasa/angel": "unknown dataset 'lasa/angel'. Did you mean 'lasa/angle'?",
    "dataset=lasas/angle": "Did you mean 'lasa/angle'?",
    "field=liner": "unknown field 'liner'. Did you mean 'linear'? Available: custom, elcd, embedded,",
    "experiment=thesis/ncd": "unknown experiment 'thesis/ncd'. Did you mean 'thesis/ncds'?",
    "hydra/launcher=bsic": "unknown hydra/launcher 'bsic'. Did you mean 'basic'?",
    "chart.layers=many": "chart.layers: Value 'many' of type 'str' could not be converted to Integer",
    "chart.layers=-1": "chart.layers=-1 is not valid: expected a number above 0.",
    "output=xml": "output: Invalid value 'xml', expected one of [text, json]",
    "seed=null": "seed: field 'seed' is not Optional",
    "seed=1,2": "Ambiguous value for argument 'seed=1,2'",
    "chart.layers": "cannot read 'chart.layers': missing EQUAL at '<EOF>'; settings are written key=value.",
    "chart=[a": "cannot read 'chart=[a'",
    "dataset=folder": "dataset.root has no value; set it with dataset.root=…",
    "tracking.root=${nowhere}": "Interpolation key 'nowhere' not found",
    "--debg": "unknown flag '--debg'. Did you mean '--debug'?",
    "--cfg=nothing": "argument --cfg/-c: invalid choice: 'nothing'",
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_gets_one_helpful_line_and_status_two(command, mistake):
    answer = command("train", mistake)
    assert (answer.status, answer.out) == (2, "")
    assert answer.err.startswith("ncds train: error: ")
    assert MISTAKES[mistake] in answer.err
    assert answer.err.count("\n") == 1
    assert "HYDRA_FULL_ERROR" not in answer.err


def test_a_preset_of_the_other_program_is_named_as_such(command):
    answer = command("train", "dataset=robotasks9/pouring", "space=R3xSO3", program="gms")
    assert (answer.status, answer.out) == (2, "")
    assert "space=R3xSO3 is a choice of ncds" in answer.err
    assert "gms has demonstrated, joint, pose." in answer.err


@pytest.mark.parametrize("run", ["12e45678", "0123456e", "1234567890"])
def test_the_beginning_of_a_run_id_is_not_taken_for_a_number(monkeypatch, tmp_path, undisturbed, run):
    named = []

    def run_verb(verb, config, overrides):
        named.extend([config.run, *config.runs])
        return SimpleNamespace(text="", document={}, exit_code=0, objective=None)

    monkeypatch.chdir(tmp_path)
    assert main("ncds", ["eval", f"run={run}", f"runs=[{run},latest]"], run_verb) == 0
    assert named == [run, run, "latest"]


@pytest.mark.parametrize("mistake", ["chart.layrs=3,4", "dataset=lasa/angel,lasa/sine"])
def test_a_sweep_with_a_mistake_does_not_start(command, mistake):
    answer = command("train", "-m", mistake)
    assert (answer.status, answer.out) == (2, "")
    assert "Did you mean" in answer.err
    assert answer.err.count("\n") == 1


def test_mistakes_are_documents_too(command):
    answer = command("train", "chart.layrs=3", "output=json")
    assert json.loads(answer.out)["error"]["type"] == "UsageError"
    assert json.loads(command("trian", "output=json").out)["error"]["type"] == "UsageError"


def test_debug_shows_where_a_mistake_was_found(command):
    assert "Traceback" in command("train", "chart.layrs=3", "--debug").err
