"""Tab completion, asked as a shell asks."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(sys.executable).parent


@pytest.fixture
def offered(command, monkeypatch):
    """Words offered for a line typed so far."""

    def ask(line: str, point: int | None = None, shell: str = "bash") -> list[str]:
        monkeypatch.setenv("COMP_LINE", line)
        monkeypatch.setenv("COMP_POINT", str(len(line) if point is None else point))
        answer = command("-sc", f"query={shell}")
        assert (answer.status, answer.err) == (0, "")
        return answer.out.split("\n" if shell == "fish" else None)

    return ask


def test_verbs(offered):
    assert {"train", "eval", "check", "ui"} <= set(offered("ncds "))
    assert offered("ncds tr") == ["train"]
    assert offered("ncds help tr") == ["train"]
    assert offered("/somewhere/bin/ncds tr") == ["train"]
    assert offered("ncds trian da") == []


def test_settings_of_a_verb(offered):
    assert offered("ncds train chart.la") == ["chart.layers="]
    assert offered("ncds train -m --debug seed=1 chart.la") == ["chart.layers="]
    assert offered("ncds train see") == ["seed="]
    assert {"dataset=", "chart.", "experiment=", "seed="} <= set(offered("ncds train "))


def test_choices_of_a_group_with_sub_folders_and_earlier_values_of_a_sweep(offered):
    assert offered("ncds train dataset=lasa/spo") == ["dataset=lasa/spoon"]
    assert offered("ncds train field=linea") == ["field=linear"]
    assert "dataset=lasa/angle,letters/c" in offered("ncds train -m dataset=lasa/angle,let")
    assert offered("ncds train experiment=thesis/n") == ["experiment=thesis/ncds"]


def test_values_are_shown_as_they_are_written(offered):
    assert offered("ncds train output=") == ["output=text"]


def test_flags(offered):
    assert offered("ncds train --de") == ["--debug"]


def test_only_what_stands_before_the_cursor_counts(offered):
    assert offered("ncds tr dataset=letters/j", point=len("ncds tr")) == ["train"]


def test_fish_gets_lines(offered):
    assert offered("ncds re", shell="fish")[0] == "replay"


def test_an_unreadable_line_offers_nothing_and_says_nothing(offered):
    assert offered("ncds train --nonsense fi") == []


def test_bash_completes_verbs_settings_and_choices():
    if shutil.which("bash") is None:
        pytest.skip("bash is not installed")
    script = """
    eval "$(ncds -sc install=bash)"
    try() {
        COMP_LINE="$1" COMP_POINT=${#1} COMP_WORDS=($1) COMP_CWORD=$2
        hydra_bash_completion
        echo "${COMPREPLY[@]}"
    }
    complete -p ncds
    try "ncds tra" 1
    try "ncds train chart.la" 2
    try "ncds train dataset=lasa/spo" 2
    """
    environment = {**os.environ, "PATH": f"{SCRIPTS}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True, check=True)
    registered, *completions = done.stdout.splitlines()
    assert registered.endswith("-F hydra_bash_completion ncds")
    assert completions == ["train", "chart.layers=", "dataset=lasa/spoon"]
