"""A robot.py whose robot is another process at the end of two pipes: what a rehearsal lets the runner play against."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

PIPES = "GSL_RUNNER_PIPES"
SIMULATED = True
TIME_LIMIT = 600.0  # of a call [s]: the surrogate may have to compile first


def _open_pipes() -> tuple[Any, Any]:
    numbers = os.environ.get(PIPES, "").split(",")
    if len(numbers) != 2:
        raise OSError("there is no surrogate to talk to; gsl rehearse starts this")
    return os.fdopen(int(numbers[0]), encoding="utf-8"), os.fdopen(int(numbers[1]), "w", encoding="utf-8")


def _call(**what: Any) -> Any:
    _OUT.write(json.dumps(what) + "\n")
    _OUT.flush()
    return json.loads(_IN.readline())


def read() -> dict[str, Any]:
    """Return what the surrogate measures."""
    reading: dict[str, Any] = _call(do="read")
    return reading


def send(targets: Any) -> None:
    """Hand desired joint positions over [rad], shape (n_joints,)."""
    _call(do="send", targets=targets.tolist())


def begin(episode: Mapping[str, Any]) -> None:
    """Say that an episode begins."""
    _call(do="begin", episode={key: value for key, value in episode.items() if key != "commands"})


def end() -> None:
    """Say that it is over."""
    _call(do="end")


if PIPES in os.environ:
    _IN, _OUT = _open_pipes()
