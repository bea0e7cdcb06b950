"""The chain of single commands as the Makefile puts it together; nothing is run."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ORDER = ("collect_real", "collect_sim", "train_forward", "train_inverse", "optimize", "evaluate")

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="needs make")


def shown(*arguments: str) -> list[str]:
    """Commands that `make` would run."""
    made = subprocess.run(["make", "-n", *arguments], cwd=ROOT, check=True, capture_output=True, text=True)
    lines = made.stdout.replace("\\\n", " ").splitlines()
    return [line for line in lines if "/gsl " in line]


def test_the_chain_is_the_six_stages_each_after_what_it_reads() -> None:
    lines = shown("iterate", "NAME=never-run")
    folders = [next(word for word in line.split() if word.startswith("out=")).rpartition("/")[2] for line in lines]
    assert sorted(folders) == sorted(ORDER)
    for before, after in (
        ("collect_real", "train_forward"),
        ("collect_sim", "train_inverse"),
        ("optimize", "evaluate"),
    ):
        assert folders.index(before) < folders.index(after)
    assert folders.index("train_forward") < folders.index("optimize") > folders.index("train_inverse")


def test_an_iteration_starts_from_the_one_before() -> None:
    lines = shown("iterate", "NAME=never-run", "ITERATIONS=2")
    assert len(lines) == 12
    later = [line for line in lines if "out=runs/never-run/iteration_02/" in line]
    started = [line for line in later if "initial=runs/never-run/iteration_01/evaluate" in line]
    assert len(started) == 3  # both collections and the search
    assert all("seed=1001" in line for line in later)


def test_arguments_go_where_they_belong() -> None:
    lines = shown("iterate", "NAME=never-run", "ARGS=force=true", "OPTIMIZE=rollouts=3")
    assert all("force=true" in line for line in lines)
    assert [line.split()[1] for line in lines if "rollouts=3" in line] == ["optimize"]


def test_help_names_every_target() -> None:
    made = subprocess.run(["make", "help"], cwd=ROOT, check=True, capture_output=True, text=True)
    for target in ("demo", "test", "iterate", "check", "clean", "help"):
        assert f"make {target} " in made.stdout


@pytest.mark.slow
def test_an_installation_writes_the_help_that_would_else_take_seconds(tmp_path: Path) -> None:
    made = subprocess.run(["make", "-n", "-B", "install"], cwd=ROOT, check=True, capture_output=True, text=True)
    program = next(words[2] for line in made.stdout.splitlines() if (words := shlex.split(line))[1:2] == ["-c"])
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    subprocess.run([sys.executable, "-c", program], cwd=ROOT, env=environment, check=True, stdout=subprocess.DEVNULL)
    look = "import sys; from gsl.cli import call; call(['iterate', '--help']); sys.exit('hydra' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", look], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert (done.returncode, "Settings (KEY=VALUE):" in done.stdout) == (0, True)
