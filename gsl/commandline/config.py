"""From a composed configuration to one stage object, and from there to an artifact."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from hydra.errors import InstantiationException
from hydra.utils import instantiate
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import AfterValidator

from gsl.commandline.composer import Composition
from gsl.commandline.config_errors import instantiation_error, missing, resolution_error
from gsl.commandline.known_settings import declared
from gsl.commandline.overrides import COMMAND_KEYS, file_of
from gsl.core.console import Console
from gsl.core.described import described
from gsl.core.setting import component, setting
from gsl.core.validation import make

RUNS = Path("runs")


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


def execute(command: str, line: str, config: Mapping[str, Any], console: Console, *, level: str = "") -> dict[str, Any]:
    """Build the artifact that a resolved configuration describes and return what there is to say about it.

    A stage that `only_looks` says what it would do and builds nothing.
    """
    from gsl.report.account import account
    from gsl.storage.artifact import build

    stage, settings, own = prepared(config)
    if getattr(stage, "only_looks", False):
        return dict(stage.look(console))
    out = own.folder(command, level)
    artifact = build(stage, config=settings, out=out, command=line, force=own.force, console=console)
    for told in account(artifact):
        console.table(*told)
    more: Callable[[Path], dict[str, Any]] = getattr(stage, "document", lambda folder: {})
    return {"folder": out.as_posix(), "unchanged": artifact.unchanged, "metrics": artifact.metrics, **more(out)}


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
    stage = instantiate_settings(settings)
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


def instantiate_settings(mapping: Mapping[str, Any]) -> Any:
    """Return the object that a mapping with `_target_` describes.

    Raises:
        ConfigError: A value is of the wrong type or impossible.
    """
    try:
        return instantiate(dict(mapping), _convert_="all")
    except InstantiationException as error:
        raise instantiation_error(error) from error.__cause__
    except OmegaConfBaseException as error:
        raise resolution_error(error) from error


def _missing(value: Any, path: str) -> Iterator[str]:
    """Yield the dotted paths of the values that nobody has given."""
    if value == "???":
        yield path
    mapping = value if isinstance(value, Mapping) else dict(enumerate(value)) if isinstance(value, list | tuple) else {}
    for key, entry in mapping.items():
        yield from _missing(entry, f"{path}.{key}".lstrip("."))
