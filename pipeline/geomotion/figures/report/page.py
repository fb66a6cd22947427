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
class Column:
    """Head of a column; numbers are set to the right, text to the left."""

    name: str
    is_text: bool = False


@dataclass(frozen=True)
class Listing:
    """A titled table of what was done, with as many cells in each row as there are columns."""

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Link:
    """A page beside this one.

    Attributes:
        target: Relative address.
        text: What to click on.
        note: What is there to see.
    """

    target: str
    text: str
    note: str


@dataclass(frozen=True)
class Data:
    """What was learned from.

    Attributes:
        source: Where the recordings come from.
        licence: Their licence.
        steps: Preprocessing, one sentence each.
        demonstrations: One mapping for each demonstration.
    """

    source: str
    licence: str
    steps: list[str]
    demonstrations: list[Mapping[str, Any]]

    @classmethod
    def of(cls, summary: Mapping[str, Any]) -> "Data":
        """From the contents of ``summary.json``."""
        return cls(
            summary.get("source") or "not stated",
            summary.get("licence") or "not stated",
            list(summary.get("steps", [])),
            list(summary.get("demos", [])),
        )


@dataclass(frozen=True)
class Origin:
    """How the run came about.

    Attributes:
        command: How to repeat it; empty if it is not known.
        configurations: Resolved configuration of each stage, as YAML.
        versions: Packages and code.
        runs: MLflow run id and digest of each stage.
    """

    command: str
    configurations: Mapping[str, str]
    versions: Mapping[str, str]
    runs: Mapping[str, tuple[str, str]]


@dataclass(frozen=True)
class Page:
    """What a report says.

    Attributes:
        title: Heading of the page.
        verdict: What is known about the motion.
        headlines: The numbers to look at first.
        facts: What was learned: names and values.
        pictures: By name, in order.
        tables: All scores.
        data: What was learned from.
        origin: How to repeat it.
        caveats: What the numbers do not say.
        omitted: What is not on the page, and why.
        listings: What was done, if there is more to tell than scores.
        film: The motion on a robot.
        links: Pages beside this one.
    """

    title: str
    verdict: Verdict
    headlines: list[Headline]
    facts: Mapping[str, str]
    pictures: Mapping[str, Picture]
    tables: list[Table]
    data: Data
    origin: Origin
    caveats: list[str]
    omitted: Mapping[str, str]
    listings: tuple[Listing, ...] = ()
    film: Picture | None = None
    links: tuple[Link, ...] = ()


def render(page: Page) -> str:
    """The page as one HTML document that refers to nothing outside itself but its links."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string((HERE / "page.html.jinja").read_text(encoding="utf-8"))
    style = (HERE / "page.css").read_text(encoding="utf-8")
    return template.render(page=page, style=style)
