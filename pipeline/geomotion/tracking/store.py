"""Opening the MLflow store: SQLite in write-ahead mode below ``runs/``, or any other MLflow URI."""

import logging
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from filelock import FileLock, Timeout

from geomotion.config import TrackingConfig
from geomotion.errors import DiskFull, StoreUnavailable, is_disk_full
from geomotion.interrupts import held_signals

if TYPE_CHECKING:
    from mlflow import MlflowClient

LOCK_TIMEOUT_S = 120.0
BUSY_TIMEOUT_S = 60.0


def store_uri(config: TrackingConfig) -> str:
    """The MLflow URI of a configuration."""
    return config.uri or f"sqlite:///{database(config)}"


def database(config: TrackingConfig) -> Path:
    """Where the local store's database is or would be."""
    return Path(config.root).resolve() / "mlflow.db"


def exists(config: TrackingConfig) -> bool:
    """Whether there is a store to look runs up in."""
    return config.uri is not None or database(config).is_file()


@contextmanager
def database_errors(uri: str) -> Iterator[None]:
    """Turn what MLflow and SQLAlchemy raise, and a full disk, into one clear error."""
    try:
        yield
    except OSError as error:
        if is_disk_full(error):
            raise DiskFull(error.filename or uri) from error
        raise
    except Exception as error:
        from mlflow.exceptions import MlflowException
        from sqlalchemy.exc import SQLAlchemyError

        if not isinstance(error, MlflowException | SQLAlchemyError | sqlite3.Error):
            raise
        if "disk is full" in str(error):
            raise DiskFull(uri) from error
        raise StoreUnavailable(uri, _reason(error)) from error


@contextmanager
def store_errors(uri: str) -> Iterator[None]:
    """As :func:`database_errors`, for blocks in which the file system, too, is asked for the store only."""
    try:
        with database_errors(uri):
            yield
    except OSError as error:
        raise StoreUnavailable(uri, error.strerror or str(error)) from error


def _reason(error: Exception) -> str:
    text = str(error)
    for sign, reason in (
        ("database is locked", "the database is locked by another program"),
        ("not a database", "the file is not an SQLite database"),
        ("malformed", "the database is damaged"),
        ("disk I/O error", "the disk is full or fails"),
        ("readonly", "the database is read-only"),
        ("unable to open", "the database cannot be opened"),
        ("out-of-date database schema", "it was made by another MLflow version; run `mlflow db upgrade` on it"),
    ):
        if sign in text:
            return reason
    return text.strip().splitlines()[0] if text.strip() else type(error).__name__


def open_store(config: TrackingConfig) -> tuple["MlflowClient", str]:
    """The client and the experiment's id; creates what is missing.

    The first user of a fresh store creates it under a file lock: MLflow's own migrations race.

    Raises:
        StoreUnavailable: If the store cannot be opened, is locked for two minutes, or is no MLflow store.
        DiskFull: If there is no space for it.
    """
    _quiet()
    uri = store_uri(config)
    root = Path(config.root).resolve()
    import mlflow

    with store_errors(uri):
        root.mkdir(parents=True, exist_ok=True)
        try:
            with FileLock(root / ".store.lock", timeout=LOCK_TIMEOUT_S), held_signals():
                if config.uri is None:
                    _prepare(database(config))
                mlflow.set_tracking_uri(uri)
                client = cast("MlflowClient", _WholeCalls(mlflow.MlflowClient()))
                found = client.get_experiment_by_name(config.experiment)
                if found is not None:
                    return client, found.experiment_id
                location = (root / "artifacts").as_uri() if config.uri is None else None
                return client, client.create_experiment(config.experiment, artifact_location=location)
        except Timeout as error:
            raise StoreUnavailable(uri, f"another program has held {root / '.store.lock'} for two minutes") from error


def open_existing(config: TrackingConfig) -> tuple["MlflowClient", str]:
    """The client and the experiment's id of a store that this process does not write to.

    Raises:
        StoreUnavailable: If the store cannot be read, or has no such experiment.
    """
    _quiet()
    uri = store_uri(config)
    import mlflow

    with store_errors(uri):
        client = cast("MlflowClient", _WholeCalls(mlflow.MlflowClient(tracking_uri=uri)))
        found = client.get_experiment_by_name(config.experiment)
    if found is None:
        raise StoreUnavailable(uri, f"it has no experiment {config.experiment!r}")
    return client, found.experiment_id


class _WholeCalls:
    """A client whose calls end before a signal counts: SQLAlchemy logs a traceback for one that it unwinds."""

    def __init__(self, client: "MlflowClient") -> None:
        self._client = client

    def __getattr__(self, name: str) -> Any:
        call = getattr(self._client, name)

        def whole(*arguments: Any, **options: Any) -> Any:
            with held_signals():
                return call(*arguments, **options)

        return whole


def _prepare(path: Path) -> None:
    """Switch on write-ahead logging, which several writers need; it persists in the file."""
    with closing(sqlite3.connect(path, timeout=BUSY_TIMEOUT_S)) as connection:
        connection.execute("PRAGMA journal_mode=WAL")


def _quiet() -> None:
    os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "2")  # its own 7 take minutes where no server answers
    os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
    os.environ.setdefault("MLFLOW_SQLALCHEMYSTORE_POOLCLASS", "NullPool")
    for name in ("mlflow", "alembic"):
        logging.getLogger(name).setLevel(logging.WARNING)
    for name in ("mlflow.store.db.utils", "urllib3"):  # they log with a traceback what they raise, too
        logging.getLogger(name).setLevel(logging.CRITICAL)
