"""Errors in a user's own code, as one line that names the function and the place."""

from __future__ import annotations

import sys
import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import FrameType

from gsl.errors import GslError
from gsl.version import PACKAGE

OURS = "gsl"
PACKAGES = (OURS, "gsl_experiments", "gsl_benchmarks")  # what fails in these is our fault and no user's
FOLDERS = {Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib", "purelib", "platlib")}
"""Where Python and its packages lie: what fails there without a caller elsewhere is not a user's own."""


def is_own(kind: type) -> bool:
    """Whether a class is not gsl's but somebody's own."""
    return kind.__module__.partition(".")[0] not in (OURS, "builtins", "abc", "typing")


def package_of(kind: type) -> Path | None:
    """Return the folder of the package that a class comes from, or the file of a lone module; None if it is gsl's."""
    name = kind.__module__.partition(".")[0]
    file = getattr(sys.modules.get(name), "__file__", None) if is_own(kind) else None
    if file is None:
        return None
    return Path(file).parent if Path(file).name == "__init__.py" else Path(file)


def describe_own(error: BaseException) -> str | None:
    """Return where a user's own code failed and how, None if no code of a user's was running."""
    own = [frame for frame, _ in traceback.walk_tb(error.__traceback__) if _is_own_frame(frame)]
    if not own:
        return None
    line = next(line for frame, line in reversed([*traceback.walk_tb(error.__traceback__)]) if frame is own[-1])
    code = own[-1].f_code
    name = f"{own[-1].f_globals.get('__name__', '')}.{code.co_qualname}"
    text = " ".join(str(error).split())
    return f"{name} failed ({Path(code.co_filename).name}, line {line}): {type(error).__name__}: {text}"


@contextmanager
def name_failures() -> Iterator[None]:
    """Within, whatever a user's own code raises becomes one line: a traceback does not cross to another process.

    Raises:
        GslError: A user's own code has raised something else.
    """
    try:
        yield
    except GslError:
        raise
    except (Exception, SystemExit) as error:
        if (line := describe_own(error)) is None:
            raise
        raise GslError(line) from error


@cache
def is_elsewhere(file: str) -> bool:
    """Whether a file is none of gsl's, nor of Python and its packages."""
    return not any(folder in Path(file).parents for folder in (*FOLDERS, PACKAGE))


def _is_own_frame(frame: FrameType) -> bool:
    if str(frame.f_globals.get("__name__", "")).partition(".")[0] in PACKAGES:
        return False
    file = frame.f_code.co_filename
    return Path(file).is_file() and is_elsewhere(file)
