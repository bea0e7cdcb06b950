"""Logs in files: finding them, reading several as one, and refusing what cannot be diagnosed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.interfaces import REAL
from gsl.core.other_commands import OTHER_COMMANDS, has_other_commands
from gsl.core.plant import Plant
from gsl.core.slides import unit_of_slide
from gsl.core.trajectory import Batch
from gsl.diagnosis.angles import with_log_in_angles
from gsl.diagnosis.log.log import Log, cut_log
from gsl.diagnosis.settings import LogSettings
from gsl.errors import ArtifactError, InputError, TrajectoryError
from gsl.storage.importers.formats import readable
from gsl.storage.trajectories import data_file, read, suggest_import
from gsl.storage.trajectory_contract import UNITS

CLOCKS, APART = "clocks", "unsynchronised"  # of a log's metadata, as gsl import writes them
MOVES = 1e-4  # a command that changes less is constant [rad]
LATE = 0.5  # of a control period, by which a row may come early or late
FASTER, SLOW = 10.0, 0.05  # times the slope of the positions that velocities may be; slopes below are noise [rad/s]
BEYOND = 0.35  # [rad], or `Joint.size`s, past a joint's limits: more is another unit or another robot


def log_files(reference: str) -> list[Path]:
    """Return the trajectory files that a run, a file or a folder of parquet files stands for.

    Raises:
        InputError: if there are none.
    """
    folder = Path(reference)
    if folder.is_dir() and not (folder / "manifest.json").exists():
        files = sorted(folder.glob("*.parquet"))
        if files:
            return files
    try:
        return [data_file(reference, REAL)]
    except ArtifactError as error:
        if folder.is_dir() and any(readable(path) for path in folder.iterdir()):
            problem = f"holds no trajectory file; make one of its logs first: {suggest_import(folder)}"
            raise InputError(f"{folder}: {problem}") from error
        raise


def log_parents(**references: str | None) -> dict[str, Path]:
    """Return the files that references stand for, by role and, where one stands for several, number."""
    return {
        role if len(files) == 1 else f"{role}.{k}": path
        for role, reference in references.items()
        if reference
        for files in [log_files(reference)]
        for k, path in enumerate(files)
    }


def read_logs(reference: str) -> Batch:
    """Return the trajectories of all files as one batch.

    Raises:
        TrajectoryError: if a file breaks the contract, or is of another robot or rate than the first.
    """
    files = log_files(reference)
    batches = [read(path) for path in files]
    first = batches[0]
    for path, other in zip(files[1:], batches[1:], strict=True):
        if other.joints != first.joints or abs(other.control_period - first.control_period) > 1e-9:
            raise TrajectoryError(path, f"has other joints or another control period than {files[0].name}")
    apart = any(batch.metadata.get(CLOCKS) == APART for batch in batches)
    clocks = {CLOCKS: APART} if apart else {}
    labels = [label for batch in batches for label in (batch.metadata.get("episodes") or [{}] * len(batch))]
    episodes = tuple(episode for batch in batches for episode in batch.episodes)
    return replace(first, episodes=episodes, metadata={**first.metadata, **clocks, "episodes": labels})


def take_motions(
    batch: Batch, plant: Plant, reference: str, held_out: Mapping[str, Any] | None = None
) -> tuple[Log, Plant]:
    """Return logs of a robot in the air, of which a part is held out, and its plant, both with slides in angles.

    Args:
        batch: The logs.
        plant: Of their robot.
        reference: What a user calls the logs.
        held_out: Labels of the trajectories that are for checking; every second motion by default.

    Raises:
        InputError: They cannot be replayed, the robot stood on the ground, or they are too few.
    """
    check_log(batch, lump(plant.robot), reference)
    if on_ground(batch):
        raise InputError(f"{reference}: needs the robot in the air; see `gsl collect task=excite`")
    batch, plant = with_log_in_angles(batch, plant)
    log = cut_log(batch, lump(plant.robot), held_out=held_out or {})
    if not len(log.train) or not len(log.held_out):
        raise InputError(f"{reference}: too little to fit and to check: two motions of some seconds are the least")
    return log, plant


def share_clock(batch: Batch, asked: str | None) -> bool:
    """Whether a log's commands and measurements share a clock: as asked, else as it says, else they do."""
    return (asked or batch.metadata.get(CLOCKS)) != APART


def clock_caveat(batch: Batch, asked: str | None) -> str | None:
    """Return a caveat if the log says of its clocks what was not asked for."""
    said = batch.metadata.get(CLOCKS)
    if not asked or said in (None, asked):
        return None
    return f"The log says that its clocks are {said}; clocks={asked} was asked for and counts."


def on_ground(batch: Batch) -> bool:
    """Whether the robot stands or walks on the ground in a log: its feet carry load in a good part of an episode."""
    return any(_carries_load(episode.sensors) for episode in batch.episodes)


def _carries_load(sensors: Mapping[str, np.ndarray] | None) -> bool:
    forces = [values for key, values in (sensors or {}).items() if key.startswith("foot_force")]
    return bool(forces) and float(np.mean(np.sum(forces, axis=0) > 1.0)) > 0.2


def check_log(batch: Batch, robot: Robot, name: str) -> None:
    """Refuse a log that cannot be diagnosed.

    Raises:
        InputError: with what is wrong and what to do.
    """
    check_joints(batch, robot, name)
    _check_time(batch, name)
    longest = max(len(episode) for episode in batch.episodes) * batch.control_period
    least = LogSettings().warm_up + LogSettings().scored
    if longest < least:
        raise InputError(f"{name}: too short, its longest trajectory lasts {longest:.2g} s; {least:g} s are needed")
    still = all(np.ptp(episode.action, axis=0).max() < MOVES for episode in batch.episodes)
    if still and not has_other_commands(batch):
        raise InputError(
            f"{name}: no command ever changes, so nothing shows; play a motion, see `gsl collect task=excite`"
        )
    _check_units(batch, robot, name)
    _check_beside(batch, robot, name)
    _check_velocities(batch, robot, name)


def check_joints(batch: Batch, robot: Robot, name: str) -> None:
    """Refuse a log of another robot, or of a walk that lacks its base.

    Raises:
        InputError: with what is wrong and what to do.
    """
    if set(batch.joints) != set(robot.controlled):
        missing = [joint for joint in robot.controlled if joint not in batch.joints]
        other = [joint for joint in batch.joints if joint not in robot.controlled]
        what = f"lacks {missing[0]}" if missing else f"has {other[0]}, which the {robot.name} has not"
        hold = ", or hold the joint in a robot file (docs/howto/own-robot.md)" if missing else ""
        raise InputError(f"{name}: a log of another robot? It {what}; choose the simulator with sim={hold}")
    needed = ("base.position.x", "base.orientation.w")
    if on_ground(batch) and not all(column in episode.sensors for episode in batch.episodes for column in needed):
        raise InputError(
            f"{name}: a walk needs base.position and base.orientation columns; or log the robot in the air"
        )


def _check_time(batch: Batch, name: str) -> None:
    """Refuse a log whose rows are not a control period apart: replays would take a hole for a lag."""
    for number, episode in enumerate(batch.episodes):
        steps = np.diff(episode.time)
        far = np.abs(steps - batch.control_period)
        if len(far) and far.max() > LATE * batch.control_period:
            row = int(np.argmax(far))
            raise InputError(
                f"{name}: episode {number}, step {row}: {steps[row]:.4g} s to the next row, but a control period is "
                f"{batch.control_period:g} s; cut the log at its holes, or resample it"
            )


def _check_velocities(batch: Batch, robot: Robot, name: str) -> None:
    """Refuse velocities that are many times the slope of the positions: they are in another unit."""
    for k, joint in enumerate(batch.joints):
        slopes = [np.gradient(episode.position[:, k], batch.control_period) for episode in batch.episodes]
        logged = [episode.velocity[:, k] for episode in batch.episodes]
        size, own = (float(np.sqrt(np.mean(np.concatenate(speeds) ** 2))) for speeds in (slopes, logged))
        slow, slides = SLOW * robot.joint(joint).size, robot.joint(joint).slides
        if own > FASTER * max(size, slow):
            units = "m/s, are these millimetres?" if slides else "rad/s, are these degrees?"
            raise InputError(
                f"{name}: velocity.{joint} is {own / max(size, slow):.3g} times the slope of position.{joint}; "
                f"velocities are in {units}"
            )


def _check_beside(batch: Batch, robot: Robot, name: str) -> None:
    """Refuse desired speeds and feed-forward torques far beyond what the joints can do."""
    for group, limit in zip(OTHER_COMMANDS, ("max_velocity", "effort"), strict=True):
        for joint in batch.joints:
            columns = [
                episode.sensors[key][:-1]
                for episode in batch.episodes
                if (key := f"{group}.{joint}") in episode.sensors
            ]
            reach, most = max((float(np.abs(values).max()) for values in columns), default=0.0), robot.joint(joint)
            if reach > FASTER * getattr(most, limit):
                unit = unit_of_slide(UNITS[group]) if most.slides else UNITS[group]
                problem = f"{group}.{joint} reaches {reach:.4g}, the joint's limit is {getattr(most, limit):.3g}"
                hint = "another unit? A value that stands for none? Leave that signal out of the mapping"
                raise InputError(f"{name}: {problem} {unit}; {hint}")


def _check_units(batch: Batch, robot: Robot, name: str) -> None:
    """Refuse angles far beyond the joints' limits; the message names the joint that is farthest out."""
    reaches = []
    for k, joint in enumerate(batch.joints):
        limits = robot.joint(joint)
        for what in ("action", "position"):
            values = np.concatenate([getattr(episode, what)[:, k] for episode in batch.episodes])
            below, above = limits.lower - values.min(), values.max() - limits.upper
            far = float(values.min() if below > above else values.max())
            reaches.append((float(max(below, above)) / limits.size, f"{what}.{joint}", far, limits))
    beyond, column, far, limits = max(reaches, key=lambda reach: reach[0])
    if beyond > BEYOND:
        other = "are these millimetres?" if limits.slides else "are these degrees?"
        hint = other if abs(far) > 2.0 * np.pi * limits.size else "is the zero or the sign another?"
        bounds = f"[{limits.lower:.2f}, {limits.upper:.2f}] {'m' if limits.slides else 'rad'}"
        raise InputError(f"{name}: {column} reaches {far:.3g}, beyond the joint's limits {bounds}; {hint}")
