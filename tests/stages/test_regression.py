import json
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from geomotion.config import CheckConfig
from geomotion.errors import InvalidSetting, MissingData
from geomotion.stages.regression import check

BASELINE = {
    "scores": {
        "train.dtwd_per_point": {"value": 1.0, "better": "lower", "tolerance": 0.1, "reason": "other processors"},
        "region.steps_inside": {"value": 100.0, "better": "higher", "tolerance": 5.0, "reason": "other processors"},
    }
}


@pytest.fixture
def baseline(tmp_path) -> Path:
    path = tmp_path / "baseline.json"
    path.write_text(json.dumps(BASELINE))
    return path


def scores(dtwd: float | None, inside: float) -> dict:
    return {"scores": {"train.dtwd_per_point": {"value": dtwd}, "region.steps_inside": {"value": inside}}}


def verdicts(path: Path, found: dict) -> list[str]:
    return [row["verdict"] for row in check(CheckConfig(str(path)), found).document["rows"]]


def test_a_file_for_continuous_integration_names_what_got_worse_and_why_that_counts(baseline, tmp_path):
    report = tmp_path / "checks" / "letters.xml"
    check(CheckConfig(str(baseline), junit=str(report)), scores(1.2, 100.0))
    suite = ET.parse(report).getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    worse, fine = suite
    assert worse.get("name") == "train.dtwd_per_point" and "other processors" in worse.find("failure").text
    assert fine.find("failure") is None


def test_a_claim_that_is_lost_is_worse(tmp_path):
    path = tmp_path / "baseline.json"
    proven = {"claim": "by_construction", "rate_per_s": 0.5}
    check(CheckConfig(str(path), update=True), scores(1.0, 100.0), proven)
    assert check(CheckConfig(str(path)), scores(1.0, 100.0), proven).passed
    lost = check(CheckConfig(str(path)), scores(1.0, 100.0), {"claim": "measured_only", "rate_per_s": None})
    verdicts_of = {row["name"]: row["verdict"] for row in lost.document["rows"]}
    assert verdicts_of["certificate.proven"] == "worse" and verdicts_of["certificate.rate_per_s"] == "missing"


@pytest.mark.parametrize(
    ("dtwd", "inside", "expected", "passed"),
    [
        (1.0, 100.0, ["ok", "ok"], True),
        (1.09, 96.0, ["ok", "ok"], True),
        (0.5, 200.0, ["better", "better"], True),
        (1.2, 100.0, ["worse", "ok"], False),
        (1.0, 90.0, ["ok", "worse"], False),
        (None, 100.0, ["missing", "ok"], False),
    ],
)
def test_a_score_beyond_its_tolerance_fails_the_check(baseline, dtwd, inside, expected, passed):
    assert verdicts(baseline, scores(dtwd, inside)) == expected
    assert check(CheckConfig(str(baseline)), scores(dtwd, inside)).passed is passed


def test_a_score_that_is_gone_fails_the_check(baseline):
    assert not check(CheckConfig(str(baseline)), {"scores": {}}).passed


def test_updating_writes_the_new_values_and_keeps_the_reasons(baseline):
    verdict = check(CheckConfig(str(baseline), update=True), scores(2.0, 50.0))
    assert verdict.passed
    assert "worse" in verdict.text
    stored = json.loads(baseline.read_text())["scores"]
    assert stored["train.dtwd_per_point"] == BASELINE["scores"]["train.dtwd_per_point"] | {"value": 2.0}
    assert stored["region.steps_inside"]["value"] == 50.0


def test_a_baseline_has_to_be_named_and_to_exist(tmp_path):
    with pytest.raises(InvalidSetting, match=r"check\.baseline"):
        check(CheckConfig(), scores(1.0, 100.0))
    with pytest.raises(MissingData, match="missing"):
        check(CheckConfig(str(tmp_path / "missing.json")), scores(1.0, 100.0))


def test_updating_makes_a_baseline_where_there_is_none(tmp_path):
    path = tmp_path / "new.json"
    check(CheckConfig(str(path), update=True), scores(2.0, 50.0))
    assert verdicts(path, scores(2.1, 46.0)) == ["ok", "ok"]
    assert verdicts(path, scores(2.3, 44.0)) == ["worse", "worse"]
