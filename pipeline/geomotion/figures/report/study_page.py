"""The page of a study: its table, its pictures and the runs behind them."""

from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from geomotion.figures.report.page import Listing
from geomotion.figures.report.pictures import Picture

HERE = Path(__file__).parent


@dataclass(frozen=True)
class StudyPage:
    """What the page says.

    Attributes:
        title: Heading.
        table: The scores.
        legend: What its columns are.
        notes: What a reader of the table has to know.
        failures: What could not be run, and why.
        pictures: In order.
        runs: Every run with its settings.
        command: Command line that repeats the study.
    """

    title: str
    table: Listing
    legend: list[str]
    notes: list[str]
    failures: list[str]
    pictures: list[Picture]
    runs: Listing
    command: str


def render_study(page: StudyPage) -> str:
    """The page as one HTML document that refers to nothing outside itself."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string((HERE / "study.html.jinja").read_text(encoding="utf-8"))
    return template.render(page=page, style=(HERE / "page.css").read_text(encoding="utf-8"))
