"""The comparisons of Sec. 6.4.1 compose: every cell is a valid run, and references stand beside what is run."""

from dataclasses import replace

import pytest
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from geomotion import config as schema
from geomotion.stages.ncds_verbs import NCDS
from geomotion.stages.study_cells import compose_cells


@pytest.fixture
def configurations():
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        yield


@pytest.mark.parametrize("name", ["table_6_2", "fig_6_6", "fig_6_8", "fig_6_9"])
def test_every_cell_is_a_valid_run(configurations, name):
    study = OmegaConf.to_object(compose("ncds", overrides=[f"experiment=thesis/{name}"])).study
    cells = compose_cells(
        "ncds", replace(study, seeds=[0], datasets=study.datasets[-1:]), [f"experiment=thesis/{name}"]
    )
    assert [one.cell.variant for one in cells] == [variant.label for variant in study.variants]
    fields = [type(one.config.field) for one in cells]
    assert schema.LinearField in fields and schema.ElcdField in fields
    assert set(study.figures) <= set(NCDS.study_figures)
    for row in study.reference.rows if study.reference else []:
        assert row.variant in {variant.label for variant in study.variants}
        assert row.dataset in study.datasets


def test_the_joint_recordings_of_the_table_have_one_goal(configurations):
    dataset = OmegaConf.to_object(compose("ncds", overrides=["dataset=robotasks9_joint/pouring_one_elbow"])).dataset
    assert isinstance(dataset, schema.RoboTasks9JointDataset)
    assert (dataset.elbow.solutions, dataset.held_out) == (1, 2)


def test_starts_beside_the_manifold_are_those_of_a_decoder_and_of_an_embedded_skill(configurations):
    overrides = ["experiment=thesis/fig_6_10"]
    study = OmegaConf.to_object(compose("ncds", overrides=overrides)).study
    thesis, ours = (one.config for one in compose_cells("ncds", replace(study, seeds=[0]), overrides))
    assert isinstance(thesis.chart, schema.InjectiveVaeChart) and isinstance(thesis.field, schema.LineIntegralField)
    assert thesis.chart.latent_dim == ours.field.skill_dim == 2
    assert set(study.figures) <= set(NCDS.study_figures)
