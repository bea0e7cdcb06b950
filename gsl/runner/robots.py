"""The robot at the other end of the runner: a user's own file with `read` and `send`, or one that obeys perfectly."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.budget import TEXT_BYTES, check_file
from gsl.runner.guard import Guard
from gsl.runner.senses import RobotError


def robot_of(path: Path) -> Any:
    """Return a user's robot: a Python file with the functions `read` and `send`, and `begin` and `end` if it likes.

    Raises:
        RobotError: There is no such file, it cannot be loaded, or a function is missing.
    """
    if not path.is_file():
        raise RobotError(f"{path} does not exist; --robot names the file with read() and send(), --dry-run needs none")
    check_file(path, TEXT_BYTES)
    spec = importlib.util.spec_from_file_location("robot", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise RobotError(f"{path} cannot be loaded: {type(error).__name__}: {error}") from error
    for name in ("read", "send"):
        if not callable(getattr(module, name, None)):
            raise RobotError(f"{path} has no function {name}()")
    return module


class PerfectRobot:
    """Is at every target at once, feels nothing, and remembers how far and how fast it was moved.

    Args:
        request: What is asked for.
    """

    def __init__(self, request: Mapping[str, Any]) -> None:
        self._sizes, self._period = request["observes"], request["control_period"]
        self._guard = Guard(request["joints"], request["limits"], self._period)
        n = len(self._guard.joints)
        self._position = self._before = np.array(request["episodes"][0]["posture"], dtype=float)
        self.lowest, self.highest, self.fastest = np.full(n, np.inf), np.full(n, -np.inf), np.zeros(n)

    def read(self) -> dict[str, Any]:
        """Return what a robot that obeys perfectly and feels nothing would tell."""
        velocity = (self._position - self._before) / self._period
        still = {name: np.zeros(size) for name, size in self._sizes.items()}
        if "base.orientation" in still:
            still["base.orientation"][-1] = 1.0
        return {**still, "position": self._position, "velocity": velocity}

    def send(self, targets: np.ndarray) -> None:
        """Go there."""
        self._before, self._position = self._position, targets
        self.lowest, self.highest = np.minimum(self.lowest, targets), np.maximum(self.highest, targets)
        self.fastest = np.maximum(self.fastest, np.abs(targets - self._before) / self._period)

    def rows(self) -> list[str]:
        """Return lines of a table: where each joint was sent, how fast, and what is allowed."""
        bounds = zip(self._guard.lower, self._guard.upper, strict=True)
        lines = ["joint               from      to  allowed [rad]      fastest  allowed [rad/s]"]
        for index, (joint, (lower, upper)) in enumerate(zip(self._guard.joints, bounds, strict=True)):
            way = f"{self.lowest[index]:8.3f}{self.highest[index]:8.3f}  {lower:.3f} to {upper:.3f}"
            lines.append(
                f"{joint:16s}{way:36s}{self.fastest[index]:8.2f}  {self._guard.step[index] / self._period:.2f}"
            )
        return lines
