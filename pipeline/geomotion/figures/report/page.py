"""The page: everything it shows as one value, and its rendering. All text is escaped by the template engine."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from geomotion.figures.report.pictures import Picture
from geomotion.figures.report.scores import Headline, Table
from geomotion.figures.report.verdict import Verdict

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Page:
    """What a report says.

    Attributes:
        title: Heading of the page.
        facts: What was learned: names and values.
        verdict: What is known about contraction.
        headlines: The numbers to look at first.
        tables: All scores.
        pictures: By name, in order.
        demonstrations: One mapping for each demonstration, from ``summary.json``.
        rollouts: One mapping for each rollout, from ``rollouts.json``; empty without a rollout stage.
        steps: Preprocessing, one sentence each.
        source: Where the recordings come from.
        licence: Their licence.
        caveats: What the numbers do not say.
        omitted: What is not on the page, and why.
        command: How to repeat the run; empty if it is not known.
        configurations: Resolved configuration of each stage, as YAML.
        versions: Packages and code.
        runs: MLflow run id and digest of each stage.
    """

    title: str
    facts: Mapping[str, str]
    verdict: Verdict
    headlines: list[Headline]
    tables: list[Table]
    pictures: Mapping[str, Picture]
    demonstrations: list[Mapping[str, Any]]
    rollouts: list[Mapping[str, Any]]
    steps: list[str]
    source: str
    licence: str
    caveats: list[str]
    omitted: Mapping[str, str]
    command: str
    configurations: Mapping[str, str]
    versions: Mapping[str, str]
    runs: Mapping[str, tuple[str, str]]


def render(page: Page) -> str:
    """The page as one HTML document that refers to nothing outside itself."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string((HERE / "page.html.jinja").read_text(encoding="utf-8"))
    style = (HERE / "page.css").read_text(encoding="utf-8")
    return template.render(page=page, style=style)
