"""Presets `experiment=thesis/…` with less data and training, run up to the graph without a store."""

from dataclasses import dataclass
from pathlib import Path

from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from geomotion import config as schema
from geomotion.demos import readers, storage
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.preprocessing import preprocess
from geomotion.stages.graph import GraphStageConfig, Skilled, graph, load_skilled
from geomotion.stages.plan import Planned, PlanStageConfig, make_plans
from geomotion.stages.train_manifold import TrainManifoldConfig, train_manifold
from geomotion.tracking import Artefacts, StageRun


def configured(figure: str, *overrides: str) -> schema.GmsConfig:
    """The preset of a figure."""
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        return OmegaConf.to_object(compose("gms", overrides=[f"experiment=thesis/{figure}", *overrides]))


@dataclass(frozen=True)
class Trained:
    """A trained manifold with its decoded grid, and what it was trained on."""

    demonstrations: Demonstrations
    skilled: Skilled

    def planned(self, config: schema.GmsConfig) -> Planned:
        """The legs of a preset."""
        settings = PlanStageConfig(config.planning, config.metric, config.obstacle, config.robot.frame)
        return make_plans(settings, self.skilled, self.demonstrations)


def running(folder: Path) -> StageRun:
    """A stage that logs nothing."""
    folder.mkdir()
    run = StageRun(folder, folder / "checkpoint", client=None, run_id="0")
    run.log_series = lambda step, values: None
    return run


def trained(config: schema.GmsConfig, folder: Path) -> Trained:
    """Run the stages up to the graph, without a store."""
    demonstrations = preprocess(readers.read(config.dataset), config.dataset.preprocess)
    storage.save(demonstrations, folder / "ingest")
    done = {"ingest": Artefacts("ingest", "0", folder / "ingest", "")}
    fit = TrainManifoldConfig(config.dataset, config.manifold, config.training, config.seed, config.space, config.arm)
    train_manifold(fit, done, running(folder / "train"))
    done["train"] = Artefacts("train", "0", folder / "train", "")
    graph(GraphStageConfig(config.graph, config.metric), done, running(folder / "graph"))
    done["graph"] = Artefacts("graph", "0", folder / "graph", "")
    return Trained(demonstrations, load_skilled(done, config.metric))
