"""A policy as an ONNX file: one query per state, for control loops without our library or torch."""

import contextlib
import copy
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

from geomotion.dynamics.line_integral import LineIntegralField
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.files import write_bytes
from geomotion.policy.policy import Policy

Arrays = Mapping[str, NDArray[np.float32]]
WARM_UP_QUERIES, TIMED_QUERIES = 200, 1000
EXPORTED_NODES = 20  # of the quadrature that stands for a solver
ERRORS_ONLY = 3  # of onnxruntime, which otherwise remarks that inputs with a default are not constants


def export_onnx(policy: Policy, path: Path) -> None:
    """Write a policy in single precision, with the inputs and outputs that it names, for any number of states.

    Inputs with a default may be left out, and have one row for all states. A solver's loop, which cannot be exported,
    becomes a quadrature.
    """
    from onnx import numpy_helper

    recorded = _without_solver(policy).float().eval()
    # one row would fix the batch size
    examples = tuple(torch.zeros(2 if one.default is None else 1, one.width) for one in recorded.inputs)
    batch = torch.export.Dim("batch")
    shapes = tuple({0: batch} if one.default is None else {} for one in recorded.inputs)
    with _quiet(), torch.no_grad():
        recorded(*examples)  # what is computed once and kept, such as where the goal is, must not be recorded
        program = torch.onnx.export(
            recorded,
            examples,
            input_names=[one.name for one in recorded.inputs],
            output_names=[one.name for one in recorded.outputs],
            dynamic_shapes=(shapes,),
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    model = program.model_proto
    for one in recorded.inputs:
        if one.default is not None:
            model.graph.initializer.append(numpy_helper.from_array(np.array([one.default], np.float32), one.name))
    write_bytes(path, model.SerializeToString())


class OnnxPolicy:
    """An exported policy, one thread, ready for a control loop.

    Args:
        path: File that :func:`export_onnx` wrote.
    """

    def __init__(self, path: Path) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = ERRORS_ONLY
        self.session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        self._outputs = [one.name for one in self.session.get_outputs()]

    def __call__(self, inputs: Arrays) -> dict[str, NDArray[np.float32]]:
        """Outputs by name, from inputs by name."""
        return dict(zip(self._outputs, self.session.run(None, inputs), strict=True))


def query_time_ms(policy: OnnxPolicy, inputs: Arrays) -> float:
    """Median time of one query [ms], over a thousand."""
    for _ in range(WARM_UP_QUERIES):
        policy(inputs)
    times = []
    for _ in range(TIMED_QUERIES):
        begun = time.perf_counter()
        policy(inputs)
        times.append(time.perf_counter() - begun)
    return 1000 * statistics.median(times)


def _without_solver(policy: Policy) -> Policy:
    policy = copy.deepcopy(policy)
    for module in policy.modules():
        if isinstance(module, LineIntegralField) and not isinstance(module.integrator, GaussLegendre):
            module.integrator = GaussLegendre(EXPORTED_NODES)
    return policy


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
