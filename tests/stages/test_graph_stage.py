"""The decoded grid as a stage: what is written is what planning reads, and what does not fit is refused first."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from geomotion import config as schema
from geomotion.demos import readers, storage
from geomotion.demos.demonstrations import Demonstrations
from geomotion.errors import TooLargeForMemory
from geomotion.manifolds.grid import LatentGrid
from geomotion.manifolds.grid_metric import metric_on_grid
from geomotion.manifolds.metric import PullbackMetric
from geomotion.stages.graph import (
    LEAST_CAP_RAD,
    LEAST_CAP_SHARE,
    GraphStageConfig,
    graph,
    load_skilled,
    memory_limit_bytes,
)  # fmt: skip
from geomotion.stages.train_manifold import TrainManifoldConfig, train_manifold
from geomotion.tracking import Artefacts, StageRun

JC = schema.JCDataset(name="generated/jc", demos=4, points=40)
MANIFOLD = schema.ManifoldConfig(kernels=15, hidden_units=[16, 8], points=20)
TRAINING = schema.ManifoldTraining(steps=60, spread_steps=20, restarts=0)
METRIC = schema.MetricConfig()
GRAPH = schema.GraphConfig(points_per_axis=15)


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    """Train on demonstrations, decode the grid, and answer with the artefacts of all three stages."""

    def build(demonstrations: Demonstrations, latent_dim: int = 2, config: schema.GraphConfig = GRAPH):
        root = tmp_path_factory.mktemp("graph")
        storage.save(demonstrations, root / "ingest")
        inputs = {"ingest": Artefacts("ingest", "0", root / "ingest", "")}
        manifold = replace(MANIFOLD, latent_dim=latent_dim)
        training = TrainManifoldConfig(
            schema.DatasetConfig("generated/jc"), manifold, TRAINING, 0, None, schema.PandaArm()
        )
        for name, stage, settings in (
            ("train", train_manifold, training),
            ("graph", graph, GraphStageConfig(config, METRIC)),
        ):
            run = StageRun(root / name, root / "checkpoint", client=None, run_id="1")
            run.folder.mkdir()
            run.log_series = lambda step, values: None
            stage(settings, inputs, run)
            inputs[name] = Artefacts(name, "0", root / name, "")
        return inputs

    return build


@pytest.fixture(scope="module")
def inputs(build):
    return build(readers.read(JC))


def document(inputs):
    return json.loads(inputs["graph"].path("graph.json").read_text())


def test_planning_reads_the_surface_that_was_written(inputs):
    skilled = load_skilled(inputs, METRIC)
    assert len(skilled.surface.grid.nodes) == document(inputs)["nodes"] == 15**2
    again = skilled.manifold.decode(skilled.surface.grid.nodes)
    np.testing.assert_allclose(again.states.position_m, skilled.surface.decoded.states.position_m, atol=1e-12)
    assert [one.shape for one in skilled.maps] == [(15, 15)] * 2
    assert skilled.surface.grid.contains(skilled.manifold.all_codes).all()


def test_three_dimensions_have_an_interactive_picture_too(build):
    inputs = build(readers.read(JC), 3, schema.GraphConfig(points_per_axis=10))
    assert document(inputs)["nodes"] == 10**3
    skilled = load_skilled(inputs, METRIC)
    assert [one.shape for one in skilled.maps] == [(10, 10, 10)] * 2
    assert (inputs["graph"].path("figures/latent.png")).stat().st_size > 0
    assert "plotly" in inputs["graph"].path("latent.html").read_text()[:100_000].lower()


def test_differences_come_to_the_exact_metric_of_a_trained_network_where_cells_are_small(inputs):
    manifold = load_skilled(inputs, METRIC).manifold
    middle = manifold.codes[0][10].numpy()
    near = LatentGrid(middle - 0.005, middle + 0.005, 9)
    found = metric_on_grid(near, *manifold.embed(near.nodes))
    exact = PullbackMetric(manifold)(torch.from_numpy(near.nodes)).numpy()
    np.testing.assert_allclose(found, exact, atol=0.01 * np.abs(exact).max())


def test_crossing_starts_above_every_demonstration(inputs):
    assert document(inputs)["crossing_length"] > max(document(inputs)["demonstration_lengths"])


@pytest.mark.parametrize("count", [1, 2])
def test_demonstrations_that_are_alike_still_leave_room(build, count):
    demonstrations = readers.read(JC)
    found = document(build(replace(demonstrations, trajectories=demonstrations.trajectories[:1] * count)))
    size_m = np.linalg.norm(np.ptp(demonstrations[0].channels["position_m"], axis=0))
    assert found["cap_rad"] == pytest.approx(LEAST_CAP_RAD)
    assert LEAST_CAP_SHARE * size_m / 4 < found["cap_m"] < size_m / 4


def test_what_does_not_fit_is_refused_with_what_would(build):
    with pytest.raises(TooLargeForMemory, match=r"20000\^2 nodes would need about 355 GiB.*=1062 fits"):
        build(readers.read(JC), config=schema.GraphConfig(points_per_axis=20000, memory_limit_gib=1.0))
    assert memory_limit_bytes(schema.GraphConfig(memory_limit_gib=0.5)) == 2**29
