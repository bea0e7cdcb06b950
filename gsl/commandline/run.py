"""One command, or the jobs of a multirun: from its overrides to an exit code."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from gsl.commandline.composer import compose
from gsl.commandline.config import execute, prepare, resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.commandline.known_settings import REFERRED
from gsl.commandline.multirun import run_jobs
from gsl.commandline.own_effects import load_own_effects
from gsl.commandline.own_word import find_misspelt, find_trust
from gsl.core.trust import TRUST
from gsl.report.console import Console, divert_prints


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
    with open_hydra(config_dir):
        with console.at_work(f"reading the settings of {command}"):
            for reason in load_own_effects(config_dir, find_trust(overrides)):
                console.status(f"left out: {reason}")
            for module in find_misspelt(overrides):
                console.status(f"warning: {TRUST}={module} is no module of this folder, nor of an installed package")
            composition = compose(command, overrides, multirun=multirun)
        if cfg:
            settings = resolve(composition)
            console.result(settings, text=OmegaConf.to_yaml(OmegaConf.create(_in_order(settings))))
            return 0
        if multirun:
            prepare(resolve(composition), composition.trust)
            return run_jobs(command, line, composition, console)
        settings = resolve(composition)
    with divert_prints(json):
        document = execute(command, line, settings, console, trust=composition.trust)
    console.result(document, text=summarise(document))
    return int(document.get("exit_code", 0))


def _in_order(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings as a person reads them: the command's own, its components, then groups to which these refer."""
    ranks = {key: (f"{key}." in REFERRED, isinstance(value, Mapping)) for key, value in settings.items()}
    return {key: settings[key] for key in sorted(settings, key=ranks.__getitem__)}


def summarise(document: Mapping[str, Any]) -> str:
    """Return the last line of a command: where its results are, or what it said without writing any."""
    if "said" in document:
        return str(document["said"])
    return f"{document['folder']}{' (unchanged)' if document['unchanged'] else ''}"
