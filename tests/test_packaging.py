"""What is installed: every package, every configuration file, working commands."""

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
SETTINGS = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
SOURCES = {"geomotion": REPOSITORY / "pipeline/geomotion", "geomotion_cli": REPOSITORY / "cli/geomotion_cli"}


def python_folders() -> set[str]:
    """Dotted names of all folders with Python files in them."""
    return {
        ".".join([name, *path.parent.relative_to(root).parts])
        for name, root in SOURCES.items()
        for path in root.rglob("*.py")
    }


def test_the_package_list_is_complete():
    assert set(SETTINGS["tool"]["setuptools"]["packages"]) == python_folders() | {"geomotion.conf"}


def test_every_package_says_what_it_is():
    for name, root in SOURCES.items():
        for folder in {path.parent for path in root.rglob("*.py")}:
            assert (folder / "__init__.py").is_file(), f"{folder.relative_to(root.parent)} in {name}"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """A wheel built from a copy, so that leftovers of earlier builds cannot get into it."""
    copy, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for folder in ("cli", "conf", "pipeline"):
        shutil.copytree(REPOSITORY / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(REPOSITORY / file, copy)
    build = "import sys; from setuptools import build_meta; build_meta.build_wheel(sys.argv[1])"
    subprocess.run([sys.executable, "-c", build, str(target)], cwd=copy, check=True, capture_output=True)
    return next(target.glob("*.whl"))


def test_the_wheel_holds_every_module_and_configuration_file(wheel):
    expected = {f"geomotion/conf/{path.relative_to(REPOSITORY / 'conf')}" for path in REPOSITORY.glob("conf/**/*.yaml")}
    for name, root in SOURCES.items():
        expected |= {f"{name}/{path.relative_to(root)}" for path in root.rglob("*.py")}
        expected.add(f"{name}/py.typed")
    with zipfile.ZipFile(wheel) as archive:
        assert expected <= set(archive.namelist())


def test_the_wheel_composes_its_configuration_without_the_repository(wheel, tmp_path):
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "installed")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "installed")}

    def python(*arguments: str) -> str:
        command = [sys.executable, *arguments]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True).stdout

    assert "spread_weight" in python("-m", "geomotion_cli", "ncds", "train", "--cfg", "job", "experiment=thesis/ncds")
    places = python(
        "-c", "import geomotion_cli, geomotion.conf; print(geomotion_cli.__file__, geomotion.conf.__file__)"
    )
    assert places.count(str(tmp_path / "installed")) == 2


def test_both_commands_are_declared():
    assert SETTINGS["project"]["scripts"] == {
        "gms": "geomotion_cli.dispatch:gms",
        "ncds": "geomotion_cli.dispatch:ncds",
    }


def test_constraints_name_versions_and_no_places():
    for line in (REPOSITORY / "constraints.txt").read_text(encoding="utf-8").split():
        name, pinned, version = line.partition("==")
        assert name and pinned and version
        assert "+" not in version and "/" not in line  # one file for CPU and CUDA builds
