import json
import re
from base64 import b64decode

import numpy as np
import pandas as pd
import pytest

from geomotion.errors import CorruptArtefact, MissingArtefact
from geomotion.stages.ingest import SKELETON
from geomotion.stages.report import ReportConfig, report
from geomotion.tracking import Artefacts, StageRun

HOSTILE = "<script>alert('x')</script> & \"quoted\""
BY_CONSTRUCTION = {
    "claim": "by_construction",
    "metric": "M(x) = Dψ(x)ᵀDψ(x)",
    "rate_per_s": 0.8,
    "reason": "sym A ≼ -τI for every value of the parameters",
    "overshoot": {"median": 2.1, "worst": 7.4},
    "audit": {},
}
MEASURED = BY_CONSTRUCTION | {"claim": "measured_only", "rate_per_s": None, "overshoot": None}


def stage_run(folder):
    """A run whose tracking is never asked for anything."""
    return StageRun(folder, folder / "checkpoint", client=None, run_id="run-of-report")


def picture(name, width_px):
    """The beginning of a PNG, as far as its width."""
    return b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR" + width_px.to_bytes(4, "big") + name.encode()


def arrays(dim=2, held_out=True):
    """Straight lines to the origin, and eigenvalues of which a quarter is positive."""
    times = np.linspace(0, 2, 50)
    line = np.linspace(1, 0, 50)[:, None] * np.linspace(0.1, 0.05, dim)
    eigenvalues = np.where(np.arange(16) < 4, 0.5, -1.0)
    subsets = ["train", "test"] if held_out else ["train"]
    judged = {
        f"{name}_{number}": values
        for number, subset in enumerate(subsets)
        for name, values in {"demo": line, "rollout": line, "time": times, "set": np.array(subset)}.items()
    }
    x, y = np.meshgrid(np.linspace(0, 0.1, 4), np.linspace(0, 0.1, 4))
    plane = np.stack([x.ravel(), y.ravel()], axis=1)
    return judged | {
        "grid_points": plane if dim == 2 else np.zeros((16, dim)),
        "grid_shape": np.array([4, 4] if dim == 2 else []),
        "true_eigenvalue": eigenvalues,
        "claimed_eigenvalue": np.full(16, -1.0),
        "jhat_eigenvalue": np.empty(0),
        "nearby_time": times,
        "nearby_euclidean": np.exp(-times),
        "nearby_claimed": np.exp(-1.5 * times),
        "nearby_bound": np.exp(-times),
    }


def scores():
    def score(value, unit, **more):
        return {
            "value": value,
            "unit": unit,
            "count": 5,
            "spread": 0.25,
            "statistic": "mean",
            "values": [],
            "note": "",
            **more,
        }

    return {
        "protocol": "heldout",
        "dataset": "letters/j",
        "scores": {
            "train.dtwd_per_point": score(1.881, "mm", note="per point"),
            "train.relative_velocity_error": score(0.31, "1", statistic="pooled"),
            "train.dtwd_to_nearest_demo": score(3.6, "mm", note="baseline: nearest other demonstration"),
            "heldout.dtwd_per_point": score(2.82, "mm", count=2, note="per point"),
            "heldout.end_point_error": score(None, "mm", spread=None, count=2),
            "contraction.true.rate": score(12.5, "1/s", statistic="max", count=16),
            "contraction.true.non_contracting_fraction": score(0.25, "1", statistic="share", count=16, spread=0.0),
        },
        "omitted": {"contraction.jhat": "only a line-integral field has one"},
    }


def summary(**changes):
    demos = [{"demo": 0, "label": "", "set": "train", "points": 50, "duration_s": 2.0}]
    document = {
        "name": "letters/j",
        "space": "R2",
        "frame": "paper",
        "source": "generated",
        "licence": "MIT",
        "demos": demos,
    }
    return document | {"steps": ["dropped 15 points at each start"]} | changes


def write(path, document):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(document))


@pytest.fixture
def stages(tmp_path):
    """Builds the artefacts of the stages before the report."""

    def build(certificate=BY_CONSTRUCTION, evaluation=None, demonstrations=None, rollouts=True):
        evaluation = arrays() if evaluation is None else evaluation
        folders = {name: tmp_path / name for name in ("ingest", "train", "rollout", "evaluate")}
        write(folders["ingest"] / "summary.json", summary() if demonstrations is None else demonstrations)
        write(folders["ingest"] / "config.json", {"kind": "LettersDataset", "letter": "j"})
        folders["train"].mkdir()
        curves = pd.DataFrame({"step": [0, 20], "total": [1.0, 0.125], "learning_rate": [5e-3, 0.0]})
        curves.to_csv(folders["train"] / "training.csv", index=False)
        write(folders["train"] / "config.json", {"seed": 7, "model": {"field": {"kind": "LinearField"}}})
        row = {
            "start": "demonstration 0",
            "duration_s": 2.0,
            "points": 50,
            "outcome": "reached",
            "unit": ["mm", 1000.0],
            "distance_to_goal_m": 0.0015,
        }
        write(folders["rollout"] / "rollouts.json", {"rollouts": [row]})
        write(folders["evaluate"] / "certificate.json", certificate)
        write(folders["evaluate"] / "scores.json", scores())
        write(folders["evaluate"] / "environment.json", {"code": "0.1.0+abc", "torch": "2.13.0"})
        np.savez(folders["evaluate"] / "evaluation.npz", **evaluation)
        for stage, name in (("ingest", "demonstrations"), ("train", "training"), ("evaluate", "motion")):
            (folders[stage] / "figures").mkdir()
            (folders[stage] / "figures" / f"{name}.png").write_bytes(picture(name, width_px=400))
        kept = [name for name in folders if rollouts or name != "rollout"]
        return {name: Artefacts(name, f"run-of-{name}", folders[name], "d" * 64) for name in kept}

    return build


def page_of(inputs, tmp_path, config=ReportConfig()):  # noqa: B008
    report(config, inputs, stage_run(tmp_path))
    return (tmp_path / "report.html").read_text(encoding="utf-8")


def text_of(page):
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", re.sub(r"(?s)<style>.*</style>", "", page)))


def test_page_asks_for_nothing_outside_itself(stages, tmp_path):
    page = page_of(stages(), tmp_path)
    references = re.findall(r"(?:src|href|action|data|srcset)\s*=\s*[\"']([^\"']*)", page)
    assert len(references) == 3
    for reference in references:
        kind, _, content = reference.partition(",")
        assert kind == "data:image/png;base64"
        assert b64decode(content).startswith(b"\x89PNG")
    assert not re.search(r"https?://|@import|url\(|<script|<link|<iframe", page)


@pytest.mark.parametrize("has_skeleton", [True, False])
def test_why_no_person_is_drawn_is_said(stages, tmp_path, has_skeleton):
    inputs = stages()
    write(inputs["ingest"].folder / "config.json", {"kind": "MmmDataset"})
    if has_skeleton:
        write(inputs["ingest"].folder / SKELETON, {"nodes": []})
    text = text_of(page_of(inputs, tmp_path))
    assert ("the skill has no joints" in text, "beside the recording" in text) == (has_skeleton, not has_skeleton)


def test_pictures_are_shown_at_one_scale(stages, tmp_path):
    """All were saved with 200 dots per inch and are shown with 130."""
    assert page_of(stages(), tmp_path).count('width="260"') == 3


def test_page_shows_scores_beside_their_baselines_with_spread_and_count(stages, tmp_path):
    text = text_of(page_of(stages(), tmp_path)).partition("Scores")[2]
    assert "1.88 ± 0.25 mm n = 5" in text
    rows = ["DTWD, per point", "nearest other demonstration instead", "Relative velocity error"]
    assert sorted(rows, key=text.index) == rows
    assert "not finite" in text
    assert "25 % of 16" in text
    assert "12.5 1/s max, n = 16, standard deviation 0.25" in text


def test_verdict_by_construction_names_rate_and_what_is_measured(stages, tmp_path):
    page = page_of(stages(), tmp_path)
    assert 'class="verdict proven"' in page
    text = text_of(page)
    assert "Contracting by construction" in text
    assert "rate 0.8 1/s" in text
    assert "25.0% of 16 points" in text


def test_verdict_of_a_measured_field_promises_nothing(stages, tmp_path):
    page = page_of(stages(certificate=MEASURED), tmp_path)
    assert 'class="verdict measured"' in page
    text = text_of(page)
    assert "No guarantee" in text
    assert "At 25.0% of the 16 points" in text
    assert "by construction" not in text.partition("What was learned")[0]


def test_verdict_of_a_verified_box_says_where_it_ends(stages, tmp_path):
    shares = {f"verification.{name}": value for name, value in (("contracting", 1.0), ("not_contracting", 0.0))}
    changes = {"claim": "verified_on_set", "overshoot": {"median": 1.0, "worst": 1.0, "bound": 1.0}, "audit": shares}
    text = text_of(page_of(stages(certificate=BY_CONSTRUCTION | changes), tmp_path))
    assert "as long as both stay inside a box" in text
    assert "halves at least every 0.87 s" in text
    assert "Outside the box nothing is proven" in text
    assert "metric that was learned" not in text
    assert "contracting 100%, not contracting 0%" in text


def test_verdict_says_when_the_measurement_contradicts_the_claim(stages, tmp_path):
    page = page_of(stages(evaluation=arrays() | {"claimed_eigenvalue": np.full(16, 0.1)}), tmp_path)
    assert 'class="verdict contradicted"' in page
    assert "disagree" in text_of(page)


def test_names_from_outside_are_escaped(stages, tmp_path):
    demonstrations = summary(source=HOSTILE, licence=HOSTILE, frame=HOSTILE, steps=[HOSTILE])
    inputs = stages(certificate=BY_CONSTRUCTION | {"reason": HOSTILE}, demonstrations=demonstrations)
    page = page_of(inputs, tmp_path, ReportConfig(title=HOSTILE, command=HOSTILE))
    assert "<script" not in page
    assert page.count("&lt;script&gt;") >= 7


def test_state_of_four_dimensions_without_rollouts_and_held_out_demonstrations_says_what_is_missing(stages, tmp_path):
    page = page_of(stages(evaluation=arrays(dim=4, held_out=False), rollouts=False), tmp_path)
    text = text_of(page).partition("Not on this page")[2]
    assert "the state has 4 dimensions" in text
    assert "Held-out demonstrations none were judged" in text
    assert "the rollout stage was not run" in text


def test_page_carries_configuration_runs_versions_and_command(stages, tmp_path):
    text = text_of(page_of(stages(), tmp_path, ReportConfig(command="ncds run dataset=letters/j seed=7")))
    for expected in (
        "ncds run dataset=letters/j seed=7",
        "letter: j",
        "run-of-train",
        "2.13.0",
        "Seed 7",
        "LinearField",
    ):
        assert expected in text


def test_missing_and_damaged_inputs_are_named_and_nothing_is_written(stages, tmp_path):
    inputs = stages()
    (inputs["evaluate"].folder / "scores.json").write_text("{")
    with pytest.raises(CorruptArtefact, match=r"scores\.json"):
        report(ReportConfig(), inputs, stage_run(tmp_path / "report"))
    (inputs["ingest"].folder / "summary.json").unlink()
    with pytest.raises(MissingArtefact, match=r"summary\.json"):
        report(ReportConfig(), inputs, stage_run(tmp_path / "report"))
    assert not (tmp_path / "report").exists()
