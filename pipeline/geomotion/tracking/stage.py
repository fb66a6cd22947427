"""What a stage is, and the handle through which it writes files and logs numbers."""

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geomotion.interrupts import held_signals
from geomotion.policy.ports import STATUS, Input, Output
from geomotion.scores.score import Score
from geomotion.tracking.artefacts import Artefacts

if TYPE_CHECKING:
    from mlflow import MlflowClient

FLUSH_AT = 500  # MLflow takes at most 1000 values a call, each call costs about 25 ms


class StageRun:
    """A running stage.

    Args:
        folder: Where the stage writes its outputs; they become its artefacts when it ends.
        checkpoint: A file that survives an interruption; the next run of the same computation finds it.
        client: MLflow client.
        run_id: MLflow run of the stage.
    """

    def __init__(self, folder: Path, checkpoint: Path, client: "MlflowClient", run_id: str) -> None:
        self.folder = folder
        self.checkpoint = checkpoint
        self.run_id = run_id
        self._client = client
        self._pending: list[tuple[str, float, int]] = []

    def log_scores(self, scores: Mapping[str, Score]) -> None:
        """Log the values of scores."""
        self.log_series(0, {name: score.value for name, score in scores.items()})

    def log_series(self, step: int, values: Mapping[str, float]) -> None:
        """Log values of one step of a curve (buffered)."""
        self._pending += [(name, float(value), step) for name, value in values.items()]
        if len(self._pending) >= FLUSH_AT:
            self.flush()

    @contextmanager
    def flushed(self) -> Iterator[None]:
        """Send what the block logged, also if it fails; its error is then the one to report."""
        try:
            yield
        except BaseException:
            with suppress(Exception):
                self.flush()
            raise
        self.flush()

    def flush(self) -> None:
        """Send what is buffered."""
        from mlflow.entities import Metric

        now = int(time.time() * 1000)
        for begin in range(0, len(self._pending), FLUSH_AT):
            batch = self._pending[begin : begin + FLUSH_AT]
            self._client.log_batch(self.run_id, metrics=[Metric(name, value, now, step) for name, value, step in batch])
        self._pending = []

    def log_dataset(self, name: str, digest: str, source: str) -> None:
        """Link a dataset to the run."""
        from mlflow.entities import Dataset, DatasetInput, InputTag

        entity = Dataset(name=name, digest=digest[:36], source_type="code", source=source)
        self._client.log_inputs(self.run_id, [DatasetInput(entity, [InputTag("mlflow.data.context", "training")])])

    def log_policy(
        self, path: Path, inputs: Sequence[Input], outputs: Sequence[Output], register_as: str | None
    ) -> None:
        """Log an exported policy as an MLflow model, and register it if it has a name.

        Args:
            path: The ONNX file.
            inputs: What it takes; MLflow passes on those that have to be given.
            outputs: What it gives.
            register_as: Name in the registry.
        """
        import mlflow
        import numpy as np
        from mlflow.models import ModelSignature
        from mlflow.types import Schema, TensorSpec

        needed = [TensorSpec(np.dtype(np.float32), (-1, one.width), one.name) for one in inputs if one.default is None]
        given = [
            TensorSpec(np.dtype(np.int64 if one.name == STATUS else np.float32), (-1, *_columns(one)), one.name)
            for one in outputs
        ]
        with held_signals(), mlflow.start_run(run_id=self.run_id), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mlflow.pyfunc.log_model(
                name="policy",
                python_model=str(Path(__file__).parents[1] / "policy_model.py"),
                artifacts={"policy": str(path)},
                signature=ModelSignature(Schema(list(needed)), Schema(list(given))),
                pip_requirements=["onnxruntime", "numpy", "mlflow"],
                registered_model_name=register_as,
            )
        self._client.update_run(self.run_id, status="RUNNING")


def _columns(output: Output) -> tuple[int, ...]:
    return () if output.width is None else (output.width,)


StageFunction = Callable[[Any, Mapping[str, Artefacts], StageRun], None]


@dataclass(frozen=True)
class Stage:
    """A step of the pipeline: read artefacts, compute, write artefacts.

    Attributes:
        name: Name of the stage.
        function: The computation.
        reads_outside: Whether it reads files that no earlier stage wrote. Its inputs can then change unseen, so
            it is always repeated, and its result kept only if it is new.
    """

    name: str
    function: StageFunction
    reads_outside: bool = False
