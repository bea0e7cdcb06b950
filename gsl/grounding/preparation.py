"""Preparing any grounding: what it is made of, the world that it makes, and what acts in it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gsl.core.checkpoint import read_checkpoint
from gsl.core.interfaces import REAL, SIM, Grounding, HasMargins, Preparable, Prepared, Trainable, World
from gsl.errors import ConfigError
from gsl.storage.references import resolve

MODEL, KIND, MAKER = "grounding_model.safetensors", "grounding", "train_grounding"


def parents_of(grounding: Any, path: str = "grounding") -> Mapping[str, Path]:
    """Return the artifacts that a grounding is made of, by role; `path` is the setting that it is."""
    if isinstance(grounding, Preparable):
        return grounding.parents(path)
    return {f"{path}.model": _find_model(grounding)} if isinstance(grounding, Trainable) else {}


def prepare(grounding: Grounding, world: World, settled: Mapping[str, Any] | None = None) -> Prepared:
    """Return the world that a grounding makes and what acts in it, with what a search has settled.

    Raises:
        ConfigError: The world is not of a kind that it is for, or what it has learned is missing.
    """
    if isinstance(grounding, Preparable):
        return grounding.prepare(world, settled or {})
    if isinstance(grounding, Trainable):
        place = _find_model(grounding)
        check_own(grounding)
        arrays, _ = read_checkpoint(place / MODEL if place.is_dir() else place, kind=KIND)
        loaded = grounding.load(arrays)
        if not isinstance(loaded, Grounding):
            raise ConfigError("grounding", f"its load() returned {type(loaded).__name__}, which has no start()")
        return Prepared(world, loaded)
    return Prepared(world, grounding)


def without_margins(grounding: Grounding) -> Grounding:
    """Return a grounding without the noise and the draws that a search has on top."""
    return grounding.without_margins() if isinstance(grounding, HasMargins) else grounding


def check_own(grounding: Trainable) -> None:
    """Refuse a class that could not learn or be loaded, before anything is collected for it.

    Raises:
        ConfigError: It lacks a part, or needs something else than trajectories.
    """
    kind = type(grounding)
    if not isinstance(getattr(grounding, "model", None), str):
        problem = 'has no setting `model`; add `model: Annotated[str, setting("path or run of train-grounding")] = ""`'
        raise ConfigError("grounding", problem, given=kind.__name__)
    for name in ("learn", "load"):
        if getattr(kind, name) is getattr(Trainable, name):
            raise ConfigError("grounding", f"has no method `{name}`", given=kind.__name__)
    if strangers := [role for role in grounding.needs if role not in (REAL, SIM)]:
        raise ConfigError("grounding", f"its `needs` are of {REAL} and {SIM}", given=str(strangers[0]))


def _find_model(grounding: Trainable) -> Path:
    if not grounding.model:
        raise ConfigError("grounding.model", "is missing; name a run of gsl train-grounding")
    return resolve(grounding.model, kind=MAKER)
