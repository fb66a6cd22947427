"""The exported field as an MLflow model; logged as code, so that loading needs onnxruntime and nothing of ours."""

import numpy as np
import onnxruntime
from mlflow.models import set_model
from mlflow.pyfunc.model import PythonModel


class Policy(PythonModel):
    """States (batch, D) [m] to velocities [m/s]."""

    def load_context(self, context):  # type: ignore[no-untyped-def]
        """Open the ONNX file."""
        self.session = onnxruntime.InferenceSession(context.artifacts["policy"], providers=["CPUExecutionProvider"])

    def predict(self, context, model_input: np.ndarray, params=None):  # type: ignore[no-untyped-def]
        """Velocities at states."""
        return self.session.run(None, {"state_m": np.asarray(model_input, dtype=np.float32)})[0]


set_model(Policy())
