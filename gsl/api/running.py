"""Stages from keyword arguments, and the diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf

from gsl.api.files import write_trajectories
from gsl.api.overrides import overrides
from gsl.api.results import Result, Verdict
from gsl.commandline.composer import commands, compose
from gsl.commandline.config import CommandSettings, execute, resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.commandline.overrides import file_of
from gsl.commandline.own_effects import load_own_effects
from gsl.commandline.own_word import find_trust
from gsl.core.console import Silent
from gsl.core.described import describe
from gsl.core.interfaces import World
from gsl.core.trajectory import Batch
from gsl.core.trust import modules_in
from gsl.core.validation import did_you_mean, make
from gsl.effects.effect import add_own, keep_own
from gsl.errors import ConfigError
from gsl.report.console import Console
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.hashing import file_hash


@keep_own()
def run(command: str, *, config_dir: Path | str | None = None, quiet: bool = True, **settings: Any) -> Result:
    """Run a stage and return what it has made; what is there already and unchanged is not made again.

    Args:
        command: Such as `collect` or `train-forward`; `gsl --help` lists them.
        config_dir: A folder of yaml files of your own.
        quiet: Whether progress and tables are not shown.
        **settings: As KEY=VALUE on the command line: `world="nao_worn"`, `name="mine"`, `task={"duration": 2.0}`, or
            `**{"task.duration": 2.0}`. A component, such as a world of `make_world`, goes as it is.

    Raises:
        InputError: A setting or a file is wrong.
        GslError: The stage failed.
    """
    command = str(command)
    if (name := file_of(command)) not in commands():
        raise ConfigError("command", f"there is none of this name{did_you_mean(name, commands())}", given=command)
    described = {key: describe(value) for key, value in settings.items() if _is_component(value)}
    plain = {key: value for key, value in settings.items() if key not in described}
    for key in plain:
        if (whole := key.partition(".")[0]) in described:
            raise ConfigError(key, f"is below {whole}, which goes as it is; set it there")
    folder, arguments = None if config_dir is None else Path(config_dir), list(overrides(plain))
    with open_hydra(folder):
        load_own_effects(folder, find_trust(arguments))
        for key in described:
            add_own(getattr(settings[key], "own_effects", {}))
        composition = compose(command, arguments)
        _refer(composition.config, described)
        config = resolve(composition)
    trust = [*composition.trust]
    for key, component in described.items():
        if key not in config:
            raise ConfigError(key, f"gsl {command} has no such setting")
        config[key] = component
        trust += modules_in({key: config[key]})  # of a class that is in the user's hands already
    named = ", ".join(f"{key}={value!r}" for key, value in settings.items())
    document = execute(command, f"gsl.run({command!r}, {named})", config, Silent() if quiet else Console(), trust=trust)
    place = Path(document["folder"]).absolute()
    made = Artifact(place, manifest.read(place), unchanged=document["unchanged"])
    return (Verdict if made.manifest.kind == "diagnose" else Result)(made, tuple(trust))


def _is_component(value: Any) -> bool:
    return is_dataclass(value) and not isinstance(value, type)


def _refer(config: DictConfig, components: Mapping[str, Mapping[str, Any]]) -> None:
    """Let what refers to settings see those of components: the robot of an excitation is the world's."""
    written = cast(dict[str, Any], OmegaConf.to_container(config, resolve=False))
    for key, component in components.items():
        settings = written.get(key)
        for name in settings.keys() & component.keys() - {"_target_"} if isinstance(settings, dict) else ():
            if isinstance(component[name], str | int | float | bool) and "${" not in str(component[name]):
                config[key][name] = component[name]


def diagnose(log: Batch | Path | str, world: World | str, *, name: str = "diagnosis", **settings: Any) -> Verdict:
    """Return where a simulator's gap to a log lies, and what causes it.

    Args:
        log: Trajectories in the air: a batch, a file, or a run of collect or import.
        world: The simulator, or its name.
        name: Of the run, below runs/.
        **settings: Of `gsl diagnose`, such as `tolerance=0.001`.
    """
    make(CommandSettings, {"name": name})
    if isinstance(log, Batch):
        with TemporaryDirectory() as place:
            written = Path(place) / "log.parquet"
            write_trajectories(written, log)
            path = Path("runs") / name / f"log_{file_hash(written)[:12]}.parquet"  # another log, another file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(written.read_bytes())
        log = path
    verdict = run("diagnose", real=str(log), sim=world, name=name, **settings)
    assert isinstance(verdict, Verdict), "a diagnosis has a verdict"
    return verdict
