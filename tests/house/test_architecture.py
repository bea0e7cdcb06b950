"""The rooms of the house: imports run one way, files stay small."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

PLOT = Path(__file__).parents[2]
HOUSE, TESTS = PLOT / "gsl", PLOT / "tests"
FLOORS = (  # from the ground up: a room imports from lower floors alone
    ("errors", "version"),
    ("core",),
    ("effects", "models", "tasks", "runner"),
    ("robots",),
    ("policies",),
    ("worlds", "storage", "optimizers"),
    ("grounding",),
    ("rollout", "report", "export"),
    ("diagnosis", "real_robot", "commandline"),
    ("training", "api", "cli"),
    ("validation", "gym", "testing", "__main__"),
    ("stages",),
)
BESIDE = ("experiments/gsl_experiments", "benchmarks/gsl_benchmarks")  # above all floors: each imports gsl and itself
COMPOSING = ("composer", "config_errors", "hydra_door", "multirun", "own_word", "yaml_files")
ONLY = {
    "hydra": tuple(f"commandline/{name}.py" for name in COMPOSING),
    "pybullet": ("worlds/engine.py", "worlds/camera.py"),
    "torch": (
        "models/fitting.py",
        "models/multi_step.py",
        "optimizers/trpo.py",
        "optimizers/sb3.py",
        "policies/torchscript.py",
        "storage/importers/tensor_arrays.py",
        "policies/sb3.py",
        "export/servo_network.py",
    ),
    "sb3_contrib": ("optimizers/trpo.py",),
    "stable_baselines3": ("optimizers/trpo.py", "optimizers/sb3.py"),
    "onnxruntime": ("policies/onnx.py",),
    "mujoco": ("worlds/mujoco.py",),
    "cma": ("optimizers/cma_es.py",),
}


@cache
def imported(path: Path) -> tuple[str, ...]:
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return tuple(name for node in nodes for name in imported_by(node))


def imported_by(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (name.name for name in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module:
        yield node.module


def files(place: str) -> list[Path]:
    """The files of a room, which is a folder or one file."""
    return sorted((HOUSE / place).rglob("*.py")) or [HOUSE / f"{place}.py"]


def every_file() -> list[Path]:
    """The files of gsl and of the packages beside it."""
    return [*files("."), *(path for place in BESIDE for path in sorted((PLOT / place).rglob("*.py")))]


def test_every_room_has_its_floor() -> None:
    rooms = {path.stem for path in HOUSE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert sorted(room for floor in FLOORS for room in floor) == sorted(rooms - {"__init__"})


def test_tests_stand_in_the_room_of_what_they_test() -> None:
    rooms = {room for floor in FLOORS for room in floor}
    folders = {path.parent.relative_to(TESTS).parts[0] for path in TESTS.rglob("test_*.py") if path.parent != TESTS}
    assert folders <= rooms | {"benchmarks", "docs", "experiments", "house"}
    assert not [*TESTS.glob("test_*.py"), *(TESTS / "support").rglob("test_*.py")]


@pytest.mark.parametrize(("number", "room"), [(n, room) for n, floor in enumerate(FLOORS) for room in floor])
def test_imports_run_down(number: int, room: str) -> None:
    below = {other for floor in FLOORS[:number] for other in floor}
    for path in files(room):
        names = [name for name in imported(path) if name.startswith("gsl")]
        assert not [name for name in names if not name.startswith("gsl.")], f"{path} knows what is beside gsl"
        rooms = {name.split(".")[1] for name in names}
        assert rooms <= {room} | below, f"{path.relative_to(HOUSE)} imports {sorted(rooms - {room} - below)}"


@pytest.mark.parametrize("place", BESIDE)
def test_a_package_beside_gsl_knows_no_other(place: str) -> None:
    own = place.rpartition("/")[2]
    for path in (PLOT / place).rglob("*.py"):
        packages = {name.split(".")[0] for name in imported(path) if name.startswith("gsl")}
        assert packages <= {"gsl", own}, path


@pytest.mark.parametrize("library", ONLY)
def test_a_heavy_library_has_its_own_files(library: str) -> None:
    users = {
        str(path.relative_to(HOUSE))
        for path in files(".")
        if any(name.split(".")[0] == library for name in imported(path))
    }
    assert users <= set(ONLY[library])


def test_only_the_console_prints() -> None:
    for path in every_file():
        calls = (node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call))
        printing = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "print"]
        assert not printing or path.name == "console.py", path


def test_no_file_has_two_ideas() -> None:
    long = {path.name: n for path in every_file() if (n := len(path.read_text(encoding="utf-8").splitlines())) > 300}
    assert long == {}


PATCHES = ("setattr", "delattr", "setitem", "delitem", "patch")
PUBLIC = {"_asdict", "_fields", "_make", "_replace", "_repr_html_"}  # of named tuples and of notebooks
OURS = ("gsl", "gsl_experiments", "gsl_benchmarks")


@pytest.mark.parametrize("path", sorted(TESTS.rglob("*.py")), ids=lambda path: path.stem)
def test_tests_use_no_private_names_and_replace_none_of_our_code(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    ours, used = set[str](), list[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in OURS:
            ours |= {name.asname or name.name for name in node.names}
            used += [name.name for name in node.names if name.name.startswith("_")]
        elif isinstance(node, ast.Import | ast.ImportFrom):
            used += [name for name in imported_by(node) if name.startswith("unittest.mock")]
        elif isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            mine = isinstance(node.value, ast.Name) and node.value.id == "self"
            used += [] if mine or node.attr in PUBLIC else [node.attr]
    assert used == []
    patches = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and last_name(node.func) in PATCHES]
    replaced = {first_name(node.args[0]) for node in patches if node.args}
    assert not {name for name in replaced if name in ours or name.split(".")[0] in OURS}


def last_name(node: ast.AST) -> str:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def first_name(node: ast.AST) -> str:
    while isinstance(node, ast.Attribute):
        node = node.value
    return node.id if isinstance(node, ast.Name) else str(getattr(node, "value", ""))
