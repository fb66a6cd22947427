"""Judge a trained field: scores, the arrays behind them, pictures, and the measured side of its certificate."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from geomotion import models
from geomotion.config import EvaluationConfig, Protocol, SolverConfig
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.rollout import rollout
from geomotion.errors import InvalidSetting
from geomotion.figures.evaluation import save_all
from geomotion.files import atomic, read_json, write_json
from geomotion.models import Skill
from geomotion.scores.contraction import judge_contraction
from geomotion.scores.evaluation import Evaluation, Unit, combine
from geomotion.scores.goal import judge_goal
from geomotion.scores.grids import bounding_box, sample_box
from geomotion.scores.nearby import judge_nearby, nearby_starts
from geomotion.scores.reproduction import Judged, judge_reproduction
from geomotion.scores.support import RegionProtocol, judge_region
from geomotion.tracking import Artefacts, StageRun

PEERS_TRIM_POINTS = 15
PEERS_TRAIN_DEMOS = (0, 1, 2, 3, 4)
PICTURE_POINTS_PER_AXIS = 40  # of the velocity field


@dataclass(frozen=True)
class EvaluateConfig:
    """What the evaluate stage needs.

    Attributes:
        evaluation: Protocol and grids.
        solver: How rollouts are computed.
        trim_start_points: Points that ingest dropped from each start, which the peers' protocol prescribes.
    """

    evaluation: EvaluationConfig
    solver: SolverConfig
    trim_start_points: int


def evaluate(config: EvaluateConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``scores.json``, ``evaluation.npz``, ``certificate.json`` and the figures.

    Raises:
        InvalidSetting: If the peers' protocol is asked for on other data than theirs.
    """
    skill = models.load(inputs["train"].path("model.pt"))
    certificate = read_json(inputs["train"].path("certificate.json"))
    demonstrations = storage.load(inputs["ingest"].folder)
    if config.evaluation.protocol is Protocol.peers:
        require_peers_data(skill.train_demos, config.trim_start_points)

    evaluation = compute(skill, demonstrations, certificate["rate_per_s"], config.evaluation, config.solver)

    document = evaluation.document(config.evaluation.protocol.value, demonstrations.name)
    write_json(run.folder / "scores.json", document)
    with atomic(run.folder / "evaluation.npz") as temporary:
        np.savez_compressed(temporary, **evaluation.arrays)  # type: ignore[arg-type]
    certificate["audit"] = audit(evaluation)
    write_json(run.folder / "certificate.json", certificate)
    run.log_scores(evaluation.scores)
    save_all(evaluation.arrays, certificate, run.folder / "figures")


def require_peers_data(train_demos: tuple[int, ...], trim_start_points: int) -> None:
    """Check that numbers can stand beside those the peers publish.

    Raises:
        InvalidSetting: If demonstrations 0-4 were not trained on, or 15 points not trimmed.
    """
    if train_demos != PEERS_TRAIN_DEMOS or trim_start_points != PEERS_TRIM_POINTS:
        raise InvalidSetting(
            "evaluation",
            "peers",
            f"a model trained with dataset.train_demos={list(PEERS_TRAIN_DEMOS)} and dataset.preprocess."
            f"trim_start_points={PEERS_TRIM_POINTS}; this one has {list(train_demos)} and {trim_start_points}",
        )


def compute(
    skill: Skill,
    demonstrations: Demonstrations,
    proven_rate: float | None,
    settings: EvaluationConfig,
    solver: SolverConfig,
) -> Evaluation:
    """All scores of a model, without reading or writing files.

    Args:
        skill: The model.
        demonstrations: All demonstrations, with those it was fitted to.
        proven_rate: Contraction rate of its certificate [1/s]; None if nothing is proven.
        settings: Protocol and grids.
        solver: How rollouts are computed.
    """
    player = Player(skill.field, solver)
    judged = [player.judge(demonstrations, skill.state_channels, number, True) for number in skill.train_demos]
    if settings.protocol is Protocol.heldout:
        judged += [player.judge(demonstrations, skill.state_channels, number, False) for number in skill.test_demos]
    trained = [one for one in judged if one.is_trained]
    tight = bounding_box([one.states for one in trained])
    box = tight.enlarged(settings.grid_margin)
    duration_s = float(np.mean([one.time_s[-1] for one in trained]))
    grid = sample_box(box, settings.contraction_grid_points, settings.seed)
    starts_per_axis = round(settings.region_starts**0.5)
    region = RegionProtocol(
        starts_per_axis,
        settings.region_steps,
        duration_s / float(np.mean([len(one.time_s) for one in trained])),
        settings.region_margin * tight.diagonal,
    )
    nearby = nearby_starts(
        trained[0].states[0], settings.nearby_starts, settings.nearby_spread * tight.diagonal, settings.seed
    )
    parts = [
        judge_reproduction(judged, state_unit(skill.state_channels)),
        judge_contraction(skill.field, player.tensor(grid.points), grid.note),
        Evaluation(arrays={"grid_points": grid.points, "grid_shape": np.array(grid.shape, dtype=int)}),
        judge_region(player.roll, np.concatenate([one.states for one in trained]), box, region),
        judge_nearby(player.roll, player.to_claimed, nearby, trained[0].time_s, proven_rate),
        judge_goal(
            player.roll,
            skill.goal.double().numpy(),
            sample_box(box, starts_per_axis, settings.seed),
            np.linspace(0.0, settings.goal_duration * duration_s, settings.region_steps),
            settings.goal_tolerance * tight.diagonal,
        ),
    ]
    if box.dim == 2:
        plane = sample_box(box, PICTURE_POINTS_PER_AXIS, settings.seed).points
        parts.append(Evaluation(arrays={"field_points": plane, "field_velocity": player.velocity(plane)}))
    return combine(parts)


def audit(evaluation: Evaluation) -> dict[str, Any]:
    """Measured numbers that bear on the claim of a certificate, under the names of their scores."""
    bearing = ("contraction.", "nearby.claimed.")
    return {name: score.as_dict()["value"] for name, score in evaluation.scores.items() if name.startswith(bearing)}


def state_unit(channels: tuple[str, ...]) -> Unit:
    """Millimetres for positions, radians for joints, and no common unit for mixtures."""
    units = {"position_m": Unit("mm", 1000.0), "joints_rad": Unit("rad")}
    kinds = {units.get(channel, Unit("state unit")) for channel in channels}
    return kinds.pop() if len(kinds) == 1 else Unit("state unit")


class Player:
    """A field as functions of arrays, evaluated in the field's own precision.

    Args:
        field: The field.
        solver: How rollouts are computed.
    """

    def __init__(self, field: ChartedField, solver: SolverConfig) -> None:
        self.field = field
        self.solver = solver
        self.dtype = next(field.parameters()).dtype

    def tensor(self, values: np.ndarray) -> torch.Tensor:
        """In the field's precision."""
        return torch.as_tensor(values, dtype=self.dtype)

    def roll(self, starts: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        """Trajectories, shape (start, time, D) [m]."""
        result = rollout(
            self.field,
            self.tensor(starts),
            self.tensor(times_s),
            method=self.solver.method.value,
            substeps=self.solver.substeps,
            relative_tolerance=self.solver.relative_tolerance,
            absolute_tolerance=self.solver.absolute_tolerance,
        )
        return result.states.double().numpy()

    @torch.no_grad()
    def velocity(self, states: np.ndarray) -> np.ndarray:
        """ẋ at each state [m/s]."""
        return self.field(self.tensor(states)).double().numpy()

    @torch.no_grad()
    def to_claimed(self, states: np.ndarray) -> np.ndarray:
        """ψ at each state."""
        return self.field.chart.to_latent(self.tensor(states)).double().numpy()

    def judge(self, demonstrations: Demonstrations, channels: tuple[str, ...], number: int, is_trained: bool) -> Judged:
        """One demonstration beside the rollout from its start."""
        demonstration = demonstrations[number]
        states = demonstration.state(channels)
        time_s = demonstration.time_s - demonstration.time_s[0]
        return Judged(
            time_s,
            states,
            demonstration.velocity(channels),
            self.roll(states[:1], time_s)[0],
            self.velocity(states),
            is_trained,
        )
