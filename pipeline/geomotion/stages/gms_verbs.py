"""The verbs of `gms` as chains of stages."""

import hashlib
from collections.abc import Mapping
from typing import Any

from geomotion.config import DatasetConfig, GmsConfig, NoObstacle, ObstacleConfig, Space
from geomotion.files import read_json
from geomotion.manifolds.grid import require_memory
from geomotion.stages import compare, scene, shared
from geomotion.stages.evaluate_geodesics import EvaluateGeodesicsConfig, evaluate_geodesics, scores_table
from geomotion.stages.graph import LATENT_SCENE, GraphStageConfig, graph, graph_table, memory_limit_bytes
from geomotion.stages.ingest import ingest
from geomotion.stages.plan import PlanStageConfig, plan, plan_table
from geomotion.stages.replay import ReplayStageConfig, replay, replay_table
from geomotion.stages.report_gms import ReportConfig, report_gms
from geomotion.stages.session import Program, Session, Step, VerbResult
from geomotion.stages.states import JOINTS
from geomotion.stages.train_manifold import TrainManifoldConfig, train_manifold
from geomotion.tracking import Artefacts, Stage


def _train_config(session: Session) -> TrainManifoldConfig:
    config: GmsConfig = session.config
    dataset = config.dataset
    # the base class: where recordings come from must not decide whether a training is repeated
    selection = DatasetConfig(
        dataset.name, dataset.state_channels, dataset.train_demos, dataset.test_demos, dataset.held_out
    )
    return TrainManifoldConfig(selection, config.manifold, config.training, config.seed, config.space, config.arm)


def _graph_config(session: Session) -> GraphStageConfig:
    return GraphStageConfig(session.config.graph, session.config.metric)


def _require_graph_fits(config: GmsConfig) -> None:
    """Before anything is trained; a latent space of unknown dimension has two at least."""
    if config.graph.points_per_axis is not None:
        dim = config.manifold.latent_dim or LEAST_DIM
        require_memory(config.graph.points_per_axis, dim, memory_limit_bytes(config.graph))


def _plan_config(session: Session) -> PlanStageConfig:
    config: GmsConfig = session.config
    digests = _file_digests(config.obstacle)
    return PlanStageConfig(config.planning, config.metric, config.obstacle, config.robot.frame, digests)


def _file_digests(obstacle: ObstacleConfig) -> dict[str, str]:
    """What is in files decides whether a stage is repeated, as everything in the configuration does."""
    found = [path for path in scene.files(obstacle) if path.is_file()]
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in found}


def _evaluate_config(session: Session) -> EvaluateGeodesicsConfig:
    config: GmsConfig = session.config
    # an obstacle that plays no part must not cause a repetition
    obstacle = config.obstacle if config.evaluation.arm_failures.study else NoObstacle()
    return EvaluateGeodesicsConfig(
        config.evaluation, config.planning, config.metric, config.robot.frame, obstacle, _file_digests(obstacle)
    )


def _replay_config(session: Session) -> ReplayStageConfig:
    config: GmsConfig = session.config
    return ReplayStageConfig(config.robot, config.planning, config.metric, config.obstacle)


def _report_config(session: Session) -> ReportConfig:
    return ReportConfig(command=session.reproduction)


SKILL = ("ingest", "train", "graph")
REPORTED = (*SKILL, "plan", "evaluate")
STEPS = {
    "ingest": Step(Stage("ingest", ingest, reads_outside=True), (), lambda session: session.config.dataset),
    "train": Step(Stage("train", train_manifold), ("ingest",), _train_config),
    "graph": Step(Stage("graph", graph), ("ingest", "train"), _graph_config),
    "plan": Step(Stage("plan", plan), SKILL, _plan_config),
    "evaluate": Step(Stage("evaluate", evaluate_geodesics), SKILL, _evaluate_config),
    "replay": Step(Stage("replay", replay), (*SKILL, "plan"), _replay_config),
    "report": Step(Stage("report", report_gms), (*REPORTED, "replay"), _report_config),
    "report without robot": Step(Stage("report", report_gms), REPORTED, _report_config),
}


def _train(session: Session) -> VerbResult:
    found = session.produce("train")
    training = read_json(found.path("training.json"))
    health = "good" if training["is_good"] else "NOT good: try another seed, or more training.steps"
    text = (
        f"latent space  {health}; {training['unexplained_variance']:.2%} of the variance is missed, "
        f"{training['folded_share']:.1%} is folded, {training['attempts']} attempt(s)\n"
        f"model  {found.path('model.pt')}\nnext   gms plan run={found.run_id[:8]}"
    )
    return VerbResult(text, session.document(training=training))


def _graph(session: Session) -> VerbResult:
    found = session.produce("graph")
    document = read_json(found.path("graph.json"))
    text = f"{graph_table(document)}\n\npicture  {found.path('figures/latent.png')}{_in_latent_space(found)}"
    return VerbResult(text, session.document(graph=document))


def _plan(session: Session) -> VerbResult:
    found = session.produce("plan")
    document = read_json(found.path("plan.json"))
    places = f"picture  {found.path('figures/plan.png')}\nin 3-D   {found.path('scene.html')}{_in_latent_space(found)}"
    path = f"\npath     {found.path('path.npz')}" if document["found"] else ""
    text = f"{plan_table(document)}\n\n{places}{path}"
    return VerbResult(text, session.document(plan=document), exit_code=0 if document["found"] else shared.NO_MOTION)


def _in_latent_space(found: Artefacts) -> str:
    """Where the interactive picture of a latent space of three dimensions is."""
    path = found.folder / LATENT_SCENE
    return f"\nlatent   {path}" if path.exists() else ""


def _evaluate(session: Session) -> VerbResult:
    found = session.produce("evaluate")
    scores = read_json(found.path("scores.json"))
    text = f"{scores_table(scores)}\n\nscores  {found.path('scores.json')}"
    return VerbResult(text, session.document(scores=scores), objective=compare.objective(scores))


def _replay(session: Session) -> VerbResult:
    found = session.produce("replay")
    document = read_json(found.path("replay.json"))
    film = found.folder / "film.gif"
    text = replay_table(document) + (f"\n\nfilm  {film}" if film.exists() else "")
    return VerbResult(
        text, session.document(replay=document), exit_code=0 if _is_executed(document) else shared.NO_MOTION
    )


def _is_executed(replay: Mapping[str, Any]) -> bool:
    """Whether the arm took every pose, and arrived where it had to find its way."""
    return replay["executed"] and not replay["unreachable"] and replay["reached_goal"] is not False


def _report(session: Session) -> VerbResult:
    space = read_json(session.produce("ingest").path("summary.json"))["space"]
    is_of_joints = space == JOINTS or session.config.space is Space.joint
    name = "report" if is_of_joints or space.startswith("R3xS3") else "report without robot"
    return shared.report_verb(session, name)


def _run(session: Session) -> VerbResult:
    planned = read_json(session.produce("plan").path("plan.json"))
    evaluated, reported = _evaluate(session), _report(session)
    lines = [plan_table(planned), "", evaluated.text]
    document = evaluated.document | {"plan": planned} | reported.document
    succeeded = planned["found"]
    if "replay" in session.done:
        document["replay"] = read_json(session.done["replay"].path("replay.json"))
        succeeded = _is_executed(document["replay"])
        lines += ["", replay_table(document["replay"])]
    text = "\n".join([*lines, "", reported.text])
    return VerbResult(text, document, exit_code=0 if succeeded else shared.NO_MOTION, objective=evaluated.objective)


LEAST_DIM = 2  # of a latent space

GMS = Program(
    name="gms",
    steps=STEPS,
    verbs={
        "ingest": shared.ingest_verb,
        "train": _train,
        "graph": _graph,
        "plan": _plan,
        "eval": _evaluate,
        "replay": _replay,
        "report": _report,
        "run": _run,
        "compare": shared.compare_verb,
        "check": shared.check_verb,
    },
    execution_keys=shared.EXECUTION_KEYS | {"metric", "graph", "planning", "robot"},
    check=_require_graph_fits,
)
