"""The exported field as an MLflow model; logged as code, so that loading needs onnxruntime and nothing of ours."""

from collections.abc import Mapping

import numpy as np
import onnxruntime
from mlflow.models import set_model
from mlflow.pyfunc.model import PythonModel


class Policy(PythonModel):
    """States (batch, D) [m], with their conditions where the field has any, to velocities [m/s]."""

    def load_context(self, context):  # type: ignore[no-untyped-def]
        """Open the ONNX file."""
        self.session = onnxruntime.InferenceSession(context.artifacts["policy"], providers=["CPUExecutionProvider"])

    def predict(self, context, model_input: np.ndarray, params=None):  # type: ignore[no-untyped-def]
        """Velocities at states, or at ``{"state_m": …, "condition": …, "elapsed_s": …}``, whatever the field takes."""
        inputs = model_input if isinstance(model_input, Mapping) else {"state_m": model_input}
        return self.session.run(None, {name: np.asarray(values, dtype=np.float32) for name, values in inputs.items()})[
            0
        ]


set_model(Policy())
