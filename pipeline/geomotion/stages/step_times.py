"""How long one integration step takes: the exported policy, and the thesis' way in the same dimension, Table 6.3."""

import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch

from geomotion import config as schema
from geomotion import models
from geomotion.demos.demonstrations import Demonstrations
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.injective import decoder_of
from geomotion.export import OnnxPolicy, export_onnx, query_time_ms
from geomotion.models import ModelConfig, Skill
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.score import Score
from geomotion.stages.export import demonstrated_start, trained_policy
from geomotion.types import Float, State, Tensor

STEP_S = 0.01
LATENT_DIM = 2  # of the thesis' decoder
UNTRAINED = "untrained networks of the thesis' sizes; line integrals of trained ones take dopri5 more steps"
THESIS_FIELD = schema.LineIntegralField(integrator=schema.Integrator.dopri5)


def judge_step_times(skill: Skill, demonstrations: Demonstrations, steps: int) -> Evaluation:
    """Median times of single steps at demonstrated states, on one core, in one process.

    Args:
        skill: Ours.
        demonstrations: What it was fitted to, with the channels of its state.
        steps: How many of the thesis' are timed; none at all if zero.
    """
    if steps == 0:
        return Evaluation({})
    states = demonstrations[0].state(skill.state_channels)
    chosen = torch.tensor(states[np.linspace(0, len(states) - 1, steps).astype(int)], dtype=torch.float32)
    exported = _exported_ms(skill, demonstrations)
    with_field = _median_ms(step_of_field(skill), chosen)
    scores = {
        "step.exported": Score(exported, "ms", statistic="median", note="one query of policy.onnx, one core"),
        "step.thesis": Score(with_field, "ms", steps, statistic="median", note=f"without decoder; {UNTRAINED}"),
        "step.thesis_ratio": Score(with_field / exported, "1", steps, note="without decoder, over the exported policy"),
    }
    if skill.field.dim > LATENT_DIM:
        decoded = _median_ms(step_of_decoder(skill), chosen)
        note = f"with a decoder of {LATENT_DIM} codes and its full Jacobian; {UNTRAINED}"
        scores["step.thesis_latent"] = Score(decoded, "ms", steps, statistic="median", note=note)
        scores["step.thesis_latent_ratio"] = Score(
            decoded / exported, "1", steps, note="with a decoder, over the exported policy"
        )
    return Evaluation(scores)


def _exported_ms(skill: Skill, demonstrations: Demonstrations) -> float:
    policy = trained_policy(skill, demonstrations, schema.PolicyConfig())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "policy.onnx"
        export_onnx(policy, path)
        return query_time_ms(OnnxPolicy(path), demonstrated_start(policy, demonstrations))


def step_of_field(skill: Skill) -> Callable[[State], State]:
    """x + ẋ dt with the line integral of all coordinates, Eq. (5.2)."""
    field = _thesis_field(skill, schema.IdentityChart())
    return lambda x: x + STEP_S * field(x)


def step_of_decoder(skill: Skill) -> Callable[[State], State]:
    """Algorithm 2: encode, the line integral of the codes, and ẋ = J ż with the whole Jacobian of the decoder."""
    field = _thesis_field(skill, schema.InjectiveVaeChart(latent_dim=LATENT_DIM))
    decoder = decoder_of(field)

    def step(x: Float[Tensor, "1 D"]) -> Float[Tensor, "1 D"]:
        code = decoder.to_latent(x)
        rate = field.field(code) / field.time_unit_s
        jacobian = torch.autograd.functional.jacobian(decoder.to_ambient, code[0])  # type: ignore[no-untyped-call]
        moved: Tensor = x + STEP_S * (jacobian @ rate[0])
        return moved

    return step


def _thesis_field(skill: Skill, chart: schema.ChartConfig) -> ChartedField:
    return models.build(ModelConfig(chart, THESIS_FIELD, schema.ConstantRegulariser(), 0), skill.geometry).eval()


@torch.no_grad()
def _median_ms(step: Callable[[State], State], states: Float[Tensor, "step D"]) -> float:
    times: Sequence[float] = [_seconds(step, x[None]) for x in (states[0], *states)][1:]  # the first one warms up
    return 1000 * statistics.median(times)


def _seconds(step: Callable[[State], State], x: State) -> float:
    """Processor time: steps as long as these are interrupted where others are at work, and queries of ours hardly."""
    begun = time.thread_time()
    step(x)
    return time.thread_time() - begun
