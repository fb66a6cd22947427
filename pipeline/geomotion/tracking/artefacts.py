"""What a finished stage leaves behind, and the digests and keys by which it is found again."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import geomotion
from geomotion.config import plain
from geomotion.errors import CorruptArtefact, MissingArtefact

NOT_DIGESTED = ("figures", "config.json", "environment.json")
PACKAGES = (
    "geomotion",
    "torch",
    "torchdiffeq",
    "numpy",
    "scipy",
    "pandas",
    "hydra-core",
    "mlflow",
    "shapely",
    "onnxruntime",
)


@dataclass(frozen=True)
class Artefacts:
    """Outputs of a finished stage.

    Attributes:
        stage: Name of the stage.
        run_id: MLflow run that holds them.
        folder: Local, readable copy.
        digest: SHA-256 over the files that later stages read.
        program: Command that runs the stage.
    """

    stage: str
    run_id: str
    folder: Path
    digest: str
    program: str = "ncds"

    def path(self, name: str) -> Path:
        """A file or folder of the stage.

        Raises:
            MissingArtefact: If the stage did not leave it.
        """
        path = self.folder / name
        if not path.exists():
            raise MissingArtefact(self.stage, name, self.run_id, self.program)
        return path

    def verify(self) -> None:
        """Compare the files with the digest taken when they were written.

        Raises:
            CorruptArtefact: If they differ.
        """
        if digest_of(self.folder) != self.digest:
            raise CorruptArtefact(self.folder, f"its files are not those that stage {self.stage!r} wrote")


def digest_of(folder: Path) -> str:
    """SHA-256 over names and contents of the files of a stage; pictures and records of the run are left out."""
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        name = path.relative_to(folder)
        if name.parts[0] not in NOT_DIGESTED:
            digest.update(name.as_posix().encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def run_key(stage: str, config: object, inputs: Mapping[str, Artefacts]) -> str:
    """Name of a computation: the same stage, configuration, inputs and code give the same key."""
    recipe = {
        "stage": stage,
        "config": plain(config),
        "inputs": {name: artefacts.digest for name, artefacts in inputs.items()},
        "code": code_version(),
    }
    return hashlib.sha256(json.dumps(recipe, sort_keys=True).encode()).hexdigest()[:32]


@cache
def code_version() -> str:
    """Package version with a digest of its sources, so that edited code is not taken for the old one."""
    root = Path(geomotion.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return f"{geomotion.__version__}+{digest.hexdigest()[:12]}"


@cache
def environment() -> dict[str, str]:
    """Versions of the packages that results depend on."""
    found = {"code": code_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
