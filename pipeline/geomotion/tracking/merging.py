"""Finished stages of another results folder, such as one that a second machine filled."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from geomotion.config import TrackingConfig
from geomotion.errors import MissingData
from geomotion.tracking import store
from geomotion.tracking.artefacts import digest_of

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import Metric, Run


@dataclass(frozen=True)
class Finished:
    """A stage that another folder has.

    Attributes:
        run: Its MLflow run.
        folder: Its artefacts.
        curves: All that it logged.
    """

    run: "Run"
    folder: Path
    curves: list["Metric"]


class OtherResults:
    """A results folder to take finished stages from; it may have been moved since it was written.

    Args:
        root: The folder, as ``tracking.root`` named it when it was filled.
        experiment: Name of the MLflow experiment in it.

    Raises:
        MissingData: If there are no results in it.
        StoreUnavailable: If it cannot be read.
    """

    def __init__(self, root: str, experiment: str) -> None:
        config = TrackingConfig(root=root, experiment=experiment)
        if not store.exists(config):
            raise MissingData(f"results in {root}", "tracking.merge= names folders that runs were written to.")
        self.root, self.uri = Path(root).resolve(), store.store_uri(config)
        self.client: MlflowClient
        self.client, self.experiment_id = store.open_existing(config)

    def finished(self, key: str, key_tag: str, digest_tag: str) -> Finished | None:
        """The newest whole run of a computation; none if there is no such run.

        Args:
            key: Of the computation.
            key_tag: Tag that has it.
            digest_tag: Tag that has the digest of the artefacts.
        """
        condition = f"tags.`{key_tag}` = '{key}' AND status = 'FINISHED'"
        with store.store_errors(self.uri):
            for run in self.client.search_runs([self.experiment_id], condition, order_by=["start_time DESC"]):
                folder = self.root / "artifacts" / str(run.info.run_id) / "artifacts"
                digest = run.data.tags.get(digest_tag)
                if digest is not None and folder.is_dir() and digest_of(folder) == digest:
                    return Finished(run, folder, self._curves(run))
        return None

    def _curves(self, run: "Run") -> list["Metric"]:
        names = run.data.metrics
        return [point for name in names for point in self.client.get_metric_history(run.info.run_id, name)]
