"""The cache of compiled code: what is damaged there is compiled again, and a command says so."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gsl.core.compiled import find_sources

pytestmark = pytest.mark.slow

SOURCES = Path(__file__).parents[2] / "gsl"

DOUBLING = """
from gsl.core.compiled import compile_kernel

@compile_kernel
def double(x):
    return 2.0 * x

print(double(3.0), double.stats.cache_hits)
"""


def doubled(folder: Path) -> tuple[str, str]:
    (folder / "doubling.py").write_text(DOUBLING)
    os.utime(folder / "doubling.py", (0, 0))  # what numba recognises a source by
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, str(folder / "doubling.py")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.strip(), done.stderr


def test_a_damaged_cache_is_compiled_again_and_said(tmp_path: Path) -> None:
    assert doubled(tmp_path)[0].startswith("6.0 Counter()")
    files = [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert {path.suffix for path in files} == {".nbi", ".nbc"}
    for path, number in zip(files * 2, range(4), strict=True):
        whole = path.read_bytes()
        damaged = (b"", whole[:-1], whole[:40] + bytes([whole[40] ^ 1]) + whole[41:], os.urandom(len(whole)))
        path.write_bytes(damaged[number])
        said, warned = doubled(tmp_path)
        assert said == "6.0 Counter()"
        assert warned.endswith("compiled code is damaged there; it is compiled again\n")
        assert warned.count("\n") == 1
    said, warned = doubled(tmp_path)
    assert said.startswith("6.0 Counter({")
    assert warned == ""


def run_ramp(package: Path, **more: str) -> str:
    """Run a kernel of a copy of gsl; return how often the cache had it."""
    (package / "policies" / "gait.py").touch()
    kept = {key: value for key, value in os.environ.items() if key not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    code = "from gsl.policies.gait import ramp; ramp(0.3); print(ramp.stats.cache_hits)"
    environment = {**kept, "PYTHONPATH": str(package.parent), **more}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=environment, cwd=package, capture_output=True, text=True, check=True)
    return done.stdout


def test_copies_of_one_version_share_what_was_compiled(tmp_path: Path) -> None:
    first, other = (tmp_path / name / "gsl" for name in ("one", "other"))
    for copy in (first, other):
        shutil.copytree(SOURCES, copy, ignore=shutil.ignore_patterns("__pycache__"))
    kept = {"HOME": "/proc/none", "NUMBA_CACHE_DIR": str(tmp_path / "elsewhere")}
    assert run_ramp(first, **kept) == "Counter()\n" and any((tmp_path / "elsewhere").iterdir())
    assert run_ramp(first, HOME="/proc/none") == "Counter()\n"  # compiled beside the source: there is no other place
    assert run_ramp(first, XDG_CACHE_HOME=str(tmp_path)) == "Counter()\n"
    assert run_ramp(other, XDG_CACHE_HOME=str(tmp_path)) == "Counter({(float64,): 1})\n"


def test_the_sources_are_what_compiled_files_import_and_no_others(tmp_path: Path) -> None:
    package = tmp_path / "house"
    texts = {
        "kernel.py": "compile_kernel\nfrom house.numbers import (\n    SIZE,\n)\nfrom house import room\n",
        "numbers.py": "SIZE = 3\n",
        "room/__init__.py": "import house.deep.below\n",
        "deep/below.py": "from house.numbers import SIZE\n",
        "page.py": "from house.kernel import run\n",
    }
    for name, text in texts.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(text)
    there = [path.relative_to(package).as_posix() for path in find_sources(package)]
    assert there == ["deep/below.py", "kernel.py", "numbers.py", "room/__init__.py"]


def test_pages_and_imports_of_logs_are_no_sources_of_compiled_code() -> None:
    there = {path.relative_to(SOURCES).as_posix() for path in find_sources(SOURCES)}
    assert {"worlds/servo.py", "core/servo_law.py", "worlds/bullet_c.py", "core/servo.py"} <= there
    assert not {name for name in there if name.startswith(("report/", "storage/", "stages/", "commandline/"))}


def test_where_no_folder_can_be_written_it_is_compiled_every_time() -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": "/proc/none", "HOME": "/proc/none"}
    command = [sys.executable, "-c", DOUBLING]  # beside a source there would be one more place
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("6.0 Counter()")


def test_functions_of_inner_loops_call_none_that_may_allocate() -> None:
    """They count no references, so an array that a kernel made for them would never be freed."""
    decorated: dict[str, list[ast.FunctionDef]] = {"compile_inner": [], "compile_kernel": []}
    for path in SOURCES.rglob("*.py"):
        if "compile_" not in (text := path.read_text("utf-8")):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef):
                for decorator in node.decorator_list:
                    decorated.get(ast.unparse(decorator), []).append(node)
    kernels = {function.name for function in decorated["compile_kernel"]}
    assert kernels and decorated["compile_inner"]
    for function in decorated["compile_inner"]:
        calls = [node.func for node in ast.walk(function) if isinstance(node, ast.Call)]
        assert not {call.id for call in calls if isinstance(call, ast.Name)} & kernels, function.name
