"""Which worlds of gsl's own the settings of a world are, whatever command they come from."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf

from gsl.core.configuration import configuration_folder, list_worlds


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
    own = cast(DictConfig, OmegaConf.load(configuration_folder() / f"world/{name}.yaml"))
    above = own.pop("defaults", ["_self_"])
    whole = OmegaConf.merge(*(own if part == "_self_" else _read_world(part) for part in above))
    return cast(dict[str, Any], OmegaConf.to_container(whole))
