"""Write the report of a run: one HTML page made of what the other stages left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd
from omegaconf import OmegaConf

from geomotion.errors import CorruptArtefact
from geomotion.figures.arrays import EvaluationArrays, read_evaluation
from geomotion.figures.report.conditions import condition_rows
from geomotion.figures.report.ncds_caveats import caveats
from geomotion.figures.report.ncds_pictures import BODY_FILM, CAPTIONS, FILM, missing
from geomotion.figures.report.ncds_scores import FIELD, headlines
from geomotion.figures.report.ncds_verdict import verdict
from geomotion.figures.report.page import Column, Data, Listing, Origin, Page, render
from geomotion.figures.report.pictures import Picture, film, pictures
from geomotion.figures.report.scores import tables
from geomotion.files import read_json, write_text
from geomotion.stages.export import differences
from geomotion.stages.ingest import SKELETON
from geomotion.stages.policy_replay import policy_replay_rows
from geomotion.tracking import Artefacts, StageRun

Document = Mapping[str, Any]
STAGES = ("ingest", "train", "rollout", "evaluate", "export", "replay", "body")
PICTURED = ("ingest", "train", "evaluate", "replay", "body")
NO_SKELETON = "no model of the person that could be read is beside the recording; dataset.skeleton= names its file"
NO_JOINTS = "the skill has no joints that a skeleton could be moved by"
FILMS = {"replay": FILM, "body": BODY_FILM}


@dataclass(frozen=True)
class ReportConfig:
    """What the report stage needs beyond the artefacts of the others.

    Attributes:
        title: Heading; None for one made of the dataset's name.
        command: Command line that repeats the run; empty if it is not known.
    """

    title: str | None = None
    command: str = ""


def report(config: ReportConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``report.html``.

    Args:
        config: Title and command.
        inputs: Stages ``ingest``, ``train``, ``evaluate``, and those of ``rollout``, ``export``, ``replay``, ``body``
            that there were.
        run: Where to write.

    Raises:
        MissingArtefact: If a stage did not leave what its contract says.
        CorruptArtefact: If a file cannot be read.
    """
    write_text(run.folder / "report.html", render(compose(config, inputs)))


def compose(config: ReportConfig, inputs: Mapping[str, Artefacts]) -> Page:
    """Read what the stages left and say what is in it."""
    summary: Document = read_json(inputs["ingest"].path("summary.json"))
    certificate: Document = read_json(inputs["evaluate"].path("certificate.json"))
    judged: Document = read_json(inputs["evaluate"].path("scores.json"))
    data = read_evaluation(inputs["evaluate"].path("evaluation.npz"))
    shown = pictures([inputs[name].folder / "figures" for name in PICTURED if name in inputs], CAPTIONS)
    training = recorded(inputs["train"], "config.json")
    facts = _facts(summary, data, judged, training) | training_facts(inputs["train"]) | _policy_facts(inputs)
    return Page(
        title=config.title or f"Motion learned from {judged['dataset']}",
        verdict=verdict(certificate, data.eigenvalues),
        headlines=headlines(judged["scores"]),
        facts=facts,
        pictures=shown,
        tables=tables(judged["scores"], FIELD),
        data=Data.of(summary),
        origin=origin(config.command, inputs, STAGES),
        caveats=caveats(data, str(certificate.get("claim")), str(judged["protocol"])),
        omitted=missing(shown, data) | _omitted(judged, inputs),
        listings=(*_conditions(judged), *_rollouts(inputs), *_replayed(inputs)),
        film=_film(inputs),
    )


def origin(command: str, inputs: Mapping[str, Artefacts], stages: Sequence[str]) -> Origin:
    """What the tracker recorded about the stages before.

    Args:
        command: Command line that repeats the run; empty if it is not known.
        inputs: Stages, among them ``evaluate``.
        stages: Their order on the page.
    """
    present = {name: inputs[name] for name in stages if name in inputs}
    configurations = {name: recorded(stage, "config.json") for name, stage in present.items()}
    return Origin(
        command,
        configurations={name: _yaml(found) for name, found in configurations.items() if found},
        versions=recorded(inputs["evaluate"], "environment.json"),
        runs={name: (stage.run_id, stage.digest) for name, stage in present.items()},
    )


def recorded(stage: Artefacts, name: str) -> dict[str, Any]:
    """What the tracker recorded beside the outputs of a stage; empty where it did not."""
    path = stage.folder / name
    return dict(read_json(path)) if path.is_file() else {}


def _facts(summary: Document, data: EvaluationArrays, judged: Document, training: Document) -> dict[str, str]:
    demos = summary.get("demos", [])
    sets = [demo["set"] for demo in demos]
    durations = [demo["duration_s"] for demo in demos] or [item.time_s[-1] - item.time_s[0] for item in data.judged]
    model = training.get("model", {})
    kinds = {part: str(model.get(part, {}).get("kind", "not recorded")) for part in ("field", "chart")}
    return {
        "Dataset": str(judged["dataset"]),
        "State": f"{data.dim} dimensions; space {summary.get('space')}, frame {summary.get('frame')}",
        "Demonstrations": f"{len(demos)}: {sets.count('train')} for training, {sets.count('test')} held out",
        "Duration": f"{min(durations):.2f} to {max(durations):.2f} s, mean {sum(durations) / len(durations):.2f} s",
        "Model": f"{kinds['field']} in {kinds['chart']}",
        "Protocol": str(judged["protocol"]),
        "Seed": str(training.get("seed", "not recorded")),
    }


def training_facts(train: Artefacts) -> dict[str, str]:
    """How long was trained, and how far the loss fell.

    Raises:
        CorruptArtefact: If ``training.csv`` is no such table.
    """
    path = train.path("training.csv")
    try:
        last = pd.read_csv(path).iloc[-1]
        return {"Training": f"{int(last['step']) + 1} steps, final loss {float(last['total']):.3g}"}
    except (ValueError, KeyError, IndexError) as error:
        raise CorruptArtefact(path, f"not a table with columns step and total ({error})") from error


def _policy_facts(inputs: Mapping[str, Artefacts]) -> dict[str, str]:
    if "export" not in inputs:
        return {}
    policy: Document = read_json(inputs["export"].path("policy.json"))
    speed = f"ONNX, {policy['query_time_ms']:.2g} ms for one velocity"
    return {"Exported policy": f"{speed}, at most {differences(policy)} from the trained one"}


def _conditions(judged: Document) -> tuple[Listing, ...]:
    """Scores under each condition, where there are several."""
    if "conditions" not in judged:
        return ()
    head, *rows = condition_rows(judged["conditions"])
    columns = (Column(head[0], is_text=True), *(Column(name) for name in head[1:]))
    return (Listing("Conditions", columns, tuple(rows)),)


def _rollouts(inputs: Mapping[str, Artefacts]) -> tuple[Listing, ...]:
    if "rollout" not in inputs:
        return ()
    rollouts: list[Document] = read_json(inputs["rollout"].path("rollouts.json")).get("rollouts", [])
    unit = rollouts[0]["unit"][0] if rollouts else ""
    names = ("start", "duration [s]", "points", f"to the goal at the end [{unit}]")
    rows = tuple(
        (str(row["start"]), f"{row['duration_s']:.2f}", str(row["points"]), _to_goal(row), str(row["outcome"]))
        for row in rollouts
    )
    columns = (*(Column(name) for name in names), Column("outcome", is_text=True))
    return (Listing("Rollouts", columns, rows),) if rows else ()


def _replayed(inputs: Mapping[str, Artefacts]) -> tuple[Listing, ...]:
    if "replay" not in inputs:
        return ()
    replay: Document = read_json(inputs["replay"].path("replay.json"))
    rows = policy_replay_rows(replay) if replay["executed"] else [("not executed", str(replay["reason"]))]
    columns = Column("quantity", is_text=True), Column("measured in simulation", is_text=True)
    return (Listing("In closed loop on the simulated arm", columns, tuple(rows)),)


def _film(inputs: Mapping[str, Artefacts]) -> Picture | None:
    for stage, caption in FILMS.items():
        path = inputs[stage].folder / "film.gif" if stage in inputs else None
        if path is not None and path.is_file():
            return film(path, *caption)
    return None


def _to_goal(row: Document) -> str:
    distance, (_, per_state_unit) = row["distance_to_goal_m"], row["unit"]
    return "infinite" if distance is None else f"{per_state_unit * distance:.2f}"


def _yaml(configuration: Document) -> str:
    return OmegaConf.to_yaml(OmegaConf.create(dict(configuration)))


def _omitted(judged: Document, inputs: Mapping[str, Artefacts]) -> dict[str, str]:
    """Scores and stages that are not there, and why."""
    reasons = {f"Score {name}": str(reason) for name, reason in judged.get("omitted", {}).items()}
    if recorded(inputs["ingest"], "config.json").get("kind") == "MmmDataset" and "body" not in inputs:
        has_skeleton = (inputs["ingest"].folder / SKELETON).is_file()
        reasons["Skeleton and film"] = NO_JOINTS if has_skeleton else NO_SKELETON
    return reasons if "rollout" in inputs else reasons | {"Rollouts": "the rollout stage was not run"}
