"""The only door to MLflow: stores, runs of commands and stages, reuse, resumption and lineage."""

from geomotion.tracking.artefacts import Artefacts
from geomotion.tracking.stage import Stage, StageRun
from geomotion.tracking.tracker import Tracker

__all__ = ["Artefacts", "Stage", "StageRun", "Tracker"]
