"""The help of a stage's command: groups with their options, settings with default, unit and meaning, effects."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from gsl.commandline.composer import compose, groups, options
from gsl.commandline.config import WORKERS, CommandSettings, resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.commandline.known_settings import REFERRED_GROUPS, is_idle, plain, read_declared
from gsl.commandline.overrides import EXECUTOR_KEYS, OPTIONAL_GROUPS
from gsl.commandline.own_effects import load_own_effects
from gsl.commandline.own_word import find_trust
from gsl.core.configuration import configuration_folder
from gsl.core.setting import REQUIRED, Setting, settings_of
from gsl.effects.effect import effect_class, names
from gsl.errors import ConfigError, GslError

WIDEST = 34
NOTE = re.compile(r"(\w+):[^#]*#\s*(.+)")


@dataclass(frozen=True)
class Explanation:
    """What can be said on the command line of a stage.

    Attributes:
        options: Names of a group by what chooses from it, such as `task` or the role `sim`.
        chosen: The name that is chosen by default.
        sections: Settings of the stage (empty name) and of each component, by its dotted path.
    """

    options: Mapping[str, Sequence[str]]
    chosen: Mapping[str, str]
    sections: Mapping[str, Mapping[str, Setting]]

    @property
    def defaults(self) -> dict[str, str]:
        """Dotted key of every setting and its default as text."""
        return {
            f"{path}.{name}".lstrip("."): _text(about.default)
            for path, settings in self.sections.items()
            for name, about in settings.items()
        }


def explain(command: str, typed: Sequence[str] = (), *, config_dir: Path | None = None) -> Explanation:
    """Return what the yaml files and classes of a command say about themselves, with what is typed if it is right."""
    with open_hydra(config_dir):
        load_own_effects(config_dir, find_trust(typed))
        try:
            composition = compose(command, typed)
        except GslError:
            composition = compose(command, [])
        keys = {choice.partition("@")[2] or choice: choice for choice in composition.chosen}
        choices = {key: options(choice.partition("@")[0]) for key, choice in keys.items()}
        fitting = {"experiment", *map(str, composition.config)}  # groups without a default that it can choose from
        choices |= {group: options(group) for group in OPTIONAL_GROUPS if group in groups() and group in fitting}
        chosen = {key: composition.chosen[choice] for key, choice in keys.items()}
        try:
            values = resolve(composition)
        except ConfigError:
            values = plain(composition.config)
        text = OmegaConf.to_yaml(composition.config)
        sections = dict(_sections(values, choices))
        for group in REFERRED_GROUPS:
            if group in sections:
                notes = _notes(group, chosen[group], config_dir)
                sections[group] = {
                    name: replace(about, meaning=notes.get(name, about.meaning))
                    for name, about in sections[group].items()
                    if not is_idle(f"{group}.{name}", text)
                }
        if not any(WORKERS in settings for settings in sections.values()):
            sections[""] = {name: about for name, about in sections[""].items() if name not in EXECUTOR_KEYS}
        return Explanation(choices, chosen, {path: section for path, section in sections.items() if section})


def _notes(group: str, name: str, config_dir: Path | None) -> dict[str, str]:
    """Return the remarks beside the values of a yaml file, by key: what has no class says there what it means."""
    places = [folder / group / f"{name}.yaml" for folder in (config_dir, configuration_folder()) if folder]
    path = next((place for place in places if place.is_file()), None)
    lines = path.read_text(encoding="utf-8").splitlines() if path else []
    return {match[1]: match[2] for line in lines if (match := NOTE.match(line))}


def write_help(command: str, typed: Sequence[str] = (), *, config_dir: Path | None = None) -> str:
    """Return the part of a command's help that comes from its configuration, with what is typed of it."""
    explanation = explain(command, typed, config_dir=config_dir)
    parts = [_table("Groups (KEY=NAME, * is the default):", list(_group_lines(explanation)))]
    for paths, settings in _merge(explanation.sections):
        names = [f"{path}={name}" if (name := explanation.chosen.get(path)) else path for path in paths]
        keys = " or ".join(f"{path}.KEY=VALUE" for path in paths)
        title = f"Settings of {' and '.join(names)} ({keys}):" if paths != [""] else "Settings (KEY=VALUE):"
        parts.append(_table(title, [_setting_line(setting) for setting in settings]))
    worlds = [f"{path}.effects" for path, settings in explanation.sections.items() if "effects" in settings]
    if worlds:
        parts.append(_table(f"Effects ({' or '.join(worlds)}.NAME.PARAMETER=VALUE):", list(_effect_lines())))
    return "\n".join(part for part in parts if part) + "\n"


def _merge(sections: Mapping[str, Mapping[str, Setting]]) -> Iterator[tuple[list[str], list[Setting]]]:
    """Yield settings with the paths that have the same ones; defaults that differ stand side by side."""
    alike: dict[frozenset[tuple[str, str]], list[str]] = {}
    for path, settings in sections.items():
        alike.setdefault(frozenset((name, about.meaning) for name, about in settings.items()), []).append(path)
    for paths in alike.values():
        first = sections[paths[0]]
        yield paths, [_side_by_side([sections[path][name] for path in paths]) for name in first]


def _side_by_side(settings: Sequence[Setting]) -> Setting:
    defaults = list(dict.fromkeys(_text(about.default) for about in settings))
    return settings[0] if len(defaults) == 1 else replace(settings[0], default=" or ".join(defaults))


def _sections(values: Mapping[str, Any], chosen: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Setting]]]:
    """Yield the stage's own settings first, then those of each component."""
    own = {key: value for key, value in values.items() if key not in chosen and not _is_component(value)}
    commands = {name: about for name, about in settings_of(CommandSettings).items() if name not in own}
    yield "", {**_describe(own, values), **commands}
    for key, value in values.items():
        if isinstance(value, Mapping) and (key in chosen or _is_component(value)):
            yield from _component_sections(key, value)


def _component_sections(path: str, values: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Setting]]]:
    inner = {key: value for key, value in values.items() if _is_component(value)}
    yield path, _describe({key: value for key, value in values.items() if key not in inner}, values)
    for key, value in inner.items():
        yield from _component_sections(f"{path}.{key}", value)


def _describe(shown: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Setting]:
    declared = read_declared(dict(values))
    own = {**settings_of(CommandSettings), **declared}
    names = [
        name for name in [*shown, *declared] if not name.startswith("_") and name not in values.keys() - shown.keys()
    ]
    return {
        name: _with_default(own.get(name, Setting(name)), shown.get(name, REQUIRED)) for name in dict.fromkeys(names)
    }


def _with_default(declared: Setting, value: Any) -> Setting:
    default = declared.default if value is REQUIRED else value
    return Setting(
        declared.name, default, declared.meaning, declared.unit, declared.source, declared.lower, declared.upper
    )


def _is_component(value: Any) -> bool:
    return isinstance(value, Mapping) and "_target_" in value


def _group_lines(explanation: Explanation) -> Iterator[tuple[str, ...]]:
    for key, words in explanation.options.items():
        yield key, " ".join(f"{word}*" if word == explanation.chosen.get(key) else word for word in words), ""


def _setting_line(setting: Setting) -> tuple[str, ...]:
    default = f"{_text(setting.default)} {setting.unit}".strip()
    return setting.name, default if len(default) <= WIDEST else f"{default[: WIDEST - 3]}...", setting.meaning


def _effect_lines() -> Iterator[tuple[str, ...]]:
    for name in names():
        for setting in settings_of(effect_class(name)).values():
            if setting.name != "joints":
                yield f"{name}.{setting.name}", setting.unit, setting.meaning


def _text(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{key}:{_text(entry)}" for key, entry in value.items()) + "}"
    return "[" + ",".join(map(_text, value)) + "]" if isinstance(value, list | tuple) else str(value)


def _table(title: str, rows: Sequence[tuple[str, ...]]) -> str:
    widths = [min(WIDEST, max(len(row[column]) for row in rows)) for column in (0, 1)] if rows else []
    lines = [f"  {row[0]:<{widths[0]}}  {row[1]:<{widths[1]}}  {row[2]}".rstrip() for row in rows]
    return "\n".join(["", title, *lines]) if rows else ""
