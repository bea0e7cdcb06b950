"""From a command, its yaml files and overrides to one stage object, and from there to an artifact."""

from __future__ import annotations

import inspect
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from hydra.errors import InstantiationException
from hydra.utils import get_object, instantiate
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import AfterValidator

from gsl.commandline.composer import Composition, compose, opened
from gsl.commandline.config_errors import instantiation_error, missing, resolution_error
from gsl.commandline.known_settings import declared
from gsl.commandline.overrides import COMMAND_KEYS, file_of
from gsl.console import Console
from gsl.core.described import described
from gsl.core.setting import component, setting
from gsl.core.validation import make
from gsl.errors import ConfigError

RUNS = Path("runs")
_OURS = re.compile(r"gsl(\.[A-Za-z_]\w*)+")


def _inside(name: str) -> str:
    """Return the name of a run that stays below the folder of the runs."""
    if any(part in ("", ".", "..") for part in name.split("/")):
        raise ValueError("must be a name in runs/, without an empty part or ..; a folder elsewhere is out=")
    return name


@component
class CommandSettings:
    """What a command does with its stage, as opposed to what the stage does."""

    name: Annotated[str, setting("name of the run", min_length=1), AfterValidator(_inside)] = "unnamed"
    out: Annotated[str | None, setting("folder of the artifact", min_length=1)] = None
    force: Annotated[bool, setting("replace an artifact that was built otherwise")] = False
    trust: Annotated[bool, setting("let files of a run name classes that are not gsl's")] = False

    def folder(self, command: str, level: str = "") -> Path:
        """Return the artifact's folder; `level` tells the jobs of a multirun apart."""
        place = Path(self.out) if self.out else RUNS / self.name / file_of(command)
        return place.parent / level / place.name if level else place


def run(
    command: str,
    overrides: Sequence[str],
    *,
    multirun: bool = False,
    cfg: bool = False,
    config_dir: Path | None = None,
    json: bool = False,
) -> int:
    """Run one command and return its exit code.

    Args:
        command: Name of the command, which is also that of its yaml file.
        overrides: Arguments of the form key=value.
        multirun: Whether keys with several values make several jobs.
        cfg: Only print the composed configuration.
        config_dir: The user's folder of yaml files, which wins over ours.
        json: Print one JSON document instead of tables.

    Raises:
        GslError: The configuration is wrong, or the stage failed.
    """
    console = Console(json=json)
    flags = [*(["--multirun"] if multirun else []), *([f"--config-dir={config_dir}"] if config_dir else [])]
    line = shlex.join(["gsl", *command.split(), *flags, *overrides])
    with opened(config_dir):
        composition = compose(command, overrides, multirun=multirun)
        if cfg:
            console.result(resolved(composition), text=OmegaConf.to_yaml(OmegaConf.create(resolved(composition))))
            return 0
        if multirun:
            from gsl.commandline.multirun import run_jobs

            prepared(resolved(composition))
            return run_jobs(command, line, composition, console)
        document = execute(command, line, resolved(composition), console)
        console.result(document, text=said(document))
        return int(document.get("exit_code", 0))


def execute(command: str, line: str, config: Mapping[str, Any], console: Console, *, level: str = "") -> dict[str, Any]:
    """Build the artifact that a resolved configuration describes and return what there is to say about it.

    A stage that `only_looks` says what it would do and builds nothing.
    """
    from gsl.stages.account import account
    from gsl.storage.artifact import build as build_artifact

    stage, settings, own = prepared(config)
    if getattr(stage, "only_looks", False):
        return dict(stage.look(console))
    out = own.folder(command, level)
    artifact = build_artifact(stage, config=settings, out=out, command=line, force=own.force, console=console)
    for told in account(artifact):
        console.table(*told)
    more: Callable[[Path], dict[str, Any]] = getattr(stage, "document", lambda folder: {})
    return {"folder": out.as_posix(), "unchanged": artifact.unchanged, "metrics": artifact.metrics, **more(out)}


def said(document: Mapping[str, Any]) -> str:
    """Return the last line of a command: where its results are, or what it said without writing any."""
    if "said" in document:
        return str(document["said"])
    return f"{document['folder']}{' (unchanged)' if document['unchanged'] else ''}"


def prepared(config: Mapping[str, Any]) -> tuple[Any, dict[str, Any], CommandSettings]:
    """Return the stage, its settings and those of the command; the stage gets a command's setting if it has the field.

    Raises:
        ConfigError: A value is missing, of the wrong type or impossible.
    """
    wanted = declared(dict(config))
    own = make(CommandSettings, {key: config[key] for key in COMMAND_KEYS if key in config})
    dropped = {*COMMAND_KEYS, "preset", "recipe"} - wanted.keys()
    settings = {key: value for key, value in config.items() if key not in dropped}
    for path in _missing(settings, ""):
        raise missing(path)
    stage = _instantiated(settings)
    described(stage)  # refuses what could not be written down afterwards
    return stage, settings, own


def resolved(composition: Composition) -> dict[str, Any]:
    """Return the configuration as plain values, with missing ones as `???`.

    Raises:
        ConfigError: A value refers to something that does not exist.
    """
    try:
        container = OmegaConf.to_container(composition.config, resolve=True)
    except OmegaConfBaseException as error:
        raise resolution_error(error) from error
    assert isinstance(container, dict)
    return {str(key): value for key, value in container.items()}


def build(mapping: Mapping[str, Any], *, trust: bool = False) -> Any:
    """Build the component that a mapping out of a file describes.

    Raises:
        ConfigError: A setting is wrong, or names a class that is not gsl's although `trust` is not set.
    """
    if not trust:
        _check_ours(mapping, "")
    return _instantiated(mapping)


def _instantiated(mapping: Mapping[str, Any]) -> Any:
    try:
        return instantiate(dict(mapping), _convert_="all")
    except InstantiationException as error:
        raise instantiation_error(error) from error.__cause__
    except OmegaConfBaseException as error:
        raise resolution_error(error) from error


def _check_ours(value: Any, path: str) -> None:
    for place, entry in _leaves(value, path):
        if isinstance(entry, str) and "${" in entry:
            raise ConfigError(place, "a file of a run has to hold plain values", given=entry)
        if place.rpartition(".")[2] == "_target_" and not _is_our_class(entry):
            raise ConfigError(
                place, "is no class of gsl; trust=true if you know where this file comes from", given=str(entry)
            )


def _is_our_class(name: object) -> bool:
    """Whether a dotted name is a class that gsl itself defines, not one that a module of gsl happens to import."""
    if not isinstance(name, str) or not _OURS.fullmatch(name):
        return False
    try:
        found = get_object(name)
    except (ImportError, ValueError):
        return False
    return inspect.isclass(found) and found.__module__.partition(".")[0] == "gsl"


def _missing(value: Any, path: str) -> Iterator[str]:
    return (place for place, entry in _leaves(value, path) if entry == "???")


def _leaves(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    entries = (
        value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list | tuple) else None
    )
    if entries is None:
        yield path, value
        return
    for key, entry in entries:
        yield from _leaves(entry, f"{path}.{key}".lstrip("."))
