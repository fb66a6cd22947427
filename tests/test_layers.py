"""The direction of imports: mathematics knows nothing of networks, networks nothing of stages."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
LIBRARY = REPOSITORY / "pipeline/geomotion"

LAYERS = (  # each may import those above it in this list, and itself
    {"errors", "types"},
    {"files", "interrupts", "tables", "xml_files"},
    {"lie"},
    {"manifolds"},
    {"dynamics"},
    {"obstacles"},
    {"scores"},
    {"planning"},
    {"config"},
    {"robot", "obstacles_files"},
    {"networks", "arms"},
    {"baselines", "demos"},
    {"training"},
    {"baseline_models"},
    {"models", "manifold_models", "policy_model"},
    {"learned_manifold", "conditional_models", "skill_surface"},
    {"pictured_skills"},
    {"policy"},
    {"export", "safe_skills"},
    {"figures"},
    {"tracking"},
    {"stages"},
)
DEPTH = {name: depth for depth, names in enumerate(LAYERS) for name in names}
MATHEMATICS = ("lie", "manifolds", "dynamics", "obstacles", "scores", "planning")
MATHEMATICS_LIBRARIES = {"jaxtyping", "numpy", "roma", "scipy", "shapely", "torch", "torchdiffeq"}
FRAMEWORKS = {"hydra", "mlflow", "omegaconf"}
FRAMEWORK_USERS = {"config", "tracking", "stages", "policy_model"}  # the last is run by MLflow, outside of us
CONFIG_READERS = {
    "arms",
    "baseline_models",
    "demos",
    "models",
    "manifold_models",
    "learned_manifold",
    "safe_skills",
    "training",
    "tracking",
    "stages",
}  # those built from settings; never mathematics


def imports(path: Path) -> Iterator[str]:
    """Dotted names that a file imports, also inside functions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively; write the full name"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def own_part(name: str) -> str | None:
    """`dynamics` of `geomotion.dynamics.fields`; nothing for other libraries and for `geomotion.__version__`."""
    first, _, rest = name.partition(".")
    part = rest.split(".")[0]
    return part if first == "geomotion" and not part.startswith("__") else None


def other_libraries(path: Path) -> set[str]:
    roots = {name.split(".")[0] for name in imports(path)}
    return roots - set(sys.stdlib_module_names) - {"geomotion", "geomotion_cli"}


def part_of(path: Path) -> str:
    return path.relative_to(LIBRARY).parts[0].removesuffix(".py")


MODULES = [path for path in sorted(LIBRARY.rglob("*.py")) if part_of(path) != "__init__"]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(LIBRARY)))
def test_imports_point_one_way(path):
    mine = part_of(path)
    assert mine in DEPTH, f"{mine} has no place in LAYERS yet"
    for part in filter(None, map(own_part, imports(path))):
        assert part == mine or DEPTH[part] < DEPTH[mine], f"{path.name} ({mine}) imports {part}"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(LIBRARY)))
def test_frameworks_stay_where_they_belong(path):
    mine, libraries = part_of(path), other_libraries(path)
    if mine not in FRAMEWORK_USERS:
        assert not libraries & FRAMEWORKS
    if mine in MATHEMATICS:
        assert libraries <= MATHEMATICS_LIBRARIES
    if mine not in CONFIG_READERS:
        assert "config" not in set(map(own_part, imports(path)))


def test_the_command_line_knows_configuration_errors_and_one_pipeline_function():
    for path in sorted((REPOSITORY / "cli").rglob("*.py")):
        used = {name for name in imports(path) if own_part(name)}
        assert {own_part(name) for name in used} <= {"config", "errors", "stages"}
        assert all(name.startswith("geomotion.stages.commands.") for name in used if own_part(name) == "stages")
        assert other_libraries(path) <= {"hydra", "omegaconf"}


def test_the_configuration_imports_nothing_heavy():
    assert other_libraries(LIBRARY / "config.py") == {"hydra", "omegaconf"}
