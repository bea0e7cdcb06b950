"""`gsl render`: a film of what an artifact's robot did, real and simulated beside each other."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from gsl.commandline.own_word import find_own_modules, find_trust
from gsl.commandline.rebuild import rebuild, rebuild_search
from gsl.commandline.words import split_words
from gsl.commandline.world_names import name_world
from gsl.core.body import Robot
from gsl.core.interfaces import REAL, Policy
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch, Trajectory
from gsl.core.trust import TRUST, check_code
from gsl.core.validation import did_you_mean, make
from gsl.errors import ArtifactError, ConfigError, InputError
from gsl.grounding.none import NoGrounding
from gsl.policies.policy import describe_command
from gsl.report.console import Console
from gsl.report.film import Shot, check_format, film
from gsl.report.style import GROUNDED, SIMULATION
from gsl.report.style import REAL as REAL_COLOUR
from gsl.robots.catalogue import robot as robot_of
from gsl.rollout.rollout import Scenario, play_once
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.policies import PolicyRecord
from gsl.storage.policy_choice import find_measurement, find_search, records, vector
from gsl.storage.references import RUNS, resolve, resolve_main
from gsl.storage.trajectories import data_file, read
from gsl.storage.whole import explain_refusal, replacing
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.ensemble import EnsembleWorld
from gsl.worlds.external import ExternalRobot
from gsl.worlds.randomised import RandomisedWorld

LOGS = ("collect", "import")
LOG, WALK = ("episode", "beside"), ("policy", "seed")  # settings of what is seen of either
SHOWN = (*LOGS, "evaluate", "iterate", "optimize")


@component
class Subject:
    """What is seen, beside the reference."""

    episode: Annotated[int, setting("which episode of a log, from 0", ge=0)] = 0
    policy: Annotated[str, setting("which policy of a search; empty for the one that was returned")] = ""
    beside: Annotated[str, setting("a second log, shown beside the first")] = ""
    seed: Annotated[int, setting("of the walk", ge=0)] = 1


@component
class Settings(Subject):
    """What `gsl render` takes beside the reference."""

    out: Annotated[str, setting("file to write: .gif or .mp4, or .png for a contact sheet")] = "film.gif"
    slow: Annotated[float, setting("how many times slower than real time", ge=0.1, le=100)] = 1.0


@dataclass(frozen=True)
class Cast:
    """Who is seen in a film: a robot, and what it did where."""

    robot: Robot
    joints: tuple[str, ...]
    shots: tuple[Shot, ...]


def render(reference: str, words: Sequence[str], console: Console) -> None:
    """Write a film of an artifact.

    A log is shown as it was recorded. Of `evaluate` and `iterate` the returned policy walks once more, on the real side
    if that is simulated, and in the simulator in which it was found.

    Args:
        reference: A path, or the name of a run.
        words: Settings, as they were typed.
        console: Where the file is named.

    Raises:
        ArtifactError: There is no such artifact, or it has nothing that moves.
        ConfigError: A setting is wrong.
        InputError: The robot cannot be shown.
    """
    settings = make(Settings, read_settings(words, "render"))
    path = Path(settings.out)
    check_format(path)
    with console.at_work("render"):
        cast = assemble(reference, settings, words, console)
    with explain_refusal(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary, console.at_work("drawing the film"):
        named = temporary.with_name(temporary.name + path.suffix.lower())
        film(cast.robot, cast.joints, cast.shots, named, slow=settings.slow)
        named.rename(temporary)
    console.result({"film": path, "shown": [shot.title for shot in cast.shots]}, text=path.as_posix())


def assemble(reference: str, subject: Subject, words: Sequence[str], console: Console) -> Cast:
    """Return who is seen, and what they did; arguments and errors as those of `render`."""
    trust = find_trust([word for word in words if word.startswith("trust=")])
    find_own_modules(trust)
    folder = resolve_main(reference, kind=SHOWN)
    kind = manifest.read(folder).kind
    console.status(f"{folder.as_posix()}: {kind}")
    _check_subject(kind, read_settings(words, "render"))
    cast = _play_logs(folder, subject, trust) if kind in LOGS else _walk(folder, kind, subject, trust, console)
    if not any(link.looks for link in cast.robot.links.values()):
        raise InputError(f"{cast.robot.name}: none of its links has a shape that could be shown")
    return cast


def _check_subject(kind: str, typed: Collection[str]) -> None:
    """Refuse settings of a walk for a log, and the other way round, which would do nothing."""
    others, what = (WALK, "a walk") if kind in LOGS else (LOG, "a log")
    for name in others:
        if name in typed:
            raise ConfigError(name, f"is for {what}, and this is {kind}; leave it out")


def read_settings(words: Sequence[str], command: str) -> dict[str, str]:
    """Return typed settings but `trust`, by name."""
    return {name: value for name, value in split_words(words, command).items() if name != TRUST}


def _play_logs(folder: Path, settings: Subject, trust: Sequence[str]) -> Cast:
    """Return an episode of one log, or of two."""
    first = read(data_file(str(folder)))
    name = str(first.metadata.get("robot", ""))
    check_code({"robot": name}, trust)  # the log may be somebody else's
    robot = robot_of(name)
    logs = {folder.as_posix().removeprefix(f"{RUNS}/"): first}
    if settings.beside:
        logs[settings.beside] = read(data_file(settings.beside), joints=first.joints)
    colours = (REAL_COLOUR, SIMULATION)
    shots = tuple(
        Shot(title, "", _episode(title, batch, settings.episode), colour, f"episode {settings.episode}")
        for (title, batch), colour in zip(logs.items(), colours, strict=False)
    )
    return Cast(robot, first.joints, shots)


def _episode(title: str, batch: Batch, number: int) -> Trajectory:
    if number >= len(batch):
        raise ConfigError("episode", f"{title} has {len(batch)}, counted from 0", given=str(number))
    return batch.episodes[number]


def _walk(folder: Path, kind: str, settings: Subject, trust: Sequence[str], console: Console) -> Cast:
    """Return walks of a policy that a search found: on the real side, and in the simulator of the search."""
    measured = _open(find_measurement(folder) if kind == "iterate" else folder)
    stage, config = rebuild(measured, trust)
    searched = measured if kind == "optimize" else find_search(measured.folder)
    source = measured.folder if not settings.policy else searched.folder if searched else resolve(stage.policies)
    policy = _choose(records(stage.policy, str(source)), settings.policy)
    sides = []
    if kind != "optimize" and isinstance(stage.world, ExternalRobot):
        console.status("the robot is not in this computer: the film shows the simulator alone")
    elif kind != "optimize":
        scenario = Scenario(stage.world, stage.task, stage.policy, REAL, NoGrounding()).prepare()
        sides.append(("on the real side", scenario, REAL_COLOUR, config["world"]))
    if searched:
        plain, scenario = rebuild_search(searched, trust)
        bare = isinstance(plain.grounding, NoGrounding)
        where, colour = ("in simulation", SIMULATION) if bare else ("in the grounded simulator", GROUNDED)
        sides.append((where, scenario, colour, searched.config["world"]))
    if not sides:
        raise ArtifactError(folder, "its robot is elsewhere, and its policies are of no search; render a log instead")
    robot = _robot_in(sides[0][1].world)
    parameters, seed = vector(stage.policy, policy), derive_seed(settings.seed, "film")
    shots = tuple(
        Shot(
            policy.name, where, play_once(scenario, parameters, seed), colour, _describe(world, stage.policy, settings)
        )
        for where, scenario, colour, world in sides
    )
    return Cast(robot, robot.controlled, shots)


def _describe(world: Mapping[str, Any], policy: Policy, settings: Subject) -> str:
    """Return in which world a policy walks, what it is asked to do, and the seed."""
    names = " or ".join(sorted(name_world(world)))
    return ", ".join(filter(None, [names, *describe_command(policy), f"seed {settings.seed}"]))


def _open(folder: Path) -> Artifact:
    return Artifact(folder, manifest.read(folder))


def _choose(stored: Sequence[PolicyRecord], name: str) -> PolicyRecord:
    """Return the policy of a name, the last one without."""
    by_name = {record.name: record for record in stored}
    if name and name not in by_name:
        raise ConfigError("policy", f"there is none of this name{did_you_mean(name, by_name)}", given=name)
    return by_name[name] if name else stored[-1]


def _robot_in(world: Any) -> Robot:
    inner = world.world if isinstance(world, EnsembleWorld | RandomisedWorld) else world
    if not isinstance(inner, BulletWorld):
        raise InputError("a film shows robots; this world is an environment without one")
    return inner.plant.robot
