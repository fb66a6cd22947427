"""What saves a training that breaks down: its last good parameters, and a smaller learning rate from there on."""

import logging
import math
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import torch
from torch import nn

from geomotion.errors import TrainingDiverged

logger = logging.getLogger(__name__)

KEPT_EVERY_STEPS = 50
WINDOW = 200  # losses of which the median is taken
FAR = 10.0  # times that median
PATIENCE = 50  # steps in a row; single bad batches are no breakdown
SLOWER = 0.3  # times the learning rate, after each return
MOST_RETURNS = 3


@dataclass(frozen=True)
class Return:
    """A breakdown, and what was done about it.

    Attributes:
        step: At which the training had broken down.
        loss: Then; NaN or infinite where it, or its gradient, was.
        to_step: Whose parameters were taken up again.
        learning_rate_factor: What learning rates are multiplied with from then on.
    """

    step: int
    loss: float
    to_step: int
    learning_rate_factor: float

    def as_dict(self) -> dict[str, Any]:
        """Plain types for JSON, which has no word for NaN and infinity: they become null."""
        return asdict(self) | {"loss": self.loss if math.isfinite(self.loss) else None}


class Recovery:
    """Watches the losses of a training and takes it back when it breaks down.

    Broken down is a loss, or a gradient, that is not finite; or a loss that stays, for `PATIENCE` steps in a row, worse
    than at the start and above `FAR` times its running median. A training that does neither is only watched.

    Args:
        model: Is taken back in place.
        optimiser: Likewise.
    """

    def __init__(self, model: nn.Module, optimiser: torch.optim.Optimizer) -> None:
        self.model, self.optimiser = model, optimiser
        self.returns: list[Return] = []
        self._recent: list[float] = []
        self._first = math.inf
        self._bad_steps = 0
        self._keep(0)

    @property
    def learning_rate_factor(self) -> float:
        """What learning rates have to be multiplied with; 1 before the first return."""
        return self.returns[-1].learning_rate_factor if self.returns else 1.0

    def is_broken(self, loss: float) -> bool:
        """Whether the training has broken down, by the loss of this step as well; asked once a step."""
        if not math.isfinite(loss):
            return True
        if math.isinf(self._first):
            self._first = loss
        if len(self._recent) >= PATIENCE and loss > self._first and loss > FAR * abs(median(self._recent)):
            self._bad_steps += 1
            return self._bad_steps >= PATIENCE
        self._bad_steps = 0
        self._recent = [*self._recent[1 - WINDOW :], loss]
        return False

    def keep_if_due(self, done: int) -> None:
        """Remember the parameters after `done` steps, unless the loss is bad; asked after every step."""
        if done % KEPT_EVERY_STEPS == 0 and self._bad_steps == 0:
            self._keep(done)

    def go_back(self, step: int, loss: float) -> None:
        """Take up the last good parameters again.

        Raises:
            TrainingDiverged: If that was done `MOST_RETURNS` times already.
        """
        if len(self.returns) == MOST_RETURNS:
            raise TrainingDiverged(step, loss)
        self.model.load_state_dict(self._good["model"])
        self.optimiser.load_state_dict(deepcopy(self._good["optimiser"]))  # it would go on in the remembered tensors
        self.returns.append(Return(step, loss, self._good["step"], SLOWER * self.learning_rate_factor))
        self._recent, self._bad_steps = [], 0  # should the loss remain high, that is no second breakdown
        logger.warning(
            "train: broke down at step %d with a loss of %.3g; goes on from the parameters of step %d, "
            "with %.2g times the learning rate",
            step,
            loss,
            self._good["step"],
            self.learning_rate_factor,
        )

    def state(self) -> dict[str, Any]:
        """All of it, for a checkpoint."""
        return {
            "returns": [asdict(one) for one in self.returns],
            "recent": self._recent,
            "first": self._first,
            "bad_steps": self._bad_steps,
            "good": self._good,
        }

    def load_state(self, state: Mapping[str, Any]) -> None:
        """What :meth:`state` gave."""
        self.returns = [Return(**one) for one in state["returns"]]
        self._recent, self._first = list(state["recent"]), float(state["first"])
        self._bad_steps, self._good = int(state["bad_steps"]), dict(state["good"])

    def _keep(self, done: int) -> None:
        self._good = {
            "step": done,
            "model": deepcopy(self.model.state_dict()),
            "optimiser": deepcopy(self.optimiser.state_dict()),
        }
