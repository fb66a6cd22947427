"""Fields with conditions through all stages: what is written, asked for and refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from geomotion.demos import storage
from geomotion.errors import InvalidSetting
from geomotion.stages.commands import run_verb

LETTERS = [
    "dataset=letters/l", "dataset.further_letters=[v]", "dataset.condition=shape", "dataset.demos=4",
    "dataset.points=40",
]  # fmt: skip
TO_TARGETS = [
    "dataset=letters/l", "dataset.condition=target", "dataset.targets_m=[[0,0],[0.03,0.01],[0,0.03]]",
    "dataset.demos=3", "dataset.points=40",
]  # fmt: skip
TOY = [
    "chart.layers=2", "chart.features=8", "training.steps=40", "evaluation.region_steps=30",
    "evaluation.region_starts=4", "evaluation.contraction_grid_points=4",
]  # fmt: skip


@pytest.fixture(scope="module")
def ncds(_empty_store, tmp_path_factory):
    import shutil

    root = tmp_path_factory.mktemp("conditions") / "runs"
    shutil.copytree(_empty_store, root)

    def call(verb, *overrides):
        typed = [*overrides, f"tracking.root={root}"]
        with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
            return run_verb(verb, OmegaConf.to_object(compose("ncds", overrides=typed)), typed)

    return call


@pytest.fixture(scope="module")
def letters(ncds):
    return ncds("train", *LETTERS, *TOY).document["stages"]["train"]["run_id"]


@pytest.fixture(scope="module")
def to_targets(ncds):
    return ncds("train", *TO_TARGETS, *TOY).document["stages"]["train"]["run_id"]


@pytest.fixture(scope="module")
def judged(ncds, letters):
    """Among an obstacle."""
    sphere = ["obstacle=sphere", "obstacle.centre_m=[0.02,0.05]", "obstacle.radius_m=0.01"]
    return ncds("eval", f"run={letters}", *sphere, *TOY[3:], "evaluation.nearby_starts=2")


def folder(result, stage) -> Path:
    return Path(result.document["stages"][stage]["folder"])


def test_each_condition_is_judged_and_all_together(judged):
    scores = judged.document["scores"]
    assert [(one["name"], one["condition"]) for one in scores["conditions"]] == [
        ("l", {"l": 1.0, "v": 0.0}),
        ("v", {"l": 0.0, "v": 1.0}),
    ]
    each = [one["scores"]["train.dtwd_per_point"]["value"] for one in scores["conditions"]]
    assert scores["scores"]["train.dtwd_per_point"]["value"] == pytest.approx(np.mean(each))
    assert scores["scores"]["nearby.claimed.bound_excess"]["value"] < 1e-3
    assert scores["scores"]["contraction.claimed.non_contracting_fraction"]["value"] == 0
    certificate = judged.document["certificate"]
    assert certificate["claim"] == "by_construction"
    assert "every condition" in certificate["reason"]
    for name in ("0_l", "1_v"):
        with np.load(folder(judged, "evaluate") / "conditions" / name / "evaluation.npz", allow_pickle=False) as arrays:
            assert {"demo_3", "rollout_3", "field_velocity"} <= set(arrays.files)
    for name in ("motion", "eigenvalues"):
        assert (folder(judged, "evaluate") / "figures" / f"{name}.png").is_file()
    assert "held-out DTWD" in judged.text


def test_obstacles_are_judged_under_each_condition(judged):
    scores, measured = judged.document["scores"], judged.document["certificate"]["obstacles"]["measured"]
    each = [one["scores"]["obstacles.passage.clearance"]["value"] for one in scores["conditions"]]
    assert len(each) == 2
    assert scores["scores"]["obstacles.passage.clearance"]["value"] == min(each) > -1e-3  # mm
    assert measured["obstacles.passage.clearance"] == min(each)
    assert set(measured) == {name for name in scores["scores"] if name.startswith("obstacles.")}


def test_the_equilibrium_is_where_each_condition_s_demonstrations_end(judged):
    for one in judged.document["scores"]["conditions"]:  # an affine x*(c) meets both ends
        for name in ("speed_at_goal", "goal_distance", "end_distance"):
            assert one["scores"][f"equilibrium.{name}"]["value"] < 1e-3


def test_a_demonstration_s_rollout_has_its_own_condition(ncds, letters):
    (first, last) = ncds("rollout", f"run={letters}", "rollout.demos=[0,4]").document["rollouts"]["rollouts"]
    assert (first["condition"], last["condition"]) == ([1.0, 0.0], [0.0, 1.0])
    assert first["switches"] == []


def test_a_target_that_nobody_showed_is_reached(ncds, to_targets):
    result = ncds(
        "rollout", f"run={to_targets}", "rollout.condition=[0.02,0.02]", "rollout.demos=[0]", "rollout.duration_s=30"
    )
    (row,) = result.document["rollouts"]["rollouts"]
    assert row["goal_m"] == pytest.approx([0.02, 0.02], abs=1e-6)
    assert row["reached_goal"]


def test_the_condition_may_change_on_the_way(ncds, to_targets):
    switches = "rollout.switches=[{time_s:0.5,condition:[0.03,0.01]},{time_s:1.0,condition:[0,0.03]}]"
    result = ncds(
        "rollout", f"run={to_targets}", "rollout.demos=[0]", "rollout.duration_s=40", "rollout.points=401", switches
    )
    (row,) = result.document["rollouts"]["rollouts"]
    assert [change["time_s"] for change in row["switches"]] == [0.5, 1.0]
    for change in row["switches"]:
        assert change["at_end"] <= change["bound_at_end"] * (1 + 1e-4) + 1e-6
    assert row["goal_m"] == pytest.approx([0, 0.03], abs=1e-6)
    assert row["reached_goal"]
    (path,) = storage.load(folder(result, "rollout") / "rollouts").trajectories
    assert len(path) == 401
    steps = np.linalg.norm(np.diff(path.channels["position_m"], axis=0), axis=1)
    speeds = np.linalg.norm(path.channels["velocity_m_per_s"], axis=1)
    assert steps.max() <= 0.1 * 2 * speeds.max()  # the state is continuous where the velocity is not


def test_obstacles_stand_in_the_way_of_every_phase(ncds, to_targets):
    around = ["obstacle=sphere", "obstacle.centre_m=[0.02,0.05]", "obstacle.velocity_m_per_s=[0,0.01]"]
    result = ncds(
        "rollout", f"run={to_targets}", "rollout.demos=[0]", *around, "obstacle.radius_m=0.01",
        "rollout.switches=[{time_s:0.5,condition:[0.03,0.01]}]",
    )  # fmt: skip
    (row,) = result.document["rollouts"]["rollouts"]
    assert row["clearance_m"] > -1e-6
    assert "bound_at_end" not in row["switches"][0]


MISFITS = {
    "rollout.condition=[1,0,0]": "expected 2 finite numbers (l, v), such as l: [1.0, 0.0]; v: [0.0, 1.0]",
    "rollout.condition=[nan,0]": "expected a list of finite numbers",
    "rollout.starts_m=[[0.1,0.1]]": "rollout.condition=[] is not valid",
    "rollout.switches=[{time_s:1.0,condition:[1]}]": "rollout.switches.condition=[1] is not valid",
}


@pytest.mark.parametrize("override", MISFITS)
def test_conditions_that_do_not_fit_are_refused(ncds, letters, override):
    with pytest.raises(InvalidSetting) as refusal:
        ncds("rollout", f"run={letters}", override)
    assert MISFITS[override] in str(refusal.value)


@pytest.mark.parametrize(
    "switches", ["[{time_s:1.0}]", "[{time_s:2.0,condition:[1,0]},{time_s:1.0,condition:[1,0]}]", "[1]"]
)
def test_changes_that_say_nothing_are_refused(ncds, letters, switches):
    with pytest.raises(InvalidSetting, match=r"rollout\.switches"):
        ncds("rollout", f"run={letters}", f"rollout.switches={switches}")


def test_a_field_without_conditions_takes_none(ncds):
    ncds("train", "dataset=letters/l", "dataset.demos=3", "dataset.points=40", *TOY, "training.steps=1")
    with pytest.raises(InvalidSetting, match="knows no conditions"):
        ncds("rollout", "run=latest", "rollout.condition=[1,0]")


@pytest.mark.usefixtures("without_shape_checks")
def test_the_thesis_field_is_learned_exported_and_reported_with_labels(ncds):
    import mlflow

    thesis = ["field=line_integral", "field.skew=true", "regulariser=state_dependent", "regulariser.hidden_units=[6]"]
    thesis += ["chart=identity", "training=velocity"]
    result = ncds(
        "run", *LETTERS[:2], "dataset.condition=label", *LETTERS[3:], *thesis, "field.hidden_units=[8]", *TOY[2:],
    )  # fmt: skip
    policy = json.loads((folder(result, "export") / "policy.json").read_text())
    assert policy["inputs"]["condition"] == {"shape": ["batch", 1], "unit": "1"}
    assert policy["condition"] == ["label"]
    assert policy["demonstrated"]["v"]["condition"] == [1.0]
    assert policy["max_difference_to_torch"]["velocity_m_per_s"] < 1e-5
    page = (folder(result, "report") / "report.html").read_text()
    assert "Conditions" in page
    mlflow.set_tracking_uri(f"sqlite:///{folder(result, 'export').parents[2]}/mlflow.db")
    model = mlflow.pyfunc.load_model(f"runs:/{result.document['stages']['export']['run_id']}/policy")
    asked = {"state_m": np.zeros((3, 2), np.float32), "condition": np.zeros((3, 1), np.float32)}
    assert model.predict(asked)["velocity_m_per_s"].shape == (3, 2)
