"""Every command of README.md and docs/ works: the README's chain is run at toy size, all others are built but not run.

To build a command is to compose its configuration and make the stage of it, so that every key, path and value is there
and possible. Nothing is passed over: a command of a program that is not known here fails.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from commands import done, forget_modules
from pages import FENCE, GUIDES, ROOT, Command, commands

from gsl.commandline.composer import compose
from gsl.commandline.config import prepare, resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.commandline.own_effects import load_own_effects
from gsl.commandline.own_word import find_trust
from gsl.effects.effect import names, use_own
from gsl.errors import ConfigError

pytestmark = pytest.mark.slow

TYPED = [command for page in GUIDES for command in commands(page)]
ONCE = list({command.words: command for command in TYPED}.values())  # several pages have some of them
FLAGS = ("--json", "--multirun", "--check", "--help", "--cfg", "job")
GROUPS = ("reproduce", "blind")  # whose commands have two words
AT_ONCE = ("robot", "init")  # quick enough to be run as they are printed
LOOKING = {
    "runs": 4,
    "diff": 3,
    "metrics": 3,
    "view": 4,
    "clean": 3,
    "bench": 1,
    "show": 2,
    "verify": 2,
    "lineage": 2,
    "open": 2,
    "rerun": 2,
    "render": 4,
}  # without settings; words at most
# What a command finds whose artifact, or whose network, a page makes before it.
LACKING = (
    "there is no learned servo in this path or run",
    "is no file; name the network's file",
    "there is no such path",
)
# What the README's chain is made smaller by; this table says all that is run otherwise than it is printed.
FEW = {"command_latency", "servo_gain", "coulomb_friction"}  # effects that a toy diagnosis tries
TOY = ("preset=toy", "task.duration=1.6", "workers=1")
SHRUNK = {
    "collect": ("policy.motions=[steps_large,triangle_slow]", "policy.duration=1.5", "workers=1"),
    "diagnose": ("most=1", "duels=0", "nulls=0", "limits=false", f"without={sorted(set(names()) - FEW)}", "workers=1"),
    "train-servo": ("workers=1",),
    "optimize": (*TOY, "accept=true", "optimizer.generations=1", "optimizer.candidates=4", "rollouts=1"),
    "evaluate": (*TOY, "check=1"),
    "show": (),
}


def chain() -> list[Command]:
    """The README's commands of the run `mine`, in the order of the page."""
    return [
        command for command in TYPED if command.page == "README.md" and any("mine" in word for word in command.words)
    ]


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with all that the pages let a reader write, and what their commands name beside it."""
    folder = tmp_path_factory.mktemp("reader")
    for name in ("examples", "docs"):
        (folder / name).symlink_to(ROOT / name)
    for page in GUIDES:
        for _, language, block in FENCE.findall(page.read_text("utf-8")):
            if written := re.match(r"# ([\w/]+\.(?:py|yaml|toml))", block):
                path = folder / written[1]
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(block)
            elif page.stem == "own-logs" and language in ("csv", "yaml"):
                (folder / f"arm.{language}").exists() or (folder / f"arm.{language}").write_text(block)
    (folder / "runs/t/diagnose/world").mkdir(parents=True)
    shutil.copy(ROOT / "conf/world/nao_worn.yaml", folder / "runs/t/diagnose/world/diagnosed.yaml")
    install(folder)
    with contextlib.chdir(folder):
        sys.path.insert(0, str(folder))
        yield folder
        sys.path.remove(str(folder))
        forget_modules(folder)
        use_own({})


def install(folder: Path) -> None:
    """Leave the traces that pip leaves of the package whose pyproject.toml a page prints."""
    project = tomllib.loads((folder / "pyproject.toml").read_text("utf-8"))["project"]
    place = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    place.mkdir()
    (place / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    for group, entries in project["entry-points"].items():
        lines = "\n".join(f"{name} = {value}" for name, value in entries.items())
        (place / "entry_points.txt").write_text(f"[{group}]\n{lines}\n")


@pytest.mark.parametrize("command", ONCE, ids=lambda command: f"{command.page}: {command.line}"[:100])
def test_a_command_of_a_page_can_be_typed(command: Command, home: Path) -> None:
    program, *words = command.words
    CHECKS[program](words, home)


def built(words: list[str], home: Path) -> None:
    """Make the stage of a gsl command."""
    if words[0] in AT_ONCE or words[0].startswith("--"):
        started(words, home)
        return
    if words[0] in LOOKING or words[1:] == ["--help"]:
        assert words[0] not in LOOKING or len(words) <= LOOKING[words[0]]
        started([words[0], "--help"], home)
        return
    count = 2 if words[0] in GROUPS else 1
    name, rest = " ".join(words[:count]), words[count:]
    place = rest.index("--config-dir") if "--config-dir" in rest else None
    own = None if place is None else home / rest[place + 1]
    taken = [word for k, word in enumerate(rest) if word not in FLAGS and (place is None or k - place not in (0, 1))]
    assert all("=" in word or word.startswith("~") for word in taken), taken
    with open_hydra(own):
        load_own_effects(own, find_trust(taken))
        composition = compose(name, taken, multirun="--multirun" in rest)
        try:
            prepare(resolve(composition), composition.trust)
        except ConfigError as error:
            assert any(reason in str(error) for reason in LACKING)


def started(words: list[str], home: Path) -> None:
    """Run what takes no time; completion is not installed."""
    if words == ["--install-completion"]:
        assert words[0] in done("--help", folder=home).out
        return
    place = home / f"{words[0]}_{words[-1].rpartition('/')[2]}"
    place.mkdir(exist_ok=True)
    (place / "examples").exists() or (place / "examples").symlink_to(ROOT / "examples")
    done(*words, folder=place)


def made(words: list[str], home: Path) -> None:
    """Let make say what it would do."""
    said = subprocess.run(["make", "-n", *words], cwd=ROOT, capture_output=True, text=True)
    assert said.returncode == 0, said.stderr


def installable(words: list[str], home: Path) -> None:
    """The extras that pip is to install are gsl's."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    assert words[:2] == ["install", "-e"]
    assert set(re.findall(r"\w+", words[2])) <= extras.keys()


def runnable(words: list[str], home: Path) -> None:
    """The runner of a request has these options; a script of examples is there, and its own test runs it."""
    if words[0].startswith("examples/"):
        assert (ROOT / words[0]).is_file()
        return
    source = (ROOT / "gsl/runner/main.py").read_text("utf-8")
    assert words[0] == "runner.py"
    assert all(f'"{word}"' in source for word in words[1:] if word.startswith("--"))


def activated(words: list[str], home: Path) -> None:
    """The environment is the one that make sets up."""
    assert words == [".venv/bin/activate"] and "VENV ?= .venv\n" in (ROOT / "Makefile").read_text("utf-8")


CHECKS: dict[str, Callable[[list[str], Path], None]] = {
    "gsl": built,
    "make": made,
    "pip": installable,
    "python": runnable,
    "source": activated,
    "jq": lambda words, home: None,  # not ours; what it reads is the command before it
}


def test_the_chain_of_the_readme_runs(tmp_path: Path) -> None:
    assert [command.words[1] for command in chain()] == list(SHRUNK)
    for command in chain():
        _, name, *words = command.words
        said = done(name, *words, *SHRUNK[name], folder=tmp_path)
    assert "returned" in said.out or "gain" in said.out
