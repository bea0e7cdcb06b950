"""A failure is whatever ends a command early, told in one line with an exit code."""

from __future__ import annotations

import errno
import os
import sys

from gsl.core.interruption import is_interrupted
from gsl.core.own_code import describe_own
from gsl.errors import GslError, Waiting
from gsl.report.console import Console

INTERRUPTED = 130
_NO_ARRAY = ("array is too big", "Maximum allowed")  # what numpy says of sizes that it does not even ask memory for


def report(failure: BaseException, console: Console, *, command: str = "gsl") -> int:
    """Say what ended a command and return its exit code: 2 usage, input; 1 a stage failed; 130 interrupted; 0 waits."""
    if isinstance(failure, KeyboardInterrupt) or is_interrupted():
        return console.error(
            "interrupted; what is complete stays, and the same command does the rest", INTERRUPTED, command=command
        )
    if isinstance(failure, Waiting):
        console.status(str(failure))
        console.result({"waiting": failure.request, "missing": failure.missing}, text=failure.request.as_posix())
        return failure.exit_code
    if os.environ.get("GSL_TRACEBACK") == "1":
        raise failure
    message, exit_code = describe_failure(failure)
    return console.error(message, exit_code, command=command)


def describe_failure(failure: BaseException) -> tuple[str, int]:
    """Return one line about a failure, and the exit code."""
    if isinstance(failure, GslError):
        return str(failure), failure.exit_code
    text = " ".join(str(failure).split())
    if isinstance(failure, OSError) and failure.filename is not None:
        return f"{failure.filename}: {failure.strerror or text}", 1
    if type(failure).__module__.startswith("numba."):
        from gsl.core.compiled import describe_uncompilable

        if (line := describe_uncompilable(failure)) is not None:
            return line, 1
    if (line := describe_own(failure)) is not None:
        return f"{line}; GSL_TRACEBACK=1 shows more", 1
    absurd = isinstance(failure, ValueError) and text.startswith(_NO_ARRAY)
    if absurd or isinstance(failure, MemoryError) or isinstance(failure, OSError) and failure.errno == errno.ENOMEM:
        return "there is not enough memory for this; free some, or try workers=1, or less at once", 1
    if isinstance(failure, OSError):
        return failure.strerror or text, 1
    if isinstance(failure, UnicodeEncodeError) and not is_text(failure.object):
        return f"a name is no text in UTF-8: {failure.object[:100]!r}; rename what is called so", 2
    if isinstance(failure, RecursionError):
        return "what was given is nested too deeply", 2
    return f"internal error: {type(failure).__name__}: {text}; GSL_TRACEBACK=1 shows where", 1


def is_text(word: str) -> bool:
    """Whether a word from the system, such as an argument or the name of a file, was text in UTF-8."""
    return not any("\ud800" <= letter <= "\udfff" for letter in word)


def leave_quietly() -> int:
    """Return the exit code for a reader of our output that went away, and keep Python from complaining at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 1
