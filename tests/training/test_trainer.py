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


class Breaking:
    """A quadratic loss; at one call something goes wrong."""

    def __init__(self, at: int, signal_at: int | None = None) -> None:
        self.at = at
        self.whole = NoisyQuadratic(signal_at)

    def __call__(self, model, progress, generator):
        losses = self.whole(model, progress, generator)
        return self.broken(model, losses) if self.whole.calls == self.at else losses


class Infinite(Breaking):
    def broken(self, model, losses):
        return {"fit": losses["fit"] * math.inf, "bias": losses["bias"]}


class Displaced(Breaking):
    """Its parameters are thrown far away, where a clipped gradient does not bring them back from."""

    def broken(self, model, losses):
        with torch.no_grad():
            model.bias += 100
        return losses


class Steep(torch.autograd.Function):
    """The value, with an infinite slope."""

    @staticmethod
    def forward(ctx, value):
        return value.clone()

    @staticmethod
    def backward(ctx, gradient):
        return gradient * math.inf


class InfiniteSlope(Breaking):
    def broken(self, model, losses):
        return {"fit": Steep.apply(losses["fit"])}


@pytest.mark.parametrize(("kind", "at"), [(Infinite, 20), (InfiniteSlope, 20), (InfiniteSlope, 40)])
def test_what_is_not_finite_takes_the_training_back_and_slows_it(tmp_path, caplog, kind, at):
    trained = model()
    history = fit(trained, kind(at), schedule(log_every_steps=1), tmp_path / "checkpoint", ignore)
    (back,) = history.returns
    assert (back.step, back.to_step, back.learning_rate_factor) == (at - 1, 0, 0.3)
    assert not math.isfinite(back.loss)
    assert f"broke down at step {back.step}" in caplog.text
    assert all(parameter.isfinite().all() for parameter in trained.parameters())
    rates = {int(row["step"]): row["learning_rate"] for row in history.rows}
    assert back.step not in rates
    for step, rate in rates.items():
        assert rate == pytest.approx(schedule().learning_rate_at(step) * (0.3 if step > back.step else 1.0))


def test_a_loss_that_stays_far_above_its_median_takes_the_training_back(tmp_path):
    trained, long = model(), schedule(steps=400)
    history = fit(trained, Displaced(190), long, tmp_path / "checkpoint", ignore)
    (back,) = history.returns
    assert (back.step, back.to_step) == (239, 150)  # the loss rises after the displacement and has to stay up
    assert history.rows[-1]["total"] < 0.01 * back.loss
    assert trained.bias.norm() < 2


def test_a_training_that_does_not_break_down_is_only_watched(tmp_path):
    watched, plain, long = model(), model(), schedule(steps=120)
    history = fit(watched, NoisyQuadratic(), long, tmp_path / "checkpoint", ignore)
    objective, optimiser = NoisyQuadratic(), torch.optim.Adam(plain.parameters(), 0.05, fused=True)
    for step in range(long.steps):
        optimiser.param_groups[0]["lr"] = long.learning_rate_at(step)
        generator = torch.Generator().manual_seed(3 * 1_000_003 + step)
        optimiser.zero_grad()
        torch.stack(list(objective(plain, step / long.steps, generator).values())).sum().backward()
        nn.utils.clip_grad_norm_(plain.parameters(), 1.0)
        optimiser.step()
    assert history.returns == []
    for one, other in zip(watched.parameters(), plain.parameters(), strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=0)


@pytest.mark.parametrize("stopped_at", [200, 260])
def test_a_training_interrupted_around_a_breakdown_ends_in_the_same_parameters(tmp_path, stopped_at):
    whole, again, long = model(), model(), schedule(steps=300)
    expected = fit(whole, Displaced(190), long, tmp_path / "whole", ignore)
    with pytest.raises(Interrupted):
        fit(model(), Displaced(190, stopped_at), long, tmp_path / "resumed", ignore)
    history = fit(again, NoisyQuadratic(), long, tmp_path / "resumed", ignore)
    assert history.returns == expected.returns
    for one, other in zip(whole.parameters(), again.parameters(), strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=0)


def test_a_training_that_breaks_down_again_and_again_is_stopped(tmp_path):
    def explode(model, progress, generator):
        return {"loss": model.weight.sum() * (math.inf if progress > 0.5 else 1.0)}

    with pytest.raises(TrainingDiverged, match="step 24"):  # three steps after the first
        fit(model(), explode, schedule(), tmp_path / "checkpoint", ignore)


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
