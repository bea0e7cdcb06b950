"""Whether a log can be that of what was asked for: as an import looks at a log, and against the commands asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.observation import observations
from gsl.core.trajectory import Trajectory
from gsl.errors import ArtifactError, InputError, TrajectoryError
from gsl.runner.acting import Actor
from gsl.runner.following import FAR, LAG, STILL, WHILE
from gsl.runner.request import layout_of
from gsl.storage.answers import HUGE, Answered
from gsl.storage.importers.assembly import Episode
from gsl.storage.importers.suspicions import lags_of, suspicions

OUTSIDE = 0.5  # of its range that a joint may be found, as when the robot falls on it [rad]
FROZEN = 0.5 * STILL  # of `within`: less than the runner lets pass, for its second is not to the row
OFF = 0.05  # by which an action may differ from what the policy does on what was observed [rad]
SELDOM = 0.05  # share of the rows in which the runner's own actions may be off: where a policy has a threshold
COPIED = 1e-5  # by which positions of two runs differ at least [rad]: an encoder's step is larger, and rounds less
AGAINST = -0.5  # correlation of velocities and slopes below which a log is played backwards
SLOW = 0.05  # slopes below are noise [rad/s]
ON_THE_GRID = 1e-9  # of the stamps of a clock that is simulated [s]


def check_answers(request: Mapping[str, Any], answers: Mapping[str, Answered], where: Path | None = None) -> list[str]:
    """Return what looks wrong in the logs of an answer, and refuse what cannot be one.

    The runner's own logs (CSV) have passed the runner's checks, so that what it would have stopped is refused. What
    something else has logged may follow less closely.

    Args:
        request: What was asked for.
        answers: What is known of its episodes, by name.
        where: Where the logs are from, as a person knows them; the files that were read by default.

    Raises:
        TrajectoryError: A number that nothing measures, or a position outside of a joint's range.
        ArtifactError: One log for two episodes, or the runner's log of something else.
    """
    logs = {name: answer for name, answer in answers.items() if answer.trajectory is not None}
    warnings = []
    for episode in request["episodes"]:
        if (answer := logs.get(episode["name"])) is None or answer.trajectory is None:
            continue
        path, name = where or answer.path, episode["name"]
        _check_possible(path, name, answer.trajectory, request)
        own = where is None and answer.path.suffix == ".csv"
        for problem in _problems(path, episode, answer, request, own=own):
            if own:
                advice = "run it again, or take it in with gsl answer, which only warns"
                raise ArtifactError(path, f"{name}: {problem}; {advice}")
            warnings.append(f"{name}: {problem}")
    warnings += [*_same(request, logs, where), *_find_backwards(logs)]
    return [*warnings, *_suspicions(request, logs)]


def _check_possible(path: Path, name: str, log: Trajectory, request: Mapping[str, Any]) -> None:
    joints, limits = request["joints"], request["limits"]
    parts = {f"{part}.{joint}": getattr(log, part)[:, index] for part in ("action", "position", "velocity")
             for index, joint in enumerate(joints)}  # fmt: skip
    for column, values in {**parts, **log.sensors}.items():
        if values.dtype.kind == "f" and (wrong := np.abs(values) > HUGE).any():
            row = int(np.argmax(wrong))
            problem = f"{name}: is {values[row]:.4g}, which nothing measures; run it again"
            raise TrajectoryError(path, problem, column=column, row=row)
    for index, joint in enumerate(joints):
        lower, upper = limits["lower"][index], limits["upper"][index]
        outside = np.maximum(lower - log.position[:, index], log.position[:, index] - upper)
        if (outside > OUTSIDE).any():
            row = int(np.argmax(outside > OUTSIDE))
            place = f"{name}: is at {log.position[row, index]:.4g} rad, but goes from {lower:.4g} to {upper:.4g} rad"
            problem = f"{place}: is it in degrees, or of another joint?"
            raise TrajectoryError(path, problem, column=f"position.{joint}", row=row)


def _problems(
    path: Path, episode: Mapping[str, Any], answer: Answered, request: Mapping[str, Any], *, own: bool
) -> Iterator[str]:
    """Yield what a log has that an episode which went well cannot have."""
    log = answer.trajectory
    assert log is not None
    off = actions_off(path, request, episode, log)
    if own and (share := float(np.mean(off > OFF))) > SELDOM:
        yield f"{100.0 * share:.0f} % of its actions are up to {off.max():.2g} rad off what was asked for"
    elif (half := float(np.median(off))) > OFF:
        problem = f"half of its actions are {half:.2g} rad or more off what the policy does on what was observed"
        yield f"{problem}; is it the log of another episode, or late?"
    if not (answer.fell or answer.stopped):
        yield from _find_lost(log, request)


def actions_off(path: Path, request: Mapping[str, Any], asked: Mapping[str, Any], log: Trajectory) -> np.ndarray:
    """Return by how much each row's action differs from what was asked for, on what was observed [rad], shape (T,).

    Raises:
        InputError: A part of the observation is missing, or the actions are of another number of joints.
    """
    try:
        seen = observations(log, layout_of(request))
    except KeyError as error:
        raise TrajectoryError(path, "is missing, but was asked for", column=str(error.args[0])) from error
    actor = Actor(request, asked)
    wanted, sent = np.array([actor.act(observation) for observation in seen[:-1]]).transpose(1, 0, 2)
    if wanted.shape != log.action.shape:
        raise InputError(f"{path}: {asked['name']}: its actions are of another number of joints")
    off = np.abs(wanted - log.action).max(axis=1)
    if log.grounded_action is not None:
        off = np.maximum(off, np.abs(sent - log.grounded_action).max(axis=1))
    return np.asarray(off)


def _find_lost(log: Trajectory, request: Mapping[str, Any]) -> Iterator[str]:
    """Yield joints that stand still or are far off while they are sent elsewhere, as the runner's watch has it."""
    sent = log.action if log.grounded_action is None else log.grounded_action
    period, within = request["control_period"], request["ramp"]["within"]
    late, whole = (max(1, round(seconds / period)) for seconds in (LAG, WHILE))
    position = log.position[:-1]
    if len(sent) > whole:
        still = np.ptp(_windows(position, whole), axis=-1) < FROZEN * within
        asked = np.ptp(_windows(sent, whole)[..., : whole - late], axis=-1)
        if (wrong := still & (asked > within)).any():
            row, joint = np.argwhere(wrong)[0]
            place = f"position.{request['joints'][joint]} stands still from row {row} on for {WHILE:g} s"
            yield f"{place}, though it was sent {asked[row, joint]:.2g} rad away"
    if len(sent) > late + 1:
        recent, far = _windows(sent, late + 1), 2.0 * max(FAR, 2.0 * within)
        off = np.maximum(recent.min(axis=-1) - position[late:], position[late:] - recent.max(axis=-1))
        if (off > far).any():
            row, joint = np.argwhere(off > far)[0]
            place = f"position.{request['joints'][joint]}, row {row + late}: is {off[row, joint]:.3g} rad off"
            yield f"{place} all that it was sent in {LAG:g} s"


def _windows(values: np.ndarray, rows: int) -> np.ndarray:
    """Return all runs of so many rows, shape (T - rows + 1, n_joints, rows)."""
    return np.lib.stride_tricks.sliding_window_view(values, rows, axis=0)


def _same(request: Mapping[str, Any], logs: Mapping[str, Answered], where: Path | None) -> Iterator[str]:
    """Refuse one log for two episodes; yield those that only a simulation without noise can have alike."""
    asked = {episode["name"]: episode for episode in request["episodes"]}
    for (name, first), (other, second) in combinations(logs.items(), 2):
        a, b = first.trajectory, second.trajectory
        assert a is not None and b is not None
        rows = min(len(a.position), len(b.position))
        whole = len(a.position) == len(b.position)
        moved = rows * request["control_period"] > 0.5 * WHILE and np.ptp(a.position[:rows], axis=0).max() > OFF
        if not (whole or moved) or np.abs(a.position[:rows] - b.position[:rows]).max() > COPIED:
            continue
        problem = f"{name} and {other} have the same log, to {COPIED:g} rad"
        if (
            np.array_equal(a.time[:rows], b.time[:rows])
            and _is_simulated(a.time, request)
            and _job(asked[name]) == _job(asked[other])
        ):
            yield f"{problem}: is it of a simulation without noise?"
            continue
        raise ArtifactError(where or second.path, f"{problem}; each of them has to be run")


def _find_backwards(logs: Mapping[str, Answered]) -> Iterator[str]:
    """Yield logs whose positions go one way and whose velocities go the other."""
    for name, answer in logs.items():
        if (log := answer.trajectory) is None or len(log.time) < 2:
            continue
        slopes = np.gradient(log.position, log.time, axis=0)
        sizes = float(np.sqrt(np.mean(slopes**2))), float(np.sqrt(np.mean(log.velocity**2)))
        if min(sizes) > SLOW and float(np.mean(slopes * log.velocity)) < AGAINST * sizes[0] * sizes[1]:
            yield f"{name}: its velocities go against its positions; is it turned round in time?"


def _is_simulated(time: np.ndarray, request: Mapping[str, Any]) -> bool:
    """Whether stamps are of a clock that is never late."""
    return bool(np.abs(time - request["control_period"] * np.arange(len(time))).max() < ON_THE_GRID)


def _job(episode: Mapping[str, Any]) -> tuple[Any, ...]:
    return episode["policy"], episode["parameters"], episode.get("commands"), episode["posture"]


def _suspicions(request: Mapping[str, Any], logs: Mapping[str, Answered]) -> list[str]:
    """Return what an import would say of the logs."""
    joints = tuple(request["joints"])
    episodes = [
        Episode(log, {}, joints, np.diff(log.time), 0, derived=False)
        for answer in logs.values()
        if (log := answer.trajectory) is not None
    ]
    if not episodes:
        return []
    lags = [lags_of(episode) for episode in episodes]
    return [f"{suspicion.column}: {suspicion.problem}" for suspicion in suspicions(episodes, lags)]
