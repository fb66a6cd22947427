"""A trained field as an ONNX file: one velocity per state, for control loops without Python or torch."""

import contextlib
import io
import logging
import statistics
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from geomotion.dynamics.fields import ChartedField
from geomotion.files import atomic

INPUT, OUTPUT = "state_m", "velocity_m_per_s"
WARM_UP_QUERIES, TIMED_QUERIES = 200, 1000


def export_onnx(field: ChartedField, path: Path) -> None:
    """Write `field` in single precision; input ``state_m`` and output ``velocity_m_per_s`` have shape (batch, D)."""
    example = torch.zeros(2, field.dim)  # one row would fix the batch size
    with _quiet(), atomic(path) as temporary, torch.no_grad():
        program = torch.onnx.export(
            field.float().eval(),
            (example,),
            input_names=[INPUT],
            output_names=[OUTPUT],
            dynamic_shapes=({0: torch.export.Dim("batch")},),
            dynamo=True,
            verbose=False,
        )
        assert program is not None
        program.save(str(temporary), external_data=False)


class OnnxPolicy:
    """An exported field, one thread, ready for a control loop.

    Args:
        path: File that :func:`export_onnx` wrote.
    """

    def __init__(self, path: Path) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self.session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])

    def __call__(self, states: NDArray[np.float32]) -> NDArray[np.float32]:
        """Velocities [m/s] at states [m], both of shape (batch, D)."""
        velocities: NDArray[np.float32] = self.session.run(None, {INPUT: states})[0]
        return velocities


def query_time_ms(policy: OnnxPolicy, dim: int) -> float:
    """Median time of one velocity at one state [ms]."""
    state = np.zeros((1, dim), dtype=np.float32)
    for _ in range(WARM_UP_QUERIES):
        policy(state)
    times = []
    for _ in range(TIMED_QUERIES):
        begun = time.perf_counter()
        policy(state)
        times.append(time.perf_counter() - begun)
    return 1000 * statistics.median(times)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """The exporter warns about packages that it would like to see, and prints its progress."""
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(logging.NOTSET)
