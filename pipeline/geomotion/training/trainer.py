"""The one training loop: fixed number of steps, seeded by step, checkpointed, resumed to the same result."""

import logging
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, TypeVar, runtime_checkable

import torch
from torch import Tensor, nn
from tqdm import tqdm

from geomotion.errors import CorruptArtefact, TrainingDiverged
from geomotion.files import write_tensors
from geomotion.interrupts import PendingInterrupt, postponed_interrupts
from geomotion.training.recovery import Recovery, Return

logger = logging.getLogger(__name__)

Model = TypeVar("Model", bound=nn.Module, contravariant=True)
AnyModel = TypeVar("AnyModel", bound=nn.Module)
Losses = Mapping[str, Tensor]
Log = Callable[[int, Mapping[str, float]], None]


@runtime_checkable
class Objective(Protocol[Model]):
    """What a model is fitted to."""

    def __call__(self, model: Model, progress: float, generator: torch.Generator) -> Losses:
        """Weighted loss terms by name; the model minimises their sum.

        Args:
            model: The model.
            progress: Share of the training that is done, in [0, 1).
            generator: Source of all randomness of this step.
        """
        ...


@dataclass(frozen=True)
class Schedule:
    """Numbers of the loop.

    Attributes:
        steps: Optimiser steps.
        learning_rate: Of Adam, at its highest; falls to zero along a cosine.
        ramp_steps: Steps over which it rises.
        gradient_clip: Largest norm of the gradient.
        checkpoint_every_steps: Steps between checkpoints.
        log_every_steps: Steps between logged losses.
        seed: Seed of every step's generator.
    """

    steps: int
    learning_rate: float
    ramp_steps: int
    gradient_clip: float
    checkpoint_every_steps: int
    log_every_steps: int
    seed: int

    def learning_rate_at(self, step: int) -> float:
        """Rate of one step, a function of nothing else, so that a resumed training has no state to restore."""
        ramp = min(1.0, (step + 1) / self.ramp_steps)
        return self.learning_rate * ramp * (1 + math.cos(math.pi * step / self.steps)) / 2


@dataclass
class History:
    """What a training went through.

    Attributes:
        rows: Logged losses, one row a logged step.
        returns: Breakdowns that it was taken back from.
    """

    rows: list[dict[str, float]] = field(default_factory=list)
    returns: list[Return] = field(default_factory=list)


def fit(model: AnyModel, objective: Objective[AnyModel], schedule: Schedule, checkpoint: Path, log: Log) -> History:
    """Train a model in place, continuing from `checkpoint` if there is one.

    A signal is obeyed between two steps, after a checkpoint: the continued training ends in the same
    parameters as an uninterrupted one. A training that breaks down goes back to its last good parameters, see
    :class:`Recovery`.

    Raises:
        TrainingDiverged: If it breaks down again and again, or a parameter is not finite in the end.
        Interrupted: If a signal arrived.
        CorruptArtefact: If the checkpoint cannot be read.
    """
    optimiser = torch.optim.Adam(model.parameters(), schedule.learning_rate, fused=True)
    recovery = Recovery(model, optimiser)
    start, history = _restore(checkpoint, model, optimiser, recovery)
    if start > 0:
        logger.info("train: continues at step %d of %d", start, schedule.steps)
    model.train()
    with postponed_interrupts() as pending:
        for step in _progress(start, schedule.steps):
            losses = _step(model, objective, optimiser, recovery, schedule, step)
            if losses is not None and (step % schedule.log_every_steps == 0 or step == schedule.steps - 1):
                history.rows.append(_record(step, losses, optimiser, log))
            _checkpoint_if_due(checkpoint, step + 1, schedule, pending, model, optimiser, recovery, history)
    if not all(parameter.isfinite().all() for parameter in model.parameters()):  # by the last step, whose loss was
        raise TrainingDiverged(schedule.steps, math.nan)
    model.eval()
    history.returns = recovery.returns
    return history


def _step(
    model: AnyModel,
    objective: Objective[AnyModel],
    optimiser: torch.optim.Optimizer,
    recovery: Recovery,
    schedule: Schedule,
    step: int,
) -> Losses | None:
    """Losses of one step; None where the training had broken down and was taken back instead."""
    progress = step / schedule.steps
    for group in optimiser.param_groups:
        group["lr"] = schedule.learning_rate_at(step) * recovery.learning_rate_factor
    losses = objective(model, progress, torch.Generator().manual_seed(schedule.seed * 1_000_003 + step))
    total = torch.stack(list(losses.values())).sum()
    if recovery.is_broken(float(total.detach())):
        recovery.go_back(step, float(total.detach()))
        return None
    optimiser.zero_grad()
    total.backward()  # type: ignore[no-untyped-call]
    size = nn.utils.clip_grad_norm_(model.parameters(), schedule.gradient_clip)
    if not size.isfinite():
        recovery.go_back(step, float(size))
        return None
    optimiser.step()
    recovery.keep_if_due(step + 1)
    return losses


def _record(step: int, losses: Losses, optimiser: torch.optim.Optimizer, log: Log) -> dict[str, float]:
    values = {name: float(loss.detach()) for name, loss in losses.items()}
    row = {"total": sum(values.values()), **values, "learning_rate": optimiser.param_groups[0]["lr"]}
    log(step, row)
    return {"step": float(step), **row}


def _checkpoint_if_due(
    path: Path,
    done: int,
    schedule: Schedule,
    pending: PendingInterrupt,
    model: nn.Module,
    optimiser: torch.optim.Optimizer,
    recovery: Recovery,
    history: History,
) -> None:
    if pending.signal_number is not None or (done % schedule.checkpoint_every_steps == 0 and done < schedule.steps):
        state = {
            "step": done,
            "model": model.state_dict(),
            "optimiser": optimiser.state_dict(),
            "recovery": recovery.state(),
            "history": history.rows,
        }
        write_tensors(path, state)
    pending.raise_if_set()


def _restore(path: Path, model: nn.Module, optimiser: torch.optim.Optimizer, recovery: Recovery) -> tuple[int, History]:
    if not path.is_file():
        return 0, History()
    try:
        state = torch.load(path, weights_only=True)
        model.load_state_dict(state["model"])
        optimiser.load_state_dict(state["optimiser"])
        recovery.load_state(state["recovery"])
        return int(state["step"]), History(state["history"])
    except Exception as error:  # torch reports damage by many types
        raise CorruptArtefact(path, "this checkpoint cannot be read") from error


def _progress(start: int, steps: int) -> "tqdm[int]":
    # disable=None: silent where standard error is not a terminal
    return tqdm(
        range(start, steps), "train", steps, initial=start, unit="step", file=sys.stderr, leave=False, disable=None
    )
