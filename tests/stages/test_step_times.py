"""The thesis' way, as it is timed, is the thesis' way."""

import torch
from torch.testing import assert_close

from geomotion import config as schema
from geomotion import models
from geomotion.models import ModelConfig, Skill
from geomotion.stages.step_times import LATENT_DIM, STEP_S, THESIS_FIELD, step_of_decoder, step_of_field
from geomotion.training.data import Geometry

CENTRE = (0.1, 0.2, 0.3)
GEOMETRY = Geometry(CENTRE, 0.1, CENTRE, CENTRE, 2.0)
OURS = ModelConfig(schema.IdentityChart(), schema.LinearField(), schema.NoRegulariser(), 0)
SKILL = Skill(models.build(OURS, GEOMETRY).eval(), OURS, GEOMETRY, ("position_m",), (0,), ())


@torch.no_grad()
def test_a_step_is_as_long_as_the_velocity_of_the_model_says():
    x = torch.tensor([[0.12, 0.15, 0.33]])
    charts = {step_of_field: schema.IdentityChart(), step_of_decoder: schema.InjectiveVaeChart(latent_dim=LATENT_DIM)}
    for step, chart in charts.items():
        field = models.build(ModelConfig(chart, THESIS_FIELD, schema.ConstantRegulariser(), 0), GEOMETRY).eval()
        assert_close(step(SKILL)(x), x + STEP_S * field(x), rtol=1e-5, atol=1e-7)
