"""The tree of errors a user can cause; each says what is wrong, where, and what to do.

GslError                    exit code 1: a stage failed
├── Refused                 a grounding fails its check
└── InputError              exit code 2: usage, configuration, files
    ├── ConfigError         a setting does not exist or has an impossible value
    ├── ArtifactError       an artifact is missing, foreign, incomplete or of another version
    └── TrajectoryError     a trajectory file breaks the contract

Waiting is no error: it ends a command that goes on another day.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

SHOWN = 60
"""Letters of a name in a message; what a file calls its columns may be a hundred thousand letters long."""


def shorten(name: str) -> str:
    """Return a name as a message has room for it."""
    return name if len(name) <= SHOWN else f"{name[: SHOWN - 3]}..."


class GslError(Exception):
    """Something a user can understand and mend."""

    exit_code = 1

    def __reduce__(self) -> tuple[Any, ...]:
        """Let an error come back from a worker process, whatever its constructor takes."""
        return _again, (type(self), self.args, self.__dict__)


def _again(kind: type[GslError], args: tuple[Any, ...], state: dict[str, Any]) -> GslError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class Refused(GslError):
    """A grounding fails its check, so that nothing is optimised in it; `why` says the problems without advice."""

    def __init__(self, why: str, advice: str) -> None:
        super().__init__(f"this grounding is refused: {why}. {advice}, or go on with accept=true")
        self.why = why


class Waiting(GslError):
    """Nothing went wrong: a real robot has to act now, and the same command goes on from what it did."""

    exit_code = 0

    def __init__(self, message: str, request: Path, missing: list[str]) -> None:
        super().__init__(message)
        self.request, self.missing = request, missing


class InputError(GslError):
    """What the user gave does not fit."""

    exit_code = 2


class ConfigError(InputError):
    """A setting does not exist or has an impossible value."""

    def __init__(self, setting: str, problem: str, *, given: str = "") -> None:
        super().__init__(f"{setting} = {given}: {problem}" if given else f"{setting}: {problem}")
        self.setting, self.problem, self.given = setting, problem, given

    def under(self, path: str) -> ConfigError:
        """Return the same error, seen from a mapping that holds this one at the dotted `path`."""
        setting = ".".join(part for part in (path, self.setting) if part)
        return ConfigError(setting, self.problem, given=self.given)


class ArtifactError(InputError):
    """An artifact is missing, foreign, incomplete or of another version."""

    def __init__(self, path: Path | str, problem: str) -> None:
        super().__init__(f"{path}: {problem}")
        self.path = Path(path)


class TrajectoryError(InputError):
    """A trajectory file breaks the contract; rows are counted from 0, lines of a text file from 1."""

    def __init__(
        self,
        path: Path | str,
        problem: str,
        *,
        column: str | None = None,
        row: int | None = None,
        line: int | None = None,
    ) -> None:
        places = (("column", column and shorten(column)), ("row", row), ("line", line))
        where = "".join(f", {name} {place}" for name, place in places if place not in (None, ""))
        super().__init__(f"{path}{where}: {problem}")
        self.path, self.problem, self.column, self.row, self.line = Path(path), problem, column, row, line
