"""Help that was written before: reading every class of a stage takes seconds, so the text is kept until one changes."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from gsl.commandline.plugins import folders
from gsl.storage.hashing import sources_hash

CHOICE = re.compile(r"[\w.@]+=\w+")  # what is typed of our own: no file and no class of somebody else
CONF = Path(__file__).resolve().parents[2] / "conf"  # in a wheel it lies in the package, among the sources


def read_or_write(command: str, typed: Sequence[str], write: Callable[[], str]) -> str:
    """Return the help of a command, from the cache if nothing that it is made of has changed.

    Args:
        command: Its name.
        typed: What is typed besides.
        write: Makes the text.
    """
    if "GSL_TRUST" in os.environ or not all(CHOICE.fullmatch(word) for word in typed):
        return write()
    try:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gsl"
    except RuntimeError:  # there is no home
        return write()
    place = home / f"help-{_key(command, typed)}.txt"
    try:
        digest, _, text = place.read_text(encoding="utf-8").partition("\n")
        if digest == _hash(text):
            return text
    except (OSError, ValueError):
        pass
    text = write()
    temporary = place.with_suffix(f".{os.getpid()}")
    try:
        home.mkdir(parents=True, exist_ok=True)
        temporary.write_text(f"{_hash(text)}\n{text}", encoding="utf-8")
        temporary.replace(place)
    except OSError:  # a home that cannot be written costs the seconds again
        with suppress(OSError):
            temporary.unlink()
    return text


def _key(command: str, typed: Sequence[str]) -> str:
    """Return a hash of all that a help is made of."""
    files = sorted(path for folder in (CONF, *folders()) for path in folder.rglob("*.yaml"))
    code = [sources_hash(folder.parent) for folder in folders()] or [sources_hash()]
    return _hash("\0".join([command, *typed, *code, *(f"{path}\0{_hash(path.read_text('utf-8'))}" for path in files)]))[
        :16
    ]


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
