"""From a composed configuration to one stage object, and from there to an artifact."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import AfterValidator, BeforeValidator

from gsl.commandline.composer import Composition
from gsl.commandline.config_errors import missing, of_the_command, resolution_error
from gsl.commandline.expansion import check_expansion
from gsl.commandline.known_settings import plain, read_declared
from gsl.commandline.overrides import COMMAND_KEYS, file_of
from gsl.commandline.own_word import modules_of
from gsl.commandline.unusual_effects import list_unusual
from gsl.core.budget import within
from gsl.core.console import Console
from gsl.core.described import describe, restore
from gsl.core.setting import component, setting
from gsl.core.trust import TRUST, check_code
from gsl.core.validation import make
from gsl.errors import ArtifactError, ConfigError, InputError
from gsl.rollout.cluster import Cluster, executing
from gsl.storage.identity import flat

RUNS = Path("runs")
WORKERS = "workers"  # setting of whatever rolls out or runs trials
GAT = "grounding.forward_model"  # of which gsl optimize is asked first, by its default grounding
LONGEST = 200  # bytes of a folder's name; file systems take 255, and temporary folders have longer ones


def _inside(name: str) -> str:
    """Return the name of a run that stays below the folder of the runs."""
    if "\0" in name or any(len(part.encode()) > LONGEST for part in name.split("/")):
        raise ValueError(f"must be a name of folders, each of {LONGEST} bytes at most")
    if any(part in ("", ".", "..") for part in name.split("/")):
        raise ValueError("must be a name in runs/, without an empty part or ..; a folder elsewhere is out=")
    if any(part.startswith(".") for part in name.split("/")):
        raise ValueError("must not begin with a dot: what is hidden in runs/ is gsl's own, and is cleaned away")
    return name


def _own_folder(out: str | None) -> str | None:
    """Return the folder of an artifact, which is none that holds the current one."""
    if out is not None and ("\0" in out or Path.cwd().is_relative_to(Path(out).absolute().resolve())):
        raise ValueError("must be a folder of its own, such as out=runs/mine/collect")
    return out


def _scheduler(address: str | None) -> str | None:
    """Return the address of a dask scheduler."""
    if address is not None and not re.fullmatch(r"(tcp|tls|ucx|wss?)://[^/\s]+:\d{1,5}", address):
        raise ValueError("must be the address that `dask scheduler` prints, such as tcp://host:8786")
    return address


@component
class CommandSettings:
    """What a command does with its stage, as opposed to what the stage does."""

    name: Annotated[str, setting("name of the run", min_length=1), AfterValidator(_inside)] = "unnamed"
    out: Annotated[str | None, setting("folder of the artifact", min_length=1), AfterValidator(_own_folder)] = None
    force: Annotated[bool, setting("replace an artifact that was built otherwise")] = False
    trust: Annotated[
        tuple[str, ...], setting("modules of your own whose code files may name"), BeforeValidator(modules_of)
    ] = ()
    executor: Annotated[
        Literal["local", "dask"], setting("who does rollouts and trials: processes of this machine, or a dask cluster")
    ] = "local"
    address: Annotated[
        str | None,
        setting("of the dask scheduler, such as tcp://host:8786; without it, a cluster of this machine"),
        AfterValidator(_scheduler),
    ] = None

    def __post_init__(self) -> None:
        """Refuse an address of which nobody would take notice."""
        if self.address is not None and self.executor != "dask":
            raise ConfigError("address", "is of a dask scheduler; say executor=dask, too", given=self.address)

    @property
    def cluster(self) -> Cluster | None:
        """Who does the jobs, if it is not processes of this machine."""
        return Cluster(self.address) if self.executor == "dask" else None

    def folder(self, command: str, level: str = "") -> Path:
        """Return the artifact's folder; `level` tells the jobs of a multirun apart."""
        place = Path(self.out) if self.out else RUNS / self.name / file_of(command)
        return place.parent / level / place.name if level else place


def execute(
    command: str,
    line: str,
    config: Mapping[str, Any],
    console: Console,
    *,
    trust: Collection[str] = (),
    level: str = "",
) -> dict[str, Any]:
    """Build the artifact that a resolved configuration describes and return what there is to say about it.

    A stage that `only_looks` says what it would do and builds nothing; `trust` names modules that are not gsl's.
    """
    from gsl.report.account import account
    from gsl.storage.artifact import build

    with console.at_work(command):
        stage, settings, own = prepare(config, trust)
        _warn(stage, console)
        if getattr(stage, "only_looks", False):
            return dict(stage.look(console))
        out = own.folder(command, level)
        try:
            with executing(own.cluster):
                artifact = build(stage, config=settings, out=out, command=line, force=own.force, console=console)
        except ArtifactError as error:
            raise _name_setting(error, settings, own.name) from error
    for table in account(artifact):
        console.table(*table)
    more: Callable[[Path], dict[str, Any]] = getattr(stage, "document", lambda folder: {})
    return {"folder": out.as_posix(), "unchanged": artifact.unchanged, "metrics": artifact.metrics, **more(out)}


def prepare(config: Mapping[str, Any], trust: Collection[str] = ()) -> tuple[Any, dict[str, Any], CommandSettings]:
    """Return the stage, its settings and those of the command; the stage gets a command's setting if it has the field.

    Raises:
        ConfigError: A value is missing, of the wrong type or impossible.
    """
    check_code(config, trust)
    wanted = read_declared(dict(config))
    own = make(CommandSettings, {key: config[key] for key in COMMAND_KEYS if key in config})
    dropped = {*COMMAND_KEYS, "preset", "recipe"} - wanted.keys()
    settings = {key: value for key, value in config.items() if key not in dropped}
    for path in _missing(settings, ""):
        raise missing(path)
    if TRUST in settings:
        settings[TRUST] = list(trust)
    try:
        stage = restore(settings, trust=trust)
    except ConfigError as error:
        raise of_the_command(error, config) from error
    described = describe(stage)  # refuses what could not be written down afterwards
    if own.cluster is not None and not any(name.rpartition(".")[2] == WORKERS for name in flat(described)):
        raise ConfigError("executor", "this command gives nothing to workers; leave it out", given=own.executor)
    return stage, settings, own


def resolve(composition: Composition) -> dict[str, Any]:
    """Return the configuration as plain values, with missing ones as `???`.

    Raises:
        ConfigError: A value refers to something that does not exist.
        InputError: References multiply.
    """
    check_expansion(plain(composition.config))
    try:
        with within("putting the settings together"):
            container = OmegaConf.to_container(composition.config, resolve=True)
    except OmegaConfBaseException as error:
        raise resolution_error(error) from error
    assert isinstance(container, dict)
    return {str(key): value for key, value in container.items()}


def _warn(stage: Any, console: Console) -> None:
    """Say which effects of its worlds have values far from what is documented."""
    for role, part in vars(stage).items():
        if hasattr(part, "effects") and hasattr(part, "plant"):
            for unusual in list_unusual(part.effects, part.plant.robot):
                console.status(f"warning: {role}.{unusual}")


def _name_setting(error: ArtifactError, settings: Mapping[str, Any], name: str) -> Exception:
    """Return an error about what a command takes from its own run with the setting that names another run's."""
    reference = str(error.path)
    keys = (
        [key for key, value in flat(settings).items() if value == reference] if reference.startswith(f"{name}/") else []
    )
    other = "; grounding=servo needs gsl train-servo in place of it" if keys[:1] == [GAT] else ""
    return InputError(f"{error}; {keys[0]}=RUN takes another run's{other}") if keys else error


def _missing(value: Any, path: str) -> Iterator[str]:
    """Yield the dotted paths of the values that nobody has given."""
    if value == "???":
        yield path
    mapping = value if isinstance(value, Mapping) else dict(enumerate(value)) if isinstance(value, list | tuple) else {}
    for key, entry in mapping.items():
        yield from _missing(entry, f"{path}.{key}".lstrip("."))
