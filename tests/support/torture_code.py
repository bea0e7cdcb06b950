"""Code that inputs of the campaign bring with them, which must not run, and a watch on what is written where."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

CANARY = "canary"  # a file that is there when code of an input has run
MODULE = f"""from pathlib import Path

Path("{CANARY}").touch()


class Thing:
    pass
"""
CODES = (
    {"_target_": "canary_module.Thing"},
    {"_target_": "pathlib.Path.touch", "self": {"_target_": "pathlib.Path", "_args_": [CANARY]}},
    {"_target_": "os.system", "command": f"touch {CANARY}"},
    {"_target_": "subprocess.call", "args": ["touch", CANARY]},
    {"_target_": "builtins.exec", "_args_": [f"open('{CANARY}', 'w')"]},
    {"_target_": "hydra.utils.call", "config": {"_target_": "os.system", "_args_": [f"touch {CANARY}"]}},
)
YAMLS_WITH_CODE = (
    f"a: !!python/object/apply:os.system ['touch {CANARY}']\n",
    f"a: !!python/object/new:subprocess.Popen [[touch, {CANARY}]]\n",
    "a: !!python/name:canary_module.Thing\n",
    "a: !!python/module:canary_module\n",
)
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
CACHES = ("torchinductor_", "__pycache__", "numba", "matplotlib")
CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "shutil.rmtree")


class Pickled:
    """An object whose unpickling runs code."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (os.system, (f"touch {CANARY}",))


class Watch:
    """Notes what this process writes elsewhere than below its folder, the folder of temporary files and caches."""

    def __init__(self, folder: Path) -> None:
        self.elsewhere: list[str] = []
        temporary = self.temporary = os.path.realpath(tempfile.gettempdir())  # itself: of a file without a name
        self.fine = (os.path.realpath(folder) + os.sep, os.path.join(temporary, "gsl-"), "/dev/", "/proc/")
        sys.addaudithook(self)

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event != "open" and event not in CHANGES:
            return
        if event == "open" and not (arguments[2] or 0) & WRITING:
            return
        path = arguments[0]
        if not isinstance(path, str | os.PathLike):
            return
        place = os.path.realpath(os.fspath(path))
        if place != self.temporary and not place.startswith(self.fine) and not any(name in place for name in CACHES):
            self.elsewhere.append(place)


def has_code(words: tuple[str, ...], mine: Path) -> bool:
    """Is there something in the words or files of an input that would make the canary if it ran?"""
    files = (path for path in mine.rglob("*") if path.is_file())
    return CANARY in " ".join(words) or any(CANARY.encode() in path.read_bytes() for path in files)
