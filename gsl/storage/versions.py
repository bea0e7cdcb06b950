"""The software an artifact was made with: versions of the libraries that matter and gsl's commit."""

from __future__ import annotations

import platform
import subprocess
from importlib import metadata
from typing import Any

from gsl.version import PACKAGE, __version__

LIBRARIES = (
    *("numpy", "pybullet", "gymnasium", "torch", "cma", "numba", "pandas", "pyarrow"),
    *("hydra-core", "pydantic", "joblib", "safetensors", "mujoco", "stable-baselines3", "sb3-contrib"),
)


def versions() -> dict[str, str | None]:
    """Return the versions of gsl, Python and the libraries; None for one that is not installed."""
    return {"gsl": __version__, "python": platform.python_version()} | {name: _version(name) for name in LIBRARIES}


def _version(library: str) -> str | None:
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return None


def commit() -> dict[str, Any] | None:
    """Return gsl's git commit and whether its tracked files differ from it; None outside a repository."""
    head = _git("rev-parse", "HEAD")
    changes = _git("status", "--porcelain", "--untracked-files=no")
    if head is None or changes is None or _git("ls-files", "--error-unmatch", "__init__.py") is None:
        return None
    return {"commit": head, "dirty": bool(changes)}


def _git(*arguments: str) -> str | None:
    command = ["git", "-C", str(PACKAGE), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=5, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
