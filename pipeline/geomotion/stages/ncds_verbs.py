"""The verbs of `ncds` as chains of stages."""

from typing import Any

from geomotion.config import DatasetConfig, NcdsConfig, NoObstacle
from geomotion.figures.report.conditions import condition_rows
from geomotion.figures.studies.fields import FIELD_STUDY_FIGURES
from geomotion.files import read_json
from geomotion.models import ModelConfig
from geomotion.stages import compare, shared
from geomotion.stages.evaluate import EvaluateConfig, scores_table
from geomotion.stages.evaluate_conditions import evaluate
from geomotion.stages.export import ExportConfig, export
from geomotion.stages.ingest import ingest
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
    )


def _rollout_config(session: Session) -> RolloutStageConfig:
    return RolloutStageConfig(session.config.rollout, session.config.solver, session.config.obstacle)


def _evaluate_config(session: Session) -> EvaluateConfig:
    return EvaluateConfig(session.config.evaluation, session.config.solver, session.config.obstacle)


def _export_config(session: Session) -> ExportConfig:
    return ExportConfig(session.config.tracking.register_as)


def _report_config(session: Session) -> ReportConfig:
    return ReportConfig(command=session.reproduction)


STEPS = {
    "ingest": Step(Stage("ingest", ingest, reads_outside=True), (), lambda session: session.config.dataset),
    "train": Step(Stage("train", train), ("ingest",), _train_config),
    "rollout": Step(Stage("rollout", rollout), ("ingest", "train"), _rollout_config),
    "evaluate": Step(Stage("evaluate", evaluate), ("ingest", "train"), _evaluate_config),
    "export": Step(Stage("export", export), ("train",), _export_config),
    "report": Step(Stage("report", report), ("ingest", "train", "rollout", "evaluate", "export"), _report_config),
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


def _run(session: Session) -> VerbResult:
    rolled, evaluated, reported = _rollout(session), _evaluate(session), shared.report_verb(session)
    document = evaluated.document | reported.document
    among_obstacles = not isinstance(session.config.obstacle, NoObstacle)
    text = f"{rolled.text}\n\n{evaluated.text}" if among_obstacles else evaluated.text
    return VerbResult(f"{text}\n{reported.text}", document, objective=evaluated.objective)


def _certificate_line(certificate: dict[str, Any]) -> str:
    rate = certificate["rate_per_s"]
    proven = f" at {rate:.3g} 1/s" if rate is not None else ""
    return f"contraction  {certificate['claim'].replace('_', ' ')}{proven}; metric: {certificate['metric']}"


NCDS = Program(
    name="ncds",
    steps=STEPS,
    verbs={
        "ingest": shared.ingest_verb,
        "train": _train,
        "rollout": _rollout,
        "eval": _evaluate,
        "report": shared.report_verb,
        "run": _run,
        "compare": shared.compare_verb,
        "check": shared.check_verb,
    },
    execution_keys=shared.EXECUTION_KEYS | {"solver", "rollout"},
    study_figures=FIELD_STUDY_FIGURES,
)
