"""The rooms of the house: imports run one way, files stay small."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1] / "gsl"
COMPONENTS = ("robots", "worlds", "tasks", "policies", "models", "grounding", "optimizers")
PARTS = ("core", "effects", *COMPONENTS, "diagnosis", "training", "runner", "storage", "report")
MAY_IMPORT = {
    "core": (),
    "effects": ("core",),
    **{room: ("core", "effects", *COMPONENTS) for room in COMPONENTS},
    "diagnosis": ("core", "effects", *COMPONENTS),
    "training": ("core", "effects", *COMPONENTS, "diagnosis"),
    "runner": ("core", "grounding"),
    "storage": ("core", "effects", *COMPONENTS, "runner"),
    "report": ("core", "effects", *COMPONENTS),
    "blind": ("core", "effects", *COMPONENTS, "diagnosis", "storage", "report"),
    "stages": (*PARTS, "blind"),
    "studies": (*PARTS, "stages"),
}
ANYWHERE = ("errors", "console")
COMPOSING = ("composer", "config_errors", "known_settings", "multirun")
ONLY = {
    "hydra": ("config.py", *(f"commandline/{name}.py" for name in COMPOSING)),
    "pybullet": ("worlds/engine.py", "worlds/camera.py"),
    "torch": ("models/fitting.py", "models/multi_step.py", "optimizers/trpo.py"),
    "sb3_contrib": ("optimizers/trpo.py",),
    "stable_baselines3": ("optimizers/trpo.py",),
    "mujoco": ("worlds/mujoco.py",),
    "cma": ("optimizers/cma_es.py",),
}


def imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module


def files(room: str) -> list[Path]:
    return sorted((HOUSE / room).rglob("*.py"))


@pytest.mark.parametrize("room", MAY_IMPORT)
def test_imports_run_one_way(room: str) -> None:
    for path in files(room):
        rooms = {name.split(".")[1] for name in imported(path) if name.startswith("gsl.")}
        assert rooms <= {room, *MAY_IMPORT[room], *ANYWHERE}, f"{path.relative_to(HOUSE)} imports {sorted(rooms)}"


@pytest.mark.parametrize("library", ONLY)
def test_a_heavy_library_has_its_own_files(library: str) -> None:
    users = {
        str(path.relative_to(HOUSE))
        for path in files(".")
        if any(name.split(".")[0] == library for name in imported(path))
    }
    assert users <= set(ONLY[library])


def test_only_the_console_prints() -> None:
    for path in files("."):
        calls = (node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call))
        printing = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "print"]
        assert not printing or path.name == "console.py", path


def test_no_file_has_two_ideas() -> None:
    long = {path.name: n for path in files(".") if (n := len(path.read_text(encoding="utf-8").splitlines())) > 300}
    assert long == {}
