"""The yaml files of a configuration, of which those from elsewhere have a budget and do not touch hydra itself."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hydra._internal.core_plugins.file_config_source import FileConfigSource
from hydra._internal.sources_registry import SourcesRegistry
from hydra.core.plugins import Plugins
from hydra.plugins.config_source import ConfigResult, ConfigSource
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from omegaconf.grammar.gen.OmegaConfGrammarParser import OmegaConfGrammarParser
from omegaconf.grammar_parser import parse

from gsl.commandline.overrides import FILE_GROUPS
from gsl.core.budget import SETTINGS, read_text
from gsl.core.trust import TARGET, TRUST
from gsl.core.yaml_tree import yaml_tree
from gsl.errors import ArtifactError, InputError
from gsl.storage.manifest import check_files, read, resembles, strange_files

USER = "gsl-user"
FILES = ("robot", "servo")  # settings of a world that may name a file
_HYDRA = "hydra"
_SELF = "_self_"
_OWN_FOLDER = "or copy what you have changed into a folder of your own, which holds no manifest.json"
_SELECT = "oc.select"  # a setting, or a value where there is none


class BudgetedFiles(FileConfigSource):
    """Reads yaml files as hydra does; a file that is not below our folders is checked before."""

    @classmethod
    @contextmanager
    def in_place_of_hydras(cls) -> Iterator[None]:
        """Within, hydra sets up its sources of files with this; processes of a launcher know hydra's own alone."""
        types, scheme = SourcesRegistry.instance().types, cls.scheme()
        before, types[scheme] = types[scheme], cls
        try:
            yield
        finally:
            types[scheme] = before

    def load_config(self, config_path: str) -> ConfigResult:
        """Return what is in a file.

        Raises:
            InputError: A file from elsewhere is too large or damaged, or says what only the user can say.
        """
        path = Path(os.path.realpath(os.path.join(self.path, self._normalize_file_name(config_path))))
        ours = path.is_relative_to(os.path.realpath(self.path))
        if self.provider == USER or not ours:
            settings = check_file(path, config_path if ours else path.stem)
            if config_path.partition("/")[0] in FILE_GROUPS and TARGET in _words(settings):
                raise InputError(f"{path}: names a class, as {TARGET}, and a mapping builds none; leave it out")
        result = super().load_config(config_path)
        if self.provider == USER:
            _find_files(result.config, Path(self.path))
        return result


def _find_files(config: Any, folder: Path) -> None:
    """Let a world name its files as seen from the folder of --config-dir, wherever the command is typed."""
    for key in (key for key in config if isinstance(key, str)) if isinstance(config, DictConfig) else ():
        value = None if OmegaConf.is_missing(config, key) or OmegaConf.is_interpolation(config, key) else config[key]
        if key in FILES and isinstance(value, str) and Path(value).suffix and (folder / value).is_file():
            config[key] = os.path.relpath(folder / value)
        _find_files(value, folder)


def check_folder(config_dir: Path) -> None:
    """Refuse a folder that is none, and an artifact in which somebody has changed or added settings."""
    if not config_dir.is_dir():
        raise InputError(f"--config-dir {config_dir}: there is no such folder")
    if not resembles(config_dir):
        return
    try:
        stored = read(config_dir)
        files = [name for name in (*stored.files, *strange_files(config_dir, stored)) if name.endswith(".yaml")]
        check_files(config_dir, stored, files)
    except ArtifactError as error:
        raise InputError(f"--config-dir {error}; {_OWN_FOLDER}") from error


def check_file(path: Path, name: str) -> dict[str, Any]:
    """Return what a file says; refuse one that is too large, or that sets what only the user can set."""
    text = read_text(path)
    tree = yaml_tree(path, text, SETTINGS)
    if not isinstance(tree, dict | None):
        raise InputError(f"{path}: holds no settings by name")
    settings = tree or {}
    _check_shape(path, settings)
    package = ConfigSource._get_header_dict(text[:512]).get("package") or ""
    words = [*map(str, settings), *name.split("/"), package, *_words(settings.get("defaults"))]
    if any(_HYDRA in word for word in words):
        raise InputError(f"{path}: sets hydra itself, which can start programs; type such settings instead")
    try:
        resolver = next(_resolvers([tree]), "")
    except OmegaConfBaseException as error:  # of which hydra says nothing but that
        raise InputError(f"{path}: holds a reference that cannot be read; it is written as ${{sim.robot}}") from error
    if resolver:
        raise InputError(f"{path}: refers to {resolver}; a file refers to settings, such as ${{sim.robot}}, alone")
    if TRUST in settings or TRUST in package.split("."):
        raise InputError(f"{path}: says {TRUST}, which only you can say, on the command line")
    return settings


def _check_shape(path: Path, settings: dict[Any, Any]) -> None:
    """Refuse what hydra says nothing clear about: names that are no text, and defaults that are no list of files."""
    for key in _keys(settings):
        if not isinstance(key, str | int | float):
            raise InputError(f"{path}: {key!r} is no name of a setting, which is a text")
    files = settings.get("defaults", [])
    if not isinstance(files, list) or not all(map(_is_default, files)) or files.count(_SELF) > 1:
        raise InputError(f"{path}: its `defaults:` are no list of files, such as [nao_ideal, _self_]")


def _is_default(entry: Any) -> bool:
    """Whether an entry names a file, or one of a group, or several, or none; a reference does not."""
    if isinstance(entry, dict) and len(entry) == 1:
        files = next(iter(entry.values()))
        names = files if isinstance(files, list) else [] if files is None else [files]
    else:
        names = [entry]
    return all(isinstance(name, str) and "${" not in name for name in names)


def _keys(value: Any) -> Iterator[Any]:
    if isinstance(value, dict):
        yield from value
    for entry in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from _keys(entry)


def _words(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        yield from (str(key) for key in value)
    for entry in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from _words(entry)
    if isinstance(value, str):
        yield value


def _resolvers(value: Any) -> Iterator[str]:
    """Yield references to anything but settings, such as the environment's variables."""
    parts = [*value, *value.values()] if isinstance(value, dict) else value if isinstance(value, list) else [value]
    for part in parts:
        if isinstance(part, dict | list):
            yield from _resolvers(part)
        elif isinstance(part, str) and "${" in part and (name := _resolver(part)):
            yield f"'{name}' in {part}"


def _resolver(text: str) -> str:
    """Return the name of what a text refers to beside settings; nothing if it does not."""
    waiting: list[Any] = [parse(text)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, OmegaConfGrammarParser.InterpolationResolverContext):
            resolver: Any = node
            name = str(resolver.resolverName().getText())
            if name != _SELECT:
                return name
        waiting += list(getattr(node, "children", None) or ())
    return ""


def load_plugins() -> Plugins:
    """Return hydra's plugins; a folder hydra_plugins where the command is typed is not imported."""
    with _without_current_folder():
        return Plugins.instance()


@contextmanager
def _without_current_folder() -> Iterator[None]:
    before, here = list(sys.path), os.getcwd()
    sys.path[:] = [place for place in before if place and os.path.realpath(place) != os.path.realpath(here)]
    try:
        yield
    finally:
        sys.path[:] = before
