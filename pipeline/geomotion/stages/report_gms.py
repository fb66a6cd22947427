"""Write the report of a geodesic motion skill: one HTML page made of what the other stages left."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from geomotion.figures.report.gms_caveats import caveats
from geomotion.figures.report.gms_listings import listings
from geomotion.figures.report.gms_pictures import CAPTIONS, FILM, missing
from geomotion.figures.report.gms_scores import GEODESICS, headlines
from geomotion.figures.report.gms_verdict import attempts, verdict
from geomotion.figures.report.page import Data, Link, Page, render
from geomotion.figures.report.pictures import Picture, film, pictures
from geomotion.figures.report.scores import tables
from geomotion.files import read_json, write_bytes, write_text
from geomotion.stages.graph import LATENT_SCENE
from geomotion.stages.report import ReportConfig, origin, recorded, training_facts
from geomotion.tracking import Artefacts, StageRun

__all__ = ["ReportConfig", "report_gms"]

Document = Mapping[str, Any]
STAGES = ("ingest", "train", "graph", "plan", "evaluate", "replay")
SCENE = "scene.html"


def report_gms(config: ReportConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``report.html``, and beside it the interactive ``scene.html`` and, if there is one, ``latent.html``.

    Args:
        config: Title and command.
        inputs: Stages ``ingest``, ``train``, ``graph``, ``plan``, ``evaluate``, and ``replay`` if there was a robot.
        run: Where to write.

    Raises:
        MissingArtefact: If a stage did not leave what its contract says.
        CorruptArtefact: If a file cannot be read.
    """
    page = render(compose(config, inputs))
    write_bytes(run.folder / SCENE, inputs["plan"].path(SCENE).read_bytes())
    if _has_latent_scene(inputs):
        write_bytes(run.folder / LATENT_SCENE, inputs["plan"].path(LATENT_SCENE).read_bytes())
    write_text(run.folder / "report.html", page)


def compose(config: ReportConfig, inputs: Mapping[str, Artefacts]) -> Page:
    """Read what the stages left and say what is in it."""
    summary: Document = read_json(inputs["ingest"].path("summary.json"))
    training: Document = read_json(inputs["train"].path("training.json"))
    graph: Document = read_json(inputs["graph"].path("graph.json"))
    plan: Document = read_json(inputs["plan"].path("plan.json"))
    judged: Document = read_json(inputs["evaluate"].path("scores.json"))
    replay: Document | None = read_json(inputs["replay"].path("replay.json")) if "replay" in inputs else None
    shown = pictures([inputs[name].folder / "figures" for name in STAGES if name in inputs], CAPTIONS)
    return Page(
        title=config.title or f"Geodesic motion skill from {judged['dataset']}",
        verdict=verdict(plan, graph, training, replay),
        headlines=headlines(judged["scores"], replay),
        facts=_facts(summary, judged, inputs) | _training_facts(training, inputs["train"]) | _graph_facts(graph),
        pictures=shown,
        tables=tables(judged["scores"], GEODESICS),
        data=Data.of(summary),
        origin=origin(config.command, inputs, STAGES),
        caveats=caveats(summary, judged["scores"], plan, replay),
        omitted=missing(shown, plan, replay) | _omitted(judged, inputs),
        listings=listings(plan, replay),
        film=_film(inputs),
        links=_links(inputs),
    )


def _links(inputs: Mapping[str, Artefacts]) -> tuple[Link, ...]:
    scene = Link(SCENE, "interactive 3-D view", "of demonstrations, path and obstacles, to turn and zoom")
    latent = Link(LATENT_SCENE, "interactive latent space", "with its walls, the encoded demonstrations and the path")
    return (scene, latent) if _has_latent_scene(inputs) else (scene,)


def _has_latent_scene(inputs: Mapping[str, Artefacts]) -> bool:
    return (inputs["plan"].folder / LATENT_SCENE).is_file()


def _film(inputs: Mapping[str, Artefacts]) -> Picture | None:
    path = inputs["replay"].folder / "film.gif" if "replay" in inputs else None
    return film(path, *FILM) if path is not None and path.is_file() else None


def _facts(summary: Document, judged: Document, inputs: Mapping[str, Artefacts]) -> dict[str, str]:
    demos = summary.get("demos", [])
    sets = [demo["set"] for demo in demos]
    configuration = recorded(inputs["train"], "config.json")
    return {
        "Dataset": str(judged["dataset"]),
        "State": f"space {summary.get('space')}, frame {summary.get('frame')}",
        "Demonstrations": f"{len(demos)}: {sets.count('train')} for training, {sets.count('test')} held out",
        "Protocol": str(judged["protocol"]),
        "Seed": str(configuration.get("seed", "not recorded")),
    }


def _training_facts(training: Document, train: Artefacts) -> dict[str, str]:
    health = "good" if training["is_good"] else "not good"
    missed, folded = 100 * training["unexplained_variance"], 100 * training["folded_share"]
    latent = f"{health}: {missed:.2g} % of the variance missed, {folded:.2g} % folded, after {attempts(training)}"
    return training_facts(train) | {"Latent space": latent}


def _graph_facts(graph: Document) -> dict[str, str]:
    lengths = graph["demonstration_lengths"]
    size = f"{graph['nodes']} nodes ({graph['points_per_axis']} an axis), {graph['edges']} edges"
    cap = f"{1000 * graph['cap_m']:.1f} mm and {np.degrees(graph['cap_rad']):.1f}° from the demonstrations"
    return {
        "Graph": f"{size}; built in {graph['build_s']:.2f} s, at most {graph['memory_bytes'] / 2**20:.0f} MiB",
        "Support cap": f"{cap}; {100 * graph['open_share']:.3g} % of the nodes lie inside",
        "Demonstrations' lengths": f"{min(lengths):.3g} to {max(lengths):.3g} in the metric; a path longer than "
        f"{graph['crossing_length']:.3g} crosses a region without data",
    }


def _omitted(judged: Document, inputs: Mapping[str, Artefacts]) -> dict[str, str]:
    """Scores and the film, where they are not there, and why."""
    reasons = {f"Score {name}": str(reason) for name, reason in judged.get("omitted", {}).items()}
    if "replay" in inputs and not (inputs["replay"].folder / "film.gif").is_file():
        reasons["Film"] = "the replay stage took none"
    return reasons
