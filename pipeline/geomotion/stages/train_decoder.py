"""The decoder of a latent field, which is trained on states before the field on their codes."""

from collections.abc import Mapping

import pandas as pd

from geomotion import models
from geomotion.config import InjectiveVaeChart, VaeTraining
from geomotion.dynamics.injective import DecoderChart
from geomotion.files import atomic
from geomotion.tracking import StageRun
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.injective_vae import fit_decoder

SERIES = "vae"


def train_decoder(
    chart: InjectiveVaeChart, settings: VaeTraining, data: TrainingSet, geometry: Geometry, seed: int, run: StageRun
) -> DecoderChart:
    """Write ``vae_training.csv``; losses are logged as ``vae.…``.

    Args:
        chart: Architecture.
        settings: Weights and schedule.
        data: States.
        geometry: Their place and size.
        seed: Of parameters and optimisation.
        run: The training that this is a part of.

    Raises:
        InvalidSetting: If codes do not have fewer coordinates than states, or these belong to conditions.
        TrainingDiverged: If the training breaks down again and again.
        Interrupted: If a signal arrived.
    """

    def log(step: int, values: Mapping[str, float]) -> None:
        run.log_series(step, {f"{SERIES}.{name}": value for name, value in values.items()})

    decoder = models.build_decoder(chart, geometry, seed)
    checkpoint = run.checkpoint.with_name(f"{run.checkpoint.name}.{SERIES}")
    history = fit_decoder(decoder, data, geometry.scale_m, settings, seed, checkpoint, log)
    with atomic(run.folder / f"{SERIES}_training.csv") as temporary:
        pd.DataFrame(history.rows).to_csv(temporary, index=False)
    return decoder
