"""The worked example of docs/methods.md: what stands there is written to files and typed."""

import json
import re
import shlex
from pathlib import Path

import pytest

PAGE = (Path(__file__).resolve().parents[2] / "docs/methods.md").read_text(encoding="utf-8")
EXAMPLE = PAGE.partition("## A method of your own")[2]
TOY = (
    "dataset.points=60", "training.steps=20", "chart.layers=2", "evaluation.region_steps=30",
    "evaluation.region_starts=9", "evaluation.contraction_grid_points=5", "evaluation.nearby_starts=1", "output=json",
)  # fmt: skip


def blocks(language: str) -> list[str]:
    found = re.findall(r"^```(\w*)\n(.*?)^```$", EXAMPLE, re.MULTILINE | re.DOTALL)
    return [text for name, text in found if name == language]


LINES = [line.removeprefix("PYTHONPATH=. ") for block in blocks("") for line in block.splitlines()]


@pytest.fixture
def example(folder, monkeypatch) -> Path:
    (code,), (settings,) = blocks("python"), blocks("yaml")
    (folder / "spiral.py").write_text(code)
    (folder / "settings/field").mkdir(parents=True, exist_ok=True)
    (folder / "settings/field/spiral.yaml").write_text(settings)
    monkeypatch.syspath_prepend(str(folder))
    return folder


def test_a_file_is_enough(example, here):
    plain = next(line for line in LINES if "field=custom" in line)
    answer = here(*shlex.split(plain), *TOY).done()
    certificate = answer.read("evaluate", "certificate.json")
    assert certificate["claim"] == "measured_only"
    assert certificate["reason"].startswith("Every motion comes to the goal at the learned rate.")


def test_a_configuration_gives_it_a_name(example, here):
    named = next(line for line in LINES if "ncds train" in line)
    answer = here(*shlex.split(named), *(item for item in TOY if not item.startswith("chart"))).done()
    assert answer.read("train", "config.json")["model"]["field"]["settings"] == {"turns": 0.5}


@pytest.mark.slow
def test_it_stands_in_a_study_beside_ours(example, here):
    study = next(line for line in LINES if "study" in line)
    answer = here(*shlex.split(study), *(item for item in TOY if not item.startswith("chart"))).done()
    assert [row["variant"] for row in answer.document["study"]["rows"]] == ["ours", "spiral"]


def test_a_model_of_another_file_is_refused(example, here):
    named = next(line for line in LINES if "ncds train" in line)
    toy = [item for item in TOY if not item.startswith("chart")]
    answer = here(*shlex.split(named), *toy).done()
    with (example / "spiral.py").open("a") as file:
        file.write("# changed\n")
    again = here("ncds", "eval", f"run={answer.run_id('train')}", "output=json")
    assert again.status == 2
    assert "it has changed since" in json.loads(again.out)["error"]["message"]


MISTAKES = {
    "field.target=nowhere.Field": "there is no module nowhere",
    "field.target=Field": "expected module.Class",
    "field.target=torch.nn.Linear": "expected what torch.nn.Linear takes",
    "field.target=spiral.torch": "derives from torch.nn.Module",
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_told_in_one_line(example, refused, mistake):
    command = ("ncds", "train", "dataset=letters/j", "dataset.points=60", "field=custom", mistake)
    refused(command, MISTAKES[mistake], "train", status=2)
