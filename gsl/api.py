"""gsl from Python: the components, stages and artifacts of the command line, as functions and objects.

    import gsl

    world = gsl.make_world("nao_worn", effects={"ground_friction": {"friction": 0.6}})
    log = gsl.roll_out(world, episodes=3)
    found = gsl.run("iterate", name="mine", preset="toy", real="nao_weak")
    verdict = gsl.diagnose("air", "nao_ideal", name="air")

Names and settings are those of the command line (`gsl COMMAND --help`), and so are the checks and their messages.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from gsl.commandline.composer import compose, configuration_folder, opened
from gsl.commandline.config import execute, instantiated, resolved
from gsl.commandline.overrides import file_of
from gsl.core.console import Silent
from gsl.core.described import described
from gsl.core.interfaces import Grounding, Policy, Task, World
from gsl.core.seeds import derived_seed
from gsl.core.trajectory import Batch
from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.policies.policy import sized
from gsl.report.account import account
from gsl.report.console import Console
from gsl.rollout.parallel import Job, trajectories
from gsl.rollout.rollout import Scenario
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.diagnosis_report import PAGE, report_of
from gsl.storage.trajectories import data_file
from gsl.storage.trajectories import read as read_file
from gsl.storage.trajectories import write as write_trajectories

__all__ = [
    "Result",
    "Verdict",
    "diagnose",
    "make_grounding",
    "make_policy",
    "make_task",
    "make_world",
    "read_trajectories",
    "roll_out",
    "run",
    "write_trajectories",
]
ROLES = {"world": "collect", "task": "collect", "policy": "collect", "grounding": "optimize"}  # a command that has each


@dataclass(frozen=True)
class Result:
    """What a stage has made; in a notebook it shows its tables.

    Attributes:
        artifact: Its folder and manifest.
    """

    artifact: Artifact

    @property
    def folder(self) -> Path:
        """Folder of the artifact."""
        return self.artifact.folder

    @property
    def metrics(self) -> Mapping[str, Any]:
        """The figures that the stage reported."""
        return self.artifact.metrics

    def _repr_html_(self) -> str:
        return "".join(
            f"<p><b>{escape(told.title)}</b></p>{_table(told.columns, told.rows)}<p>{escape(told.caption or '')}</p>"
            for told in account(self.artifact)
        )


@dataclass(frozen=True)
class Verdict(Result):
    """What a diagnosis says; in a notebook it shows its page."""

    @property
    def report(self) -> Mapping[str, Any]:
        """Everything that was found (docs/diagnose.md)."""
        return report_of(self.folder)

    @property
    def verdict(self) -> str:
        """One of `no_gap`, `causes`, `inseparable` and `unknown`."""
        return str(self.report["verdict"])

    @property
    def causes(self) -> list[str]:
        """Names of the effects that cause the gap."""
        return [one["effect"] for one in self.report["causes"]]

    @property
    def effects(self) -> Mapping[str, Any]:
        """What the simulator lacks, for `make_world(..., effects=...)`."""
        return dict(self.report["effects"])

    @property
    def summary(self) -> str:
        """The same in a sentence or two."""
        return str(self.report["summary"])

    def __str__(self) -> str:
        return f"{self.verdict}: {self.summary}"

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{escape((self.folder / PAGE).read_text(encoding="utf-8"))}" {_FRAME}></iframe>'


_FRAME = 'style="width: 100%; height: 600px; border: 0"'


def make_world(name: str, *, config_dir: Path | str | None = None, **settings: Any) -> World:
    """Return a world by the name of its yaml file.

    Args:
        name: Such as `nao_worn`; `gsl collect --help` lists them.
        config_dir: A folder of yaml files of your own.
        **settings: That differ from the file's, such as `step=0.001` or `effects={"backlash": {"width": 0.02}}`.

    Raises:
        ConfigError: There is no such file or setting, or a value is impossible.
    """
    return _made("world", name, config_dir, settings, World)


def make_task(name: str, *, config_dir: Path | str | None = None, **settings: Any) -> Task:
    """Return a task by the name of its yaml file; arguments as those of `make_world`."""
    return _made("task", name, config_dir, settings, Task)


def make_policy(name: str, *, config_dir: Path | str | None = None, **settings: Any) -> Policy:
    """Return a family of policies by the name of its yaml file; arguments as those of `make_world`."""
    return _made("policy", name, config_dir, settings, Policy)


def make_grounding(name: str, *, config_dir: Path | str | None = None, **settings: Any) -> Grounding:
    """Return a grounding by the name of its yaml file; arguments as those of `make_world`."""
    return _made("grounding", name, config_dir, settings, Grounding)


def roll_out(
    world: World,
    task: Task | None = None,
    policy: Policy | None = None,
    parameters: Sequence[float] | None = None,
    *,
    grounding: Grounding | None = None,
    episodes: int = 1,
    role: str = "sim",
    workers: int = 1,
    seed: int = 1,
) -> Batch:
    """Return trajectories of a policy in a world.

    Args:
        world: From `make_world`.
        task: By default the walk.
        policy: By default the walk engine.
        parameters: Of the policy, shape (n_parameters,); by default π0's.
        grounding: What stands between the actions and the world; by default nothing.
        episodes: How many.
        role: `sim` or `real`, the part that the world plays.
        workers: Processes; -1 for one a core.
        seed: Of all randomness.
    """
    task, family = task or make_task("walk"), sized(policy or make_policy("walk_engine"), world)
    chosen = family.initial if parameters is None else np.asarray(parameters, dtype=float)
    if chosen.shape != family.initial.shape:
        raise ConfigError("parameters", f"the policy has {len(family.initial)} of them", given=str(len(chosen)))
    scenario = Scenario(world, task, family, role, grounding or NoGrounding()).prepared()
    jobs = [Job(chosen, derived_seed(seed, "roll_out", k)) for k in range(episodes)]
    with Silent().progress(episodes, "rolling out") as progress:
        done = trajectories(scenario, jobs, workers=workers, progress=progress)
    about = {
        "robot": getattr(world, "robot", getattr(world, "env_id", "")),
        "role": role,
        "source": "gsl.roll_out",
        "seed": seed,
        "world": described(world),
        "policy": described(family),
        "episodes": [{"policy": "pi0", "parameters": chosen.tolist()} for _ in jobs],
    }
    return Batch(tuple(done), world.layout.joints, world.layout.control_period, about)


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
    commands = sorted(path.stem for path in configuration_folder().glob("*.yaml"))
    if (name := file_of(command)) not in commands:
        raise ConfigError("command", f"there is none of this name{did_you_mean(name, commands)}", given=command)
    objects = {key: value for key, value in settings.items() if is_dataclass(value)}
    plain = {key: value for key, value in settings.items() if key not in objects}
    with opened(None if config_dir is None else Path(config_dir)):
        config = resolved(compose(command, list(_overrides(plain))))
    for key, value in objects.items():
        if key not in config:
            raise ConfigError(key, f"gsl {command} has no such setting")
        config[key] = described(value)
    named = ", ".join(f"{key}={value!r}" for key, value in settings.items())
    document = execute(command, f"gsl.run({command!r}, {named})", config, Silent() if quiet else Console())
    folder = Path(document["folder"])
    made = Artifact(folder, manifest.read(folder), unchanged=document["unchanged"])
    return Verdict(made) if made.manifest.kind == "diagnose" else Result(made)


def diagnose(log: Batch | Path | str, world: World | str, *, name: str = "diagnosis", **settings: Any) -> Verdict:
    """Return where a simulator's gap to a log lies, and what causes it.

    Args:
        log: Trajectories in the air: a batch, a file, or a run of collect or import.
        world: The simulator, or its name.
        name: Of the run, below runs/.
        **settings: Of `gsl diagnose`, such as `tolerance=0.001`.
    """
    if isinstance(log, Batch):
        path = Path("runs") / name / "log.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_trajectories(path, log)
        log = path
    found = run("diagnose", real=str(log), sim=world, name=name, **settings)
    assert isinstance(found, Verdict), "a diagnosis has a verdict"
    return found


def read_trajectories(reference: Path | str) -> Batch:
    """Return the trajectories of a file, or of a run of collect or import.

    Raises:
        TrajectoryError: The file breaks the contract (docs/files.md).
        ArtifactError: There is none.
    """
    return read_file(data_file(str(reference)))


def _made(group: str, name: str, config_dir: Path | str | None, settings: Mapping[str, Any], kind: Any) -> Any:
    with opened(None if config_dir is None else Path(config_dir)):
        config = resolved(compose(ROLES[group], [f"{group}={name}", *_overrides(settings, f"{group}.")]))
    made = instantiated(config[group])
    if not isinstance(made, kind):
        raise ConfigError(group, f"is no {group}", given=name)
    return made


def _overrides(settings: Mapping[str, Any], below: str = "") -> Iterator[str]:
    """Yield settings as KEY=VALUE; a mapping is settings below its key."""
    for key, value in settings.items():
        if isinstance(value, Mapping):
            yield from _overrides(value, f"{below}{key}.")
        else:
            yield f"{below}{key}={_text(value)}"


def _text(value: Any) -> str:
    """Return a value in Hydra's grammar of overrides."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_text(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, str | Path):
        text = str(value)
        return text if text.replace("_", "").replace("/", "").isalnum() else json.dumps(text, ensure_ascii=False)
    return json.dumps(value.item() if isinstance(value, np.generic) else value)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [(columns, "th"), *((row, "td") for row in rows)]
    cells = ["".join(f"<{tag}>{escape(str(cell))}</{tag}>" for cell in line) for line, tag in lines]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in cells) + "</table>"
