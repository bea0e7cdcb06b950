"""`gsl clean`: says what could go below runs/ and how large it is, and removes it only when asked to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from gsl.commandline.words import split_words
from gsl.core.setting import component, setting
from gsl.core.validation import make
from gsl.core.words import several, size
from gsl.report.console import Console
from gsl.storage.leftovers import Leftover, find_leftovers, find_stale, remove
from gsl.storage.references import RUNS, name_run
from gsl.storage.whole import explain_refusal


@component
class Cleaning:
    """What `gsl clean` takes."""

    name: Annotated[str, setting("only where this is part of the path")] = ""
    stale: Annotated[bool, setting("also artifacts made from one that was built anew since")] = False
    orphaned: Annotated[bool, setting("also artifacts made from one that is gone")] = False


def clean(words: Sequence[str], console: Console, *, yes: bool) -> int:
    """Say what could go, and remove it if that was asked for; return 1 if something could not be removed.

    Raises:
        ConfigError: A setting is wrong.
        GslError: The folder cannot be written.
    """
    cleaning = make(Cleaning, split_words(words, "clean"))
    outdated = find_stale(RUNS, stale=cleaning.stale, orphaned=cleaning.orphaned)
    items = [item for item in (*find_leftovers(RUNS), *outdated) if cleaning.name in name_run(item.path)]
    kept: list[Leftover] = []
    if yes:
        with explain_refusal(RUNS):
            kept = [item for item in items if not remove(item, RUNS)]
    total = size(sum(item.bytes for item in items if item not in kept))
    rows = [(item.path.as_posix(), size(item.bytes), "in use" if item in kept else item.why) for item in items]
    if rows:
        console.table(f"{'removed' if yes else 'could go'} below {RUNS}/", ["what", "size", "why"], rows)
    what = f"{several(len(items) - len(kept), 'leftover')}, {total}"
    outcome = f"{what} removed" if yes else f"{what} could go; --yes removes {'it' if len(items) == 1 else 'them'}"
    entries = [{"path": item.path, "bytes": item.bytes, "why": item.why, "in_use": item in kept} for item in items]
    document = {"removed": yes, "entries": entries, "bytes": sum(item.bytes for item in items)}
    console.result(document, text=outcome if items else f"nothing below {RUNS}/ could go")
    return 1 if kept else 0
