"""Episodes of a real robot somewhere else: found in the answer to a request, or asked for, and the command waits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gsl.core.console import Console
from gsl.core.described import describe
from gsl.core.interfaces import Grounding, World
from gsl.errors import ArtifactError, ConfigError, Waiting
from gsl.grounding.ane import ActionNoise
from gsl.policies.programme import OpenLoopRun
from gsl.real_robot.judging import Verdict, by_distance, judge
from gsl.rollout.parallel import Job, trajectories
from gsl.rollout.rollout import Scenario
from gsl.runner.guard import Guard
from gsl.runner.request import GROUND, HELD, NAME, due, read_stored
from gsl.storage import manifest
from gsl.storage.answer_checks import check_answers
from gsl.storage.answers import Answered, answer_files, read_answers
from gsl.storage.requests import restore, seal, write_request
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.external import ExternalRobot
from gsl.worlds.fits import fitting_step

STEP = 0.002  # physics period of the forecast, nearly [s]
SHOWN = 6  # names of missing episodes
REHEARSAL = "rehearse"


class Order(NamedTuple):
    """An episode to run: the name of its policy, its parameters and its seed."""

    policy: str
    job: Job


class Errand(NamedTuple):
    """What a robot is asked.

    Attributes:
        name: Of the request's folder below that of the world, empty for that folder itself.
        about: For whom it is, in a sentence.
        until_fall: Whether no more of a policy is wanted once it has fallen.
        logs: Whether a log is needed, and not only what an episode is worth.
    """

    name: str
    about: str
    until_fall: bool
    logs: bool


def answer_parents(world: World) -> Mapping[str, Path]:
    """Return the files in which a robot has answered, by role; none of any other world."""
    if not isinstance(world, ExternalRobot) or world.requests is None:
        return {}
    base = Path(world.requests)
    folders = [path.parent for path in [base / NAME, *sorted(base.glob(f"*/{NAME}"))] if path.is_file()]
    return {f"answer.{path.relative_to(base).as_posix()}": path for folder in folders for path in answer_files(folder)}


def ask(
    scenario: Scenario, orders: Sequence[Order], errand: Errand, *, workers: int, console: Console
) -> list[Verdict | None]:
    """Return the episodes of all orders, None for those that nobody wants after a fall of their policy.

    Raises:
        Waiting: Some of them have not been run yet; the request for them has been written.
        ArtifactError: An answer does not fit.
    """
    folder, request = _folder(scenario, errand), _request(scenario, orders, errand)
    if not _write_request(folder, request):
        warnings = foresee_refusals(scenario, orders, request, workers=workers, console=console)
        write_request(folder, request, warnings)
    elif restore(folder, request):
        console.status(f"{folder.as_posix()}: parts of its runner were missing; they are written anew")
    answers = read_answers(folder, request)
    for line in check_answers(request, answers):
        console.status(f"warning: {folder.as_posix()}: {line}")
    verdicts = {
        episode["name"]: judge(scenario, answers[episode["name"]], episode["steps"])
        for episode in request["episodes"]
        if episode["name"] in answers
    }
    done = {
        name: verdict
        for name, verdict in verdicts.items()
        if verdict is not None and (verdict.trajectory or not errand.logs)
    }
    missing = [
        verdict["name"]
        for verdict in due(request, done, {name for name, episode in done.items() if episode.episode.fell})
    ]
    if missing:
        raise Waiting(_describe_errand(folder, request, missing, answers), folder, missing)
    for path in sorted({answer.path.parent for answer in answers.values()}):
        if (path / manifest.NAME).is_file() and manifest.read(path).kind == REHEARSAL:
            console.status(f"{path.as_posix()}: this is a rehearsal: no real robot has acted")
    return [done.get(episode["name"]) for episode in request["episodes"]]


def foresee_refusals(
    scenario: Scenario, orders: Sequence[Order], request: Mapping[str, Any], *, workers: int, console: Console
) -> list[str]:
    """Return, and tell, which policies ask in a nominal simulator for what the runner will refuse on the robot."""
    world = scenario.world
    assert isinstance(world, ExternalRobot)
    step = fitting_step(STEP, world.period)
    nominal = BulletWorld(robot=world.robot, effects={}, floating=world.floating, step=step, period=world.period)
    first = {order.policy: index for index, order in reversed(list(enumerate(orders)))}
    replay = Scenario(nominal, scenario.task, scenario.policy, scenario.role, scenario.grounding)
    with console.progress(len(first), "looking in simulation for targets that the robot's limits forbid") as progress:
        done = trajectories(replay, [orders[index].job for index in first.values()], workers=workers, progress=progress)
    warnings = []
    for (policy, index), trajectory in zip(first.items(), done, strict=True):
        guard = Guard(request["joints"], request["limits"], request["control_period"])
        guard.start(np.array(request["episodes"][index]["posture"]))
        sent = trajectory.action if trajectory.grounded_action is None else trajectory.grounded_action
        for time, target in zip(trajectory.time[:-1], sent, strict=True):
            if problem := guard.refusal(target, time):
                warnings.append(
                    f"{policy} asks in simulation after {time:.2f} s for what the runner refuses: {problem}"
                )
                break
            guard.take(target, time)
    for warning in warnings:
        console.status(f"warning: {warning}; an episode that is stopped counts as a fall")
    return warnings


def _folder(scenario: Scenario, errand: Errand) -> Path:
    world = scenario.world
    if not isinstance(world, ExternalRobot) or world.requests is None:
        raise ConfigError("world.requests", "a real robot needs a folder for its requests")
    return Path(world.requests) / errand.name


def _write_request(folder: Path, request: Mapping[str, Any]) -> bool:
    """Tell whether a folder holds this very request."""
    if not folder.exists() or (folder.is_dir() and not (folder / NAME).exists() and not answer_files(folder)):
        return False
    try:
        return bool(read_stored(folder)["hash"] == request["hash"])
    except ArtifactError:
        return False


def _request(scenario: Scenario, orders: Sequence[Order], errand: Errand) -> dict[str, Any]:
    world, layout = scenario.world, scenario.world.layout
    assert isinstance(world, ExternalRobot)
    wanted, so_far, episodes = Counter(order.policy for order in orders), Counter[str](), []
    for order in orders:
        so_far[order.policy] += 1
        name = f"{order.policy}_{so_far[order.policy]:02d}" if wanted[order.policy] > 1 else order.policy
        episodes.append({"name": name, **_episode(scenario, order)})
    return seal(
        {
            "about": errand.about,
            "robot": world.robot,
            "place": GROUND if world.floating else HELD,
            "joints": layout.joints,
            "control_period": layout.control_period,
            "observes": layout.sizes,
            "limits": world.limits,
            "ramp": {"seconds": world.ramp, "speed": world.ramp_speed, "within": world.within},
            "policy": describe(scenario.policy),
            "action_noise": _noise(scenario.grounding),
            "task": describe(scenario.task),
            "until_fall": errand.until_fall,
            "distance": by_distance(scenario.task, layout),
            "episodes": episodes,
        }
    )


def _episode(scenario: Scenario, order: Order) -> dict[str, Any]:
    """Return all that a runner needs of an episode; a policy that plays commands goes out as these."""
    layout, parameters = scenario.world.layout, order.job.parameters
    posture = scenario.policy.posture(parameters, layout)
    message = {"policy": order.policy, "parameters": parameters, "seed": order.job.seed, "posture": posture}
    try:
        run = scenario.policy.start(parameters, layout)
    except KeyError as error:
        problem = f"needs {error.args[0]}, which the robot does not tell; say world.sensors=[...] if it does"
        raise ConfigError("policy", problem) from error
    if isinstance(run, OpenLoopRun):
        return {**message, "steps": run.ticks, "commands": [run.act(np.zeros(0)) for _ in range(run.ticks)]}
    return {**message, "steps": scenario.ticks}


def _noise(grounding: Grounding) -> float:
    return grounding.sd if isinstance(grounding, ActionNoise) else 0.0


def _describe_errand(
    folder: Path, request: Mapping[str, Any], missing: list[str], answers: Mapping[str, Answered]
) -> str:
    """Return what a person has to do, in two lines."""
    names = ", ".join(missing[:SHOWN]) + (f" and {len(missing) - SHOWN} more" if len(missing) > SHOWN else "")
    seconds = sum(e["steps"] for e in request["episodes"] if e["name"] in missing) * request["control_period"]
    unmeasured = [name for name in missing if name in answers]
    hint = f"; {len(unmeasured)} of them only lack their distance in returns.csv" if unmeasured else ""
    return (
        f"the real robot has to act: {len(missing)} of {len(request['episodes'])} episodes are missing, "
        f"{seconds:.0f} s in all ({names}){hint}\n"
        f"run `python runner.py` of {folder.as_posix()} there (README.txt), bring its answer back into this folder, "
        "and type the same command again"
    )
