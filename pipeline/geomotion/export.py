"""A trained field as an ONNX file: one velocity per state, for control loops without Python or torch.

A field with conditions takes the condition as a further input, one with a time law the time since the start.
"""

import contextlib
import io
import logging
import statistics
import time
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from geomotion.conditional_models import ConditionalPolicy
from geomotion.dynamics.fields import ChartedField
from geomotion.files import atomic

INPUT, CONDITION, ELAPSED, OUTPUT = "state_m", "condition", "elapsed_s", "velocity_m_per_s"
ARGUMENTS = {INPUT: "x", CONDITION: "condition", ELAPSED: "elapsed_s"}  # of the fields, for each input of the file
WARM_UP_QUERIES, TIMED_QUERIES = 200, 1000


def export_onnx(field: ChartedField | ConditionalPolicy, path: Path) -> None:
    """Write a field in single precision.

    Inputs are ``state_m`` of shape (batch, D), where there are conditions ``condition`` of shape (batch, K), and with a
    time law ``elapsed_s`` of shape (batch, 1); the output is ``velocity_m_per_s`` of shape (batch, D).
    """
    widths = input_widths(field)
    examples = {name: torch.zeros(2, width) for name, width in widths.items()}  # one row would fix the batch size
    with _quiet(), atomic(path) as temporary, torch.no_grad():
        program = torch.onnx.export(
            field.float().eval(),
            kwargs={ARGUMENTS[name]: example for name, example in examples.items()},
            input_names=list(widths),
            output_names=[OUTPUT],
            dynamic_shapes={ARGUMENTS[name]: {0: torch.export.Dim("batch")} for name in widths},
            dynamo=True,
            verbose=False,
        )
        assert program is not None
        program.save(str(temporary), external_data=False)


def input_widths(field: ChartedField | ConditionalPolicy) -> dict[str, int]:
    """Columns of each input, in their order."""
    widths = {INPUT: field.dim}
    if isinstance(field, ConditionalPolicy):
        widths[CONDITION] = field.condition_dim
    if field.time_law is not None:
        widths[ELAPSED] = 1
    return widths


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

    def __call__(self, *inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Velocities [m/s] at states [m], then conditions and times since the start [s], where the field takes them."""
        names = [one.name for one in self.session.get_inputs()]
        velocities: NDArray[np.float32] = self.session.run(None, dict(zip(names, inputs, strict=True)))[0]
        return velocities


def query_time_ms(policy: OnnxPolicy, widths: Mapping[str, int]) -> float:
    """Median time of one velocity at one state [ms]; `widths` as of :func:`input_widths`."""
    inputs = [np.zeros((1, width), dtype=np.float32) for width in widths.values()]
    for _ in range(WARM_UP_QUERIES):
        policy(*inputs)
    times = []
    for _ in range(TIMED_QUERIES):
        begun = time.perf_counter()
        policy(*inputs)
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
