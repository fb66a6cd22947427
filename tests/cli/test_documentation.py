"""What README and docs/ tell people to type exists: commands compose, settings, scores and files are there."""

import re
import shlex
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

from geomotion.config import GmsConfig
from geomotion.figures.report.gms_scores import GEODESICS

REPOSITORY = Path(__file__).resolve().parents[2]
PAGES = [
    REPOSITORY / "README.md",
    *sorted((REPOSITORY / "docs").glob("*.md")),
    *sorted((REPOSITORY / "datasets").glob("*.md")),
]
BLOCK = re.compile(r"^```\n(.*?)^```$", re.MULTILINE | re.DOTALL)
IN_TABLE = re.compile(r"^\| [^|]+ \| `((?:gms|ncds) [^`…]+)` \|", re.MULTILINE)
LINK = re.compile(r"\]\((?!https?:)([^)#]*)(?:#([^)]*))?\)")
SETTING = re.compile(r"`((?:manifold|metric|graph|planning|robot)\.(?!json)[a-z_]+)(?:=|`)")


def commands() -> list[str]:
    """Each command line in a block of code, and those that stand whole in a column of a table."""
    texts = [page.read_text(encoding="utf-8") for page in PAGES]
    lines = [line for text in texts for block in BLOCK.findall(text) for line in block.splitlines()]
    lines += [line for text in texts[1:] for line in IN_TABLE.findall(text)]
    return list(dict.fromkeys(line for line in lines if line.startswith(("gms ", "ncds "))))


def anchors(text: str) -> set[str]:
    """What links to headings of a page are called."""
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("line", commands())
def test_documented_commands_are_understood(command, line):
    program, *arguments = shlex.split(line, comments=True)
    answer = command(*arguments, program=program)
    assert answer.status == 0, answer.err


def test_both_programs_are_documented():
    assert len([line for line in commands() if line.startswith("gms ")]) > 10
    assert len([line for line in commands() if line.startswith("ncds ")]) > 5


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_documented_settings_of_gms_exist(page):
    groups = {item.name: item.default_factory for item in fields(GmsConfig)}
    for setting in SETTING.findall(page.read_text(encoding="utf-8")):
        group, name = setting.split(".")
        assert is_dataclass(groups[group])
        assert name in {item.name for item in fields(groups[group])}, f"{setting} in {page.name}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target, heading in LINK.findall(page.read_text(encoding="utf-8")):
        file = (page.parent / target) if target else page
        assert file.exists(), f"{target} in {page.name}"
        assert not heading or heading in anchors(file.read_text(encoding="utf-8")), f"#{heading} in {page.name}"


def test_scores_of_geodesics_are_explained_under_the_names_that_reports_know():
    text = (REPOSITORY / "docs/scores.md").read_text(encoding="utf-8").partition("## Geodesics: reproduction")[2]
    for name in GEODESICS.order:
        assert f"`{name}`" in text or f"`pairs.{name}`" in text, name
    rows = re.findall(r"^\| (`.*?) \|", text.partition("## Geodesics: `pairs")[0], re.MULTILINE)
    for name in re.findall(r"`([a-z_]+)`", " ".join(rows)):
        assert name in GEODESICS.labels, name
