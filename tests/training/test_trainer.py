import math
import os
import signal

import pytest
import torch
from torch import nn

from geomotion.errors import CorruptArtefact, Interrupted, TrainingDiverged
from geomotion.training.trainer import Schedule, fit


def schedule(**changes) -> Schedule:
    settings = {
        "steps": 40,
        "learning_rate": 0.05,
        "ramp_steps": 5,
        "gradient_clip": 1.0,
        "checkpoint_every_steps": 10,
        "log_every_steps": 8,
        "seed": 3,
    }
    return Schedule(**(settings | changes))


class NoisyQuadratic:
    """A loss with a random part, so that a resumed training has to draw the same numbers; can signal once."""

    def __init__(self, signal_at: int | None = None) -> None:
        self.signal_at = signal_at
        self.calls = 0

    def __call__(self, model, progress, generator):
        self.calls += 1
        if self.calls == self.signal_at:
            os.kill(os.getpid(), signal.SIGTERM)
        inputs = torch.randn(8, 2, generator=generator)
        return {"fit": model(inputs).square().mean(), "bias": 0.1 * (model.bias - 1).square().sum()}


def model() -> nn.Module:
    torch.manual_seed(0)
    return nn.Linear(2, 3)


def ignore(step, values):
    """Log nothing."""


def test_training_lowers_the_loss_and_logs_every_term(tmp_path):
    logged = {}
    history = fit(model(), NoisyQuadratic(), schedule(), tmp_path / "checkpoint", logged.__setitem__)
    assert list(logged) == [0, 8, 16, 24, 32, 39]
    assert history.rows[-1]["total"] < history.rows[0]["total"]
    assert history.rows[0]["total"] == pytest.approx(history.rows[0]["fit"] + history.rows[0]["bias"])


@pytest.mark.parametrize("stopped_at", [1, 17, 40])
def test_an_interrupted_training_ends_in_the_same_parameters(tmp_path, stopped_at):
    whole, resumed = model(), model()
    expected = fit(whole, NoisyQuadratic(), schedule(), tmp_path / "whole", ignore)
    with pytest.raises(Interrupted) as stopped:
        fit(resumed, NoisyQuadratic(stopped_at), schedule(), tmp_path / "resumed", ignore)
    assert stopped.value.exit_code == 128 + signal.SIGTERM
    again = model()
    history = fit(again, NoisyQuadratic(), schedule(), tmp_path / "resumed", ignore)
    for one, other in zip(whole.parameters(), again.parameters(), strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=0)
    assert history.rows == expected.rows


def test_a_loss_that_is_not_finite_stops_the_training(tmp_path):
    def explode(model, progress, generator):
        return {"loss": model.weight.sum() * (math.inf if progress > 0.5 else 1.0)}

    with pytest.raises(TrainingDiverged, match="step 21"):
        fit(model(), explode, schedule(), tmp_path / "checkpoint", ignore)


class Steep(torch.autograd.Function):
    """Zero, with a slope of choice."""

    @staticmethod
    def forward(ctx, value, slope):
        ctx.slope = slope
        return value * 0

    @staticmethod
    def backward(ctx, gradient):
        return gradient * ctx.slope, None


def test_parameters_that_the_last_step_ruins_stop_the_training(tmp_path):
    def ruin(model, progress, generator):
        return {"loss": Steep.apply(model.weight.sum() + model.bias.sum(), 1.0 if progress < 0.97 else math.inf)}

    with pytest.raises(TrainingDiverged, match="step 40"):
        fit(model(), ruin, schedule(), tmp_path / "checkpoint", ignore)


def test_a_continued_training_says_where_it_begins(tmp_path, caplog):
    with pytest.raises(Interrupted):
        fit(model(), NoisyQuadratic(17), schedule(), tmp_path / "checkpoint", ignore)
    with caplog.at_level("INFO", "geomotion"):
        fit(model(), NoisyQuadratic(), schedule(), tmp_path / "checkpoint", ignore)
    assert "train: continues at step 17 of 40" in caplog.messages


def test_a_damaged_checkpoint_is_reported(tmp_path):
    (tmp_path / "checkpoint").write_bytes(b"PK\x03\x04 half a file")
    with pytest.raises(CorruptArtefact, match="checkpoint cannot be read"):
        fit(model(), NoisyQuadratic(), schedule(), tmp_path / "checkpoint", ignore)


def test_the_learning_rate_rises_and_falls_to_zero():
    rates = [schedule().learning_rate_at(step) for step in range(40)]
    assert rates[0] == pytest.approx(0.01)
    assert max(rates) == rates[4] <= 0.05
    assert rates[-1] < 1e-3
