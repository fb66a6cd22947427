"""`ncds run` of two policies that look at pictures: both are trained, then they grasp and drop in closed loop."""

from dataclasses import replace
from typing import Any

from geomotion.config import GraspAndDropDataset, LinearField, ManipulationSkill, NcdsConfig
from geomotion.errors import InvalidSetting
from geomotion.files import read_json
from geomotion.networks.image_encoder import RANDOM, digest_of_weights
from geomotion.robot.closed_loop import steps_per_period
from geomotion.stages.embed import EmbedConfig, embed
from geomotion.stages.encode import EncodeConfig, encode
from geomotion.stages.episodes import EpisodesStageConfig, episodes, episodes_table
from geomotion.stages.picture_report import report_pictures
from geomotion.stages.report import ReportConfig
from geomotion.stages.session import Session, Step, VerbResult
from geomotion.stages.snapshots import SnapshotsConfig, snapshots
from geomotion.tracking import Artefacts, Stage

OF_SKILL = ("train", "embed", "evaluate")
SHARED = ("ingest", "snapshots", "encode")  # by both skills


def _dataset(session: Session) -> GraspAndDropDataset:
    config: NcdsConfig = session.config
    assert isinstance(config.dataset, GraspAndDropDataset)
    return config.dataset


def _pictured(session: Session) -> GraspAndDropDataset:
    """The dataset as far as pictures depend on it."""
    return replace(_dataset(session), skill=ManipulationSkill.grasp, train_demos=None, test_demos=None)


def _encode_config(session: Session) -> EncodeConfig:
    encoder = session.config.encoder
    digest = None if encoder.weights == RANDOM else digest_of_weights(encoder.weights)
    return EncodeConfig(encoder.weights, encoder.tiles, encoder.seed, digest)


def _embed_config(session: Session) -> EmbedConfig:
    return EmbedConfig(session.config.encoder, _dataset(session).skill)


PICTURE_STEPS = {
    "snapshots": Step(Stage("snapshots", snapshots), ("ingest",), lambda session: SnapshotsConfig(_pictured(session))),
    "encode": Step(Stage("encode", encode), ("snapshots",), _encode_config),
    "embed": Step(Stage("embed", embed), ("ingest", "snapshots", "encode", "train"), _embed_config),
}


def is_pictured(session: Session) -> bool:
    """Whether conditions come from pictures."""
    return isinstance(session.config.dataset, GraspAndDropDataset)


def run_pictured(session: Session) -> VerbResult:
    """Train both policies and their embeddings, score both, and let them act.

    Raises:
        InvalidSetting: If demonstrations were chosen by number, which would be those of one skill alone, the control
            rate does not divide that of the simulation, or embeddings need trajectories that the field does not have in
            closed form; before anything is done.
        MissingData: If there are no such weights of the encoder; before anything is done.
    """
    dataset = _dataset(session)
    if (dataset.train_demos, dataset.test_demos) != dataset.demos_of(dataset.skill):
        raise InvalidSetting("dataset.train_demos", dataset.train_demos, "null: `run` trains both skills; see held_out")
    steps_per_period(session.config.episodes.control_hz, "episodes.control_hz")
    weight = session.config.encoder.trajectory_weight
    if weight > 0 and not isinstance(session.config.field, LinearField):
        raise InvalidSetting("encoder.trajectory_weight", weight, "0, but for field=linear trained on trajectories")
    seeing = _encode_config(session)
    done: dict[str, Artefacts] = {}
    for skill in reversed(ManipulationSkill):  # the grasp last: it is what `run=latest` then finds
        one = _about(session, skill)
        done |= {f"{name} {skill.value}": one.produce(name) for name in OF_SKILL}
        session.done |= {name: one.done[name] for name in SHARED}
    config = EpisodesStageConfig(session.config.episodes, _pictured(session), seeing)
    acted = _run(session, Stage("episodes", episodes), config, done, ("encode",))
    reporting = ReportConfig(command=session.reproduction)
    reported = _run(
        session,
        Stage("report", report_pictures),
        reporting,
        done | {"episodes": acted},
        ("ingest", "snapshots", "encode"),
    )
    document = read_json(acted.path("episodes.json"))
    judged = {
        skill.value: read_json(done[f"embed {skill.value}"].path("embedding.json")) for skill in ManipulationSkill
    }
    certificates = {
        skill.value: read_json(done[f"evaluate {skill.value}"].path("certificate.json")) for skill in ManipulationSkill
    }
    lines = [f"encoder  {document['encoder']['weights']}"]
    lines += [f"{name}  {_line(judged[name], certificates[name])}" for name in judged]
    path = str(reported.path("report.html"))
    text = "\n".join([*lines, "", episodes_table(document), "", f"report  {path}"])
    return VerbResult(
        text, session.document(episodes=document, embeddings=judged, certificates=certificates, report=path)
    )


def _about(session: Session, skill: ManipulationSkill) -> Session:
    """A session about one of the skills, which shares what is done."""
    dataset = replace(_dataset(session), skill=skill, train_demos=None, test_demos=None)
    shared = {name: found for name, found in session.done.items() if name in SHARED}
    return replace(session, config=replace(session.config, dataset=dataset), done=shared)


def _run(
    session: Session, stage: Stage, config: object, done: dict[str, Artefacts], further: tuple[str, ...]
) -> Artefacts:
    inputs = done | {name: session.produce(name) for name in further}
    session.done[stage.name] = session.tracker.run_stage(stage, config, inputs, session.command)
    return session.done[stage.name]


def _line(judged: dict[str, Any], certificate: dict[str, Any]) -> str:
    held_out, rate = judged["held_out"], certificate["rate_per_s"]
    proven = f" at {rate:.3g} 1/s" if rate is not None else ""
    claim = f"contraction {certificate['claim'].replace('_', ' ')}, at the shown places{proven}"
    places = f"place right in {held_out['place_accuracy']:.1%} of {held_out['places']['pictures']} unseen pictures"
    return f"{places}; {claim}"
