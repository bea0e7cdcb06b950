"""Worlds, tasks, policies and groundings by the names of their yaml files."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from gsl.api.overrides import overrides
from gsl.commandline.composer import compose
from gsl.commandline.config import resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.commandline.own_effects import load_own_effects
from gsl.commandline.own_word import find_trust
from gsl.core.described import restore
from gsl.core.interfaces import Grounding, Policy, Task, World
from gsl.core.trust import TRUST
from gsl.core.validation import config_error
from gsl.effects.effect import keep_own
from gsl.errors import ConfigError
from gsl.grounding.effects import having_effects

ROLES = {"world": "collect", "task": "collect", "policy": "collect", "grounding": "optimize"}  # a command that has each


@keep_own()
def make_world(name: str, *, config_dir: Path | str | None = None, **settings: Any) -> World:
    """Return a world by the name of its yaml file.

    Args:
        name: Such as `nao_worn`; `gsl collect --help` lists them.
        config_dir: A folder of yaml files of your own.
        **settings: That differ from the file's, such as `step=0.001`; `trust="my_module"` lets the file name classes of
            that module; or `effects={"backlash": {"width": 0.02}}`: an
            effect takes the place of the file's, or is added.

    Raises:
        ConfigError: There is no such file or setting, or a value is impossible.
    """
    effects = settings.pop("effects", None)
    world: World = _make("world", name, config_dir, settings, World)
    if effects is None:
        return world
    if not isinstance(effects, Mapping):
        raise ConfigError("world.effects", "is a mapping of effects by name", given=str(effects))
    having: Any = having_effects(world)
    try:
        changed: World = replace(having, effects={**having.effects, **deepcopy(effects)})
    except ValidationError as error:
        raise config_error(error, type(world), where="world") from error
    return changed


@keep_own()
def make_task(name: str, *, config_dir: Path | str | None = None, **settings: Any) -> Task:
    """Return a task by the name of its yaml file; arguments as those of `make_world`."""
    return _make("task", name, config_dir, settings, Task)


@keep_own()
def make_policy(name: str, *, config_dir: Path | str | None = None, **settings: Any) -> Policy:
    """Return a family of policies by the name of its yaml file; arguments as those of `make_world`."""
    return _make("policy", name, config_dir, settings, Policy)


@keep_own()
def make_grounding(name: str, *, config_dir: Path | str | None = None, **settings: Any) -> Grounding:
    """Return a grounding by the name of its yaml file; arguments as those of `make_world`."""
    return _make("grounding", name, config_dir, settings, Grounding)


def _make(group: str, name: str, config_dir: Path | str | None, settings: Mapping[str, Any], kind: Any) -> Any:
    own = {key: value for key, value in settings.items() if key == TRUST}
    below = {key: value for key, value in settings.items() if key not in own}
    folder, arguments = None if config_dir is None else Path(config_dir), list(overrides(own))
    with open_hydra(folder):
        load_own_effects(folder, find_trust(arguments))
        composition = compose(ROLES[group], [f"{group}={name}", *overrides(below, f"{group}."), *arguments])
    made = restore(resolve(composition)[group], trust=composition.trust, where=group)
    if not isinstance(made, kind):
        raise ConfigError(group, f"is no {group}", given=name)
    return made
