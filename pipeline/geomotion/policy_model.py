"""The exported policy as an MLflow model; logged as code, so that loading needs onnxruntime and nothing of ours."""

import numpy as np
import onnxruntime
from mlflow.models import set_model
from mlflow.pyfunc.model import PythonModel


class Policy(PythonModel):
    """Measured states, with conditions and times where the policy takes any, to velocities and their status."""

    def load_context(self, context):  # type: ignore[no-untyped-def]
        """Open the ONNX file."""
        self.session = onnxruntime.InferenceSession(context.artifacts["policy"], providers=["CPUExecutionProvider"])

    # the hint is of MLflow's few that keep it from checking and from warning; it passes on arrays by name
    def predict(self, context, model_input: np.ndarray, params=None):  # type: ignore[no-untyped-def]
        """Outputs by name, from inputs by name: ``{"state_m": …, "condition": …, "elapsed_s": …}``, what it takes."""
        inputs = {name: np.asarray(values, dtype=np.float32) for name, values in dict(model_input).items()}
        names = [one.name for one in self.session.get_outputs()]
        return dict(zip(names, self.session.run(None, inputs), strict=True))


set_model(Policy())
