"""The composer is hydra's door: it turns a command, its yaml files and overrides into one configuration."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import CompactHydraException, HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from gsl.commandline.config_errors import Vocabulary, misshapen, shapeless, translate, unfit, unknown_key, unreadable
from gsl.commandline.hydra_door import OtherConfiguration
from gsl.commandline.known_settings import REFERRED, is_idle, list_keys, plain, read_declared, read_parts
from gsl.commandline.overrides import COMMAND_KEYS, NAMES, effect_path, file_of, key_of, rewrite
from gsl.commandline.own_word import check_own_word, check_servos, find_own_modules, find_trust, keep_text
from gsl.commandline.plugins import folders, packages
from gsl.core.budget import within
from gsl.core.configuration import configuration_folder
from gsl.core.setting import Setting
from gsl.core.trust import TARGET, check_code, is_ours
from gsl.core.validation import did_you_mean
from gsl.effects.effect import names, withheld
from gsl.errors import ConfigError, InputError

LOGS = ("real", "reference")  # settings that name recorded trajectories
LOGS_TOGETHER = "several logs are one folder of files"
WHOLE = "iterate"  # the command, and the setting of others, that makes what a grounding refers to
MADE = re.compile(r"(?:grounding|methods\.\w+)(?:\.inner)?\.(?:forward_model|inverse_model|diagnosis|servo|model)")


@dataclass(frozen=True)
class Composition:
    """One composed configuration and how it came about.

    Attributes:
        config: The configuration, command keys included, hydra's own part left out.
        overrides: The arguments as hydra took them.
        chosen: The defaults list: group, or group@role, to the name of the chosen file.
        swept: Keys that take several values in a multirun.
        trust: Modules that the user has named, and whose code may run.
    """

    config: DictConfig
    overrides: tuple[str, ...]
    chosen: Mapping[str, str]
    swept: tuple[str, ...]
    trust: tuple[str, ...] = ()


def commands() -> list[str]:
    """Return the names of the yaml files of all stages, ours and those of plugins."""
    return sorted(path.stem for folder in (configuration_folder(), *folders()) for path in folder.glob("*.yaml"))


def compose(command: str, arguments: Sequence[str], *, multirun: bool = False) -> Composition:
    """Compose the configuration of a command; of a multirun, that of its first job.

    Raises:
        ConfigError: An argument is malformed, or names a setting, option or effect that does not exist.
    """
    typed = find_trust(arguments)
    find_own_modules(typed)
    trust = (*typed, *(package for package in packages() if not is_ours(package)))
    words = Vocabulary(OmegaConf.create(), {})
    try:
        whole = _compose(command, [], trust)
        base, words = plain(whole), Vocabulary(_without_hydra(whole), _choices(whole))
        overrides = _parse(rewrite(arguments, words.chosen), multirun)
        if choices := [_first_value(override) for override in overrides if _is_choice(override)]:
            words = replace(words, config=_without_hydra(_compose(command, choices, trust)))
        overrides = [keep_text(override) if _takes_text(override, words.config) else override for override in overrides]
        signs = [_sign(override, words.config) for override in overrides]
        first = [sign + _first_value(override) for sign, override in zip(signs, overrides, strict=True)]
        config = _compose_and_put(command, first, trust)
    except (CompactHydraException, OmegaConfBaseException, YAMLError) as error:
        raise unfit(command, arguments, unknown_key(error)) or translate(error, words) from error
    except ValueError as error:
        raise misshapen(arguments, error) from error
    lines = tuple(f"{sign}{override.input_line}" for sign, override in zip(signs, overrides, strict=True))
    swept = tuple(key_of(str(override.input_line)) for override in overrides if override.is_sweep_override())
    composition = Composition(_without_hydra(config), lines, _choices(config), swept, trust)
    _check_effects(composition)
    _check_referred(command, composition)
    _check_made(command, composition)
    values = plain(composition.config)
    check_own_word(values, {key_of(word) for word in arguments})
    check_servos(composition.config, arguments, OtherConfiguration.folder)
    strangers = values.keys() - read_declared(values).keys() - base.keys() - {*COMMAND_KEYS}
    if misfit := unfit(command, arguments, min(strangers, default=None)):
        raise misfit
    return composition


def options(group: str) -> list[str]:
    """Return the names of the files of a group."""
    return list(_loader().get_group_options(group))


def groups() -> list[str]:
    """Return the names of all groups of ours and the user's."""
    return list(_groups(_loader()))


@lru_cache(maxsize=1)  # every word that is typed asks for them, and hydra walks through all folders
def _groups(loader: Any) -> tuple[str, ...]:
    return tuple(group for group in loader.list_groups("") if group != "hydra")


def _parse(overrides: Sequence[str], multirun: bool) -> list[Override]:
    """Return overrides as hydra reads them; several values are for a multirun, a group takes a name."""
    parser, parsed = OverridesParser.create(config_loader=_loader()), []
    for override in overrides:
        key, value = key_of(override), override.partition("=")[2]
        try:
            parsed.append(read := parser.parse_overrides([override])[0])  # with the loader, which a glob asks
        except HydraException as error:
            raise ConfigError(key, unreadable(override, parser), given=value) from error
        if read.is_sweep_override() and not multirun:
            together = f"a list is written '{key}=[{value}]'" if key not in LOGS else LOGS_TOGETHER
            more = f"; {together}" if read.is_choice_sweep() else ""
            raise ConfigError(key, f"several values need --multirun{more}")
        if _is_choice(read):
            parsed[-1] = read = keep_text(read)
        if _is_choice(read) and not (read.is_sweep_override() or isinstance(read.value(), str | list | dict)):
            raise ConfigError(key.rpartition("@")[2], "takes the name of a file", given=value)
    return parsed


def _check_effects(composition: Composition) -> None:
    """Refuse an effect that is neither in the library nor names its own class with `_target_`."""
    for override in composition.overrides:
        path = effect_path(key_of(override))
        name = path.rpartition(".")[2]
        if not path or override.startswith("~") or name in names():
            continue
        node = OmegaConf.select(composition.config, path)
        if not (isinstance(node, DictConfig) and TARGET in node):
            raise withheld(name) or ConfigError(path, f"no such effect{did_you_mean(name, names())}")


def _check_referred(command: str, composition: Composition) -> None:
    """Refuse a value of a recipe or preset that nothing of this command refers to: it would do nothing."""
    typed = [key for key in map(key_of, composition.overrides) if key.startswith(REFERRED)]
    text = OmegaConf.to_yaml(composition.config) if typed else ""
    for key in typed:
        if is_idle(key, text):
            last = key.rpartition(".")[2]
            there = [name for name in list_keys(composition.config) if not name.startswith(REFERRED)]
            others = [name for name in there if name.rpartition(".")[2] == last]
            hint = f"; did you mean {' or '.join(others[:3])}?" if others else ""
            raise ConfigError(key, f"nothing in gsl {command} refers to it here{hint}")


def _check_made(command: str, composition: Composition) -> None:
    """Refuse models and diagnoses that a command would make anew."""
    if command == WHOLE or WHOLE in composition.config:
        for key in filter(MADE.fullmatch, map(key_of, composition.overrides)):
            raise ConfigError(key, "is made here; gsl optimize takes one that is there")


def _is_choice(override: Override) -> bool:
    return not override.is_delete() and override.key_or_group in groups()


def _takes_text(override: Override, config: DictConfig) -> bool:
    parent, _, name = override.key_or_group.rpartition(".")
    declared = _find_declared(config, parent).get(name)
    return override.key_or_group in NAMES or (declared is not None and declared.text)


def _sign(override: Override, config: DictConfig) -> str:
    """Return the `++` of what only the class of a component names, or what that lets the user name."""
    parent, _, name = override.key_or_group.rpartition(".")
    if _is_choice(override) or str(override.input_line).startswith(("+", "~")):
        return ""
    above, _, mapping = parent.rpartition(".")
    keys = {*_find_declared(config, parent), *read_parts(_node(config, above)).get(mapping, {})}
    is_below = _is_below_names(config, parent)
    if is_below and isinstance(plain_value := OmegaConf.select(config, parent), str | int | float):
        raise shapeless(parent, name, plain_value)
    return "++" if name in keys or is_below else ""


def _is_below_names(config: DictConfig, path: str) -> bool:
    """Whether a path is a mapping whose names nobody declares, such as the signals of a log, or lies below one."""
    above, _, name = path.rpartition(".")
    around = _find_declared(config, above).get(name)
    return (around is not None and around.named) or (bool(above) and _is_below_names(config, above))


def _find_declared(config: DictConfig, path: str) -> Mapping[str, Setting]:
    return read_declared(_node(config, path))


def _node(config: DictConfig, path: str) -> dict[str, Any]:
    return plain(OmegaConf.select(config, path) if path else config)


def _first_value(override: Override) -> str:
    if not override.is_sweep_override():
        return str(override.input_line)
    sweep: Any = override.value()
    first = next(iter(override.sweep_string_iterator()), None) if override.is_discrete_sweep() else sweep.start
    if first is None:
        raise ConfigError(
            override.key_or_group, "fits no file of a group", given=str(override.input_line).partition("=")[2]
        )
    return f"{override.get_key_element()}={first}"


def _compose_and_put(command: str, overrides: Sequence[str], trust: Sequence[str]) -> DictConfig:
    """Compose the choices, and put the values in as hydra does: most commands differ in values alone."""
    parsed = OverridesParser.create(config_loader=_loader()).parse_overrides(list(overrides))
    choices, values = ([each for each in parsed if _is_choice(each) == is_so] for is_so in (True, False))
    if any(isinstance(each.value(), dict) for each in choices) or any(map(_asks_for_a_group, values)):
        return _compose(command, overrides, trust)
    config = deepcopy(_compose(command, [str(each.input_line) for each in choices], trust))
    ConfigLoaderImpl._apply_overrides_to_config(values, config)  # all that hydra does with values
    check_code(plain(_without_hydra(config)), trust, references=True)
    return config


def _asks_for_a_group(value: Override) -> bool:
    """Whether what is no choice may still be of a group: one that goes, of a folder below, or of hydra's own."""
    key = value.key_or_group
    return value.package is not None or "/" in key or key in groups() or key.partition(".")[0] == "hydra"


def _compose(command: str, overrides: Sequence[str], trust: Sequence[str]) -> DictConfig:
    """Compose, or take what the same words came to in this process, unless a file has changed; nobody may change it."""
    elsewhere = any("../" in override for override in overrides)  # as a mapping that is named by its path
    if OtherConfiguration.folder is not None or elsewhere:  # who knows how much lies in there
        return _compose_anew(command, overrides, trust)
    files = (path for folder in (configuration_folder(), *folders()) for path in folder.rglob("*.yaml"))
    stamps = frozenset((path, (status := path.stat()).st_mtime_ns, status.st_size) for path in files if path.exists())
    return _compose_once(command, tuple(overrides), tuple(trust), stamps)


@lru_cache(maxsize=64)  # a study's commands, with and without their choices
def _compose_once(command: str, overrides: Sequence[str], trust: Sequence[str], stamps: frozenset[Any]) -> DictConfig:
    return _compose_anew(command, overrides, trust)


def _compose_anew(command: str, overrides: Sequence[str], trust: Sequence[str]) -> DictConfig:
    """Compose; nothing that a file names is imported before it is checked here."""
    hydra = GlobalHydra.instance().hydra
    assert hydra is not None
    name, how = file_of(command), {"from_shell": False, "with_log_configuration": False}
    try:
        with within("putting the settings together"):  # files may name each other again and again
            config = hydra.compose_config(config_name=name, overrides=list(overrides), run_mode=RunMode.RUN, **how)
    except AttributeError as error:  # hydra's own, of settings of hydra's that are of another kind
        raise ConfigError("hydra", f"its settings cannot be read: {str(error).splitlines()[0]}") from error
    except RecursionError as error:
        raise InputError("yaml files name each other in a circle, in their `defaults:`") from error
    check_code(plain(_without_hydra(config)), trust, references=True)
    return config


def _without_hydra(config: DictConfig) -> DictConfig:
    return OmegaConf.masked_copy(config, [str(key) for key in config if key != "hydra"])


def _choices(config: DictConfig) -> dict[str, str]:
    choices = config.hydra.runtime.choices
    return {str(key): str(value) for key, value in choices.items() if not str(key).startswith("hydra/")}


def _loader() -> Any:
    return GlobalHydra.instance().config_loader()
