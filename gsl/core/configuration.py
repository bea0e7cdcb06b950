"""Where the yaml files lie that come with gsl."""

from __future__ import annotations

from pathlib import Path


def configuration_folder() -> Path:
    """Return the folder of our yaml files: inside the wheel, or at the top of the repository."""
    here = Path(__file__).resolve().parents[1]
    packed = here / "_conf"
    return packed if packed.is_dir() else here.parent / "conf"


def list_worlds() -> set[str]:
    """Return the names of the worlds that come with gsl."""
    return {path.stem for path in (configuration_folder() / "world").glob("*.yaml")}
