"""The verbs of `ncds` as chains of stages."""

from dataclasses import replace
from typing import Any

from geomotion import conditional_models
from geomotion.config import DatasetConfig, NcdsConfig, NoObstacle, NoSafety
from geomotion.figures.report.conditions import condition_rows
from geomotion.figures.studies.fields import FIELD_STUDY_FIGURES
from geomotion.figures.studies.manifold_starts import manifold_starts
from geomotion.figures.studies.nearby import nearby
from geomotion.files import read_json
from geomotion.models import ModelConfig, Skill
from geomotion.stages import compare, shared
from geomotion.stages.body_motion import draw_body_motion
from geomotion.stages.evaluate import EvaluateConfig, scores_table
from geomotion.stages.evaluate_conditions import evaluate
from geomotion.stages.export import EXAMPLE, ExportConfig, export, policy_summary
from geomotion.stages.ingest import SKELETON, ingest
from geomotion.stages.picture_verbs import PICTURE_STEPS, is_pictured, run_pictured
from geomotion.stages.policy_motion import leads_an_arm
from geomotion.stages.policy_replay import PolicyReplayConfig, policy_replay_table, replay_policy
from geomotion.stages.report import ReportConfig, report
from geomotion.stages.rollout import RolloutStageConfig, rollout, rollout_table
from geomotion.stages.session import Program, Session, Step, VerbResult
from geomotion.stages.train import TrainConfig, train
from geomotion.tables import aligned
from geomotion.tracking import Stage


def _train_config(session: Session) -> TrainConfig:
    config: NcdsConfig = session.config
    dataset = config.dataset
    return TrainConfig(
        # the base class: where recordings come from must not decide whether a training is repeated
        selection=DatasetConfig(
            dataset.name, dataset.state_channels, dataset.train_demos, dataset.test_demos, dataset.held_out
        ),
        model=ModelConfig(config.chart, config.field, config.regulariser, config.seed, config.time_law),
        training=config.training,
        seed=config.seed,
        space=config.space,
        pose=config.pose,
        vae=config.vae,
    )


def _rollout_config(session: Session) -> RolloutStageConfig:
    config: NcdsConfig = session.config
    return RolloutStageConfig(config.rollout, config.solver, config.obstacle, config.safety)


def _evaluate_config(session: Session) -> EvaluateConfig:
    config: NcdsConfig = session.config
    return EvaluateConfig(config.evaluation, config.solver, config.obstacle, config.safety)


def _export_config(session: Session) -> ExportConfig:
    config: NcdsConfig = session.config
    policy, name = config.policy, config.tracking.register_as
    if isinstance(config.safety, NoSafety):  # obstacles are told at run time: others are no reason for another export
        return ExportConfig(policy, name)
    return ExportConfig(policy, name, config.safety, config.obstacle)


def _replay_config(session: Session) -> PolicyReplayConfig:
    return PolicyReplayConfig(session.config.replay, session.config.obstacle, session.config.safety)


def _report_config(session: Session) -> ReportConfig:
    return ReportConfig(command=session.reproduction)


REPORTED = ("ingest", "train", "rollout", "evaluate", "export")
STEPS = {
    "ingest": Step(Stage("ingest", ingest, reads_outside=True), (), lambda session: session.config.dataset),
    "train": Step(Stage("train", train), ("ingest",), _train_config),
    "rollout": Step(Stage("rollout", rollout), ("ingest", "train"), _rollout_config),
    "evaluate": Step(Stage("evaluate", evaluate), ("ingest", "train"), _evaluate_config),
    "export": Step(Stage("export", export), ("ingest", "train"), _export_config),
    "replay": Step(Stage("replay", replay_policy), ("ingest", "train"), _replay_config),
    "body": Step(Stage("body", draw_body_motion), ("ingest", "train"), lambda session: session.config.body),
    "report": Step(Stage("report", report), (*REPORTED, "replay"), _report_config),
    **PICTURE_STEPS,
    "report with body": Step(Stage("report", report), (*REPORTED, "body"), _report_config),
    "report without robot": Step(Stage("report", report), REPORTED, _report_config),
}


def _train(session: Session) -> VerbResult:
    found = session.produce("train")
    certificate = read_json(found.path("certificate.json"))
    text = f"{_certificate_line(certificate)}\nmodel  {found.path('model.pt')}\nnext   ncds eval run={found.run_id[:8]}"
    return VerbResult(text, session.document(certificate=certificate))


def _rollout(session: Session) -> VerbResult:
    found = session.produce("rollout")
    rollouts = read_json(found.path("rollouts.json"))
    text = f"{rollout_table(rollouts)}\n\ntrajectories  {found.path('rollouts')}"
    return VerbResult(text, session.document(rollouts=rollouts))


def _evaluate(session: Session) -> VerbResult:
    found = session.produce("evaluate")
    scores = read_json(found.path("scores.json"))
    certificate = read_json(found.path("certificate.json"))
    each = f"\n\n{aligned(condition_rows(scores['conditions']))}" if "conditions" in scores else ""
    text = f"{scores_table(scores)}{each}\n\n{_certificate_line(certificate)}\nscores  {found.path('scores.json')}"
    return VerbResult(
        text, session.document(scores=scores, certificate=certificate), objective=compare.objective(scores)
    )


def _export(session: Session) -> VerbResult:
    found = session.produce("export")
    policy = read_json(found.path("policy.json"))
    text = f"{policy_summary(policy)}\n\npolicy   {found.path('policy.onnx')}\nexample  {found.path(EXAMPLE)}"
    return VerbResult(text, session.document(policy=policy))


def _replay(session: Session) -> VerbResult:
    found = session.produce("replay")
    document = read_json(found.path("replay.json"))
    film = found.folder / "film.gif"
    text = policy_replay_table(document) + (f"\n\nfilm  {film}" if film.exists() else "")
    return VerbResult(
        text, session.document(replay=document), exit_code=0 if document["executed"] else shared.NO_MOTION
    )


def _report(session: Session) -> VerbResult:
    """With what the arm did, where an arm can follow the states, or with the body that has the joints."""
    skill = conditional_models.load(session.produce("train").path("model.pt"))
    if leads_an_arm(skill):
        return shared.report_verb(session, "report")
    has_body = isinstance(skill, Skill) and skill.joints and (session.produce("ingest").folder / SKELETON).is_file()
    return shared.report_verb(session, "report with body" if has_body else "report without robot")


def _ingest(session: Session) -> VerbResult:
    """With the pictures that belong to some sets."""
    found = shared.ingest_verb(session)
    if not is_pictured(session):
        return found
    taken = session.produce("snapshots")
    return replace(found, text=f"{found.text}\npictures {taken.folder}", document=found.document | session.document())


def _run(session: Session) -> VerbResult:
    if is_pictured(session):
        return run_pictured(session)
    rolled, evaluated, reported = _rollout(session), _evaluate(session), _report(session)
    document = evaluated.document | reported.document
    among_obstacles = not isinstance(session.config.obstacle, NoObstacle)
    texts = [rolled.text, evaluated.text] if among_obstacles else [evaluated.text]
    if "replay" in session.done:
        document["replay"] = read_json(session.done["replay"].path("replay.json"))
        texts.append(policy_replay_table(document["replay"]))
    text = "\n\n".join(texts)
    return VerbResult(f"{text}\n{reported.text}", document, objective=evaluated.objective)


def _certificate_line(certificate: dict[str, Any]) -> str:
    rate = certificate["rate_per_s"]
    proven = f" at {rate:.3g} 1/s" if rate is not None else ""
    return f"contraction  {certificate['claim'].replace('_', ' ')}{proven}; metric: {certificate['metric']}"


NCDS = Program(
    name="ncds",
    steps=STEPS,
    verbs={
        "ingest": _ingest,
        "train": _train,
        "rollout": _rollout,
        "eval": _evaluate,
        "export": _export,
        "replay": _replay,
        "report": _report,
        "run": _run,
        "compare": shared.compare_verb,
        "check": shared.check_verb,
    },
    execution_keys=shared.EXECUTION_KEYS | {"solver", "rollout", "replay", "body", "policy", "safety"},
    study_figures={**FIELD_STUDY_FIGURES, "nearby": nearby, "manifold_starts": manifold_starts},
)
