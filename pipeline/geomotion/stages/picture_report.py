"""The report of two policies that look at pictures."""

from collections.abc import Mapping
from typing import Any

from geomotion.config import ManipulationSkill
from geomotion.figures.report.conditions import condition_rows
from geomotion.figures.report.page import Column, Data, Listing, Page, render
from geomotion.figures.report.pictured import CAPTIONS, FILM, caveats, confusion_listing, headlines, verdict
from geomotion.figures.report.pictures import film, pictures
from geomotion.files import read_json, write_text
from geomotion.stages.episodes import EPISODE_COLUMNS, episode_rows
from geomotion.stages.report import ReportConfig, origin, training_facts
from geomotion.tracking import Artefacts, StageRun

SKILLS = tuple(skill.value for skill in ManipulationSkill)
STAGES = (
    "ingest", "snapshots", "encode",
    *(f"{name} {skill}" for skill in SKILLS for name in ("train", "embed", "evaluate")),
    "episodes",
)  # fmt: skip


def report_pictures(config: ReportConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``report.html``.

    Raises:
        MissingArtefact: If a stage did not leave what its contract says.
    """
    summary = read_json(inputs["ingest"].path("summary.json"))
    acted = read_json(inputs["episodes"].path("episodes.json"))
    taken = read_json(inputs["snapshots"].path("snapshots.json"))
    embedded = {skill: read_json(inputs[f"embed {skill}"].path("embedding.json")) for skill in SKILLS}
    certificates = {skill: read_json(inputs[f"evaluate {skill}"].path("certificate.json")) for skill in SKILLS}
    folders = [inputs[name].folder / "figures" for name in ("ingest", "snapshots", "episodes")]
    page = Page(
        title=config.title or "Grasp and drop from pictures",
        verdict=verdict(certificates, acted),
        headlines=headlines(acted, embedded),
        facts=_facts(acted, taken, inputs),
        pictures=pictures(folders, CAPTIONS),
        tables=[],
        data=Data.of(summary),
        origin=origin(config.command, {**inputs, "evaluate": inputs["evaluate grasp"]}, STAGES),
        caveats=caveats(acted["encoder"]),
        omitted={},
        listings=(
            _episodes(acted),
            *(_conditions(skill, inputs) for skill in SKILLS),
            *map(confusion_listing, embedded.values()),
        ),
        film=film(inputs["episodes"].path("film.gif"), *FILM),
    )
    write_text(run.folder / "report.html", render(page))


def _facts(acted: Mapping[str, Any], taken: Mapping[str, Any], inputs: Mapping[str, Artefacts]) -> dict[str, str]:
    encoder = acted["encoder"]
    facts = {
        "Encoder": f"ResNet-18, {encoder['weights']}; SHA-256 {encoder['weights_sha256'][:16]}",
        "Features": f"1000 of each of {encoder['tiles']} x {encoder['tiles']} overlapping parts of a picture",
    }
    for skill, one in taken.items():
        size = f"{one['width_px']} x {one['height_px']} pixels, {one['mode']}"
        facts[f"Pictures before the {skill}"] = f"{one['of_places']} of places, {one['between']} between; {size}"
    for skill in SKILLS:
        facts |= {f"{name} of the {skill}": text for name, text in training_facts(inputs[f"train {skill}"]).items()}
    return facts


def _episodes(acted: Mapping[str, Any]) -> Listing:
    columns = tuple(Column(name, is_text=True) for name in EPISODE_COLUMNS)
    return Listing("Episodes in closed loop", columns, tuple(episode_rows(acted)))


def _conditions(skill: str, inputs: Mapping[str, Artefacts]) -> Listing:
    head, *rows = condition_rows(read_json(inputs[f"evaluate {skill}"].path("scores.json"))["conditions"])
    columns = (Column(head[0], is_text=True), *(Column(name) for name in head[1:]))
    return Listing(f"Reproduction of the {skill}", columns, tuple(rows))
