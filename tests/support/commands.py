"""The real command line for tests: in this process, where it is quick, or as a process of its own with its workers."""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from gsl.cli import call

ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith(("GSL_", "COMP_"))}
SMALL = ("preset=toy", "task.duration=1.6", "workers=1")


class Said(NamedTuple):
    """How a command ended: exit code, stdout, stderr."""

    code: int
    out: str
    err: str

    @property
    def lines(self) -> list[str]:
        return self.err.splitlines()


PROGRESS = re.compile(r"(?:^|: )\d+ % done[,;]|, \d+ (?:s|min)(?:, compiling.*)?$")


def gsl(*arguments: str, folder: Path) -> Said:
    """Run a command line in this process, in `folder`; what it says of its progress depends on the computer."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = call(list(arguments))
    lines = [line for line in err.getvalue().splitlines(keepends=True) if not PROGRESS.search(line)]
    return Said(code, out.getvalue(), "".join(lines))


def done(*arguments: str, folder: Path) -> Said:
    """Run a command line that has to succeed."""
    said = gsl(*arguments, folder=folder)
    assert said.code == 0, f"{arguments}: {said.err}"
    return said


def refused(*arguments: str, folder: Path, code: int = 2) -> str:
    """Run a command that cannot work, into runs/refused, and return the one line it says in the end."""
    before = _files(folder)
    said = gsl(*arguments, folder=folder)
    assert (said.code, said.out) == (code, ""), said
    assert said.lines[-1].startswith(f"gsl {arguments[0]}: ")
    assert [line for line in said.lines[:-1] if not line.startswith(("checking ", "fitting "))] == []
    assert _files(folder) == before
    return said.lines[-1].removeprefix(f"gsl {arguments[0]}: ")


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def forget_modules(folder: Path) -> None:
    """Have a process that imported modules of a folder be as one that did not."""
    for name, module in [*sys.modules.items()]:
        if (file := getattr(module, "__file__", None)) and Path(file).is_relative_to(folder):
            del sys.modules[name]


@contextlib.contextmanager
def ending(process: subprocess.Popen[str]) -> Iterator[None]:
    """End a process that leads a session, and its workers, with the block."""
    try:
        yield
    finally:
        for number in session(process.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, 9)
        process.communicate()


@contextlib.contextmanager
def started(*arguments: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Start a command line as a process that leads a session of its own; its workers end with the block."""
    process = subprocess.Popen(
        [sys.executable, "-m", "gsl", *arguments], cwd=folder, env=ENVIRONMENT, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    with ending(process):
        yield process


def session(leader: int) -> list[int]:
    """Return the processes of a session that are still running, zombies left out."""
    processes = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, *_, owner = path.read_text().rpartition(")")[2].split()[:4]
            if int(owner) == leader and state != "Z":
                processes.append(int(path.parent.name))
    return processes


def eventually(condition: Callable[[], object], *, seconds: float = 60.0) -> bool:
    """Wait until a condition holds and tell whether it does."""
    deadline = time.monotonic() + seconds
    while not (holds := bool(condition())) and time.monotonic() < deadline:
        time.sleep(0.05)
    return holds
