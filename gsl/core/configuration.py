"""Where the yaml files lie that come with gsl."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import yaml


def configuration_folder() -> Path:
    """Return the folder of our yaml files: inside the wheel, or at the top of the repository."""
    here = Path(__file__).resolve().parents[1]
    packed = here / "_conf"
    return packed if packed.is_dir() else here.parent / "conf"


def list_worlds() -> set[str]:
    """Return the names of the worlds that come with gsl."""
    return {path.stem for path in (configuration_folder() / "world").glob("*.yaml")}


def name_world(world: Mapping[str, Any]) -> set[str]:
    """Return the names of the world files that say what the settings of a world say, the most of all that do.

    Numbers and truth values do not count, such as the physics period: tasks, presets and users change them.
    """
    fitting = {}
    for name in list_worlds():
        kind = {key: value for key, value in _read_world(name).items() if not isinstance(value, int | float)}
        if all(key in world and world[key] == value for key, value in kind.items()):
            fitting[name] = len(kind)
    return {name for name, count in fitting.items() if count == max(fitting.values())}


@cache
def _read_world(name: str) -> dict[str, Any]:
    """Return what a world file and those that it builds on say, without references."""
    text = (configuration_folder() / f"world/{name}.yaml").read_text(encoding="utf-8")
    own: dict[str, Any] = yaml.safe_load(text)
    whole: dict[str, Any] = {}
    for above in own.pop("defaults", ["_self_"]):
        whole = _merge(whole, own if above == "_self_" else _read_world(above))
    return whole


def _merge(whole: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return two mappings as one, as Hydra does: a value below a name replaces another."""
    both = {name: _merge(whole[name], own[name]) for name in whole.keys() & own.keys() if isinstance(own[name], dict)}
    return {**whole, **own, **both}
