"""From raw signals to trajectories: one clock, cut at holes, kept as it is or resampled, velocities derived."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gsl.core.labels import alike
from gsl.core.other_commands import OTHER_COMMANDS
from gsl.core.series import SAME, hold, interpolate, pieces
from gsl.core.trajectory import Trajectory
from gsl.effects.effect import together
from gsl.errors import InputError, TrajectoryError
from gsl.storage.importers.labels import fill
from gsl.storage.importers.mapping import Mapping as LogMapping
from gsl.storage.importers.reading import Raw, Series
from gsl.storage.importers.signal import BESIDE, COMMANDS, FLAGS
from gsl.storage.signals.check import join_turns
from gsl.storage.signals.glitches import find_glitches, mend
from gsl.storage.trajectory_contract import LARGEST

ARRAYS = (*COMMANDS, "position", "velocity")
MOST_ROWS, FINER = 100_000, 20  # rows that any resampling may make, and for each row of a larger log
GAPS = 3  # that a line names
SENT = ("action", *OTHER_COMMANDS)  # one of them there has to be


@dataclass(frozen=True)
class Episode:
    """One trajectory of the contract and how it came about.

    Attributes:
        trajectory: In the contract's units.
        label: Its name and what else is known of it.
        joints: Names, in order.
        steps: From one row of its positions to the next, as logged [s], shape (T,).
        dropped: Rows left out: repeated stamps, and what came before the first command.
        derived: Whether its velocities are slopes of its positions.
        remarks: On what was left out of the log, and where it was cut; those of a cut log are at its first part.
    """

    trajectory: Trajectory
    label: Mapping[str, Any]
    joints: tuple[str, ...]
    steps: np.ndarray
    dropped: int
    derived: bool
    remarks: tuple[str, ...] = ()


def episodes(raw: Raw, mapping: LogMapping) -> list[Episode]:
    """Return the trajectories of a recorded episode: one, or several where it has holes.

    Raises:
        InputError: Its commands and positions do not overlap in time.
    """
    stamps, sent = raw.signals["position"].stamps, [raw.signals[name] for name in SENT if name in raw.signals]
    if not sent:
        raise InputError(f"{raw.name}: has no command, neither {' nor '.join(SENT)}")
    commands = sent[0].stamps
    if len(stamps) < 2:
        raise InputError(f"{raw.name}: has {len(stamps)} row of positions; an episode takes two at least")
    if commands[0] >= stamps[-1] or (commands[-1] < stamps[0] and len(commands) > 1):
        raise InputError(
            f"{raw.name}: commands are from {commands[0]:.6g} to {commands[-1]:.6g} s, positions from {stamps[0]:.6g} "
            f"to {stamps[-1]:.6g} s: two clocks? Say what the commands' is ahead: mapping.command_offset=..."
        )
    late = int(np.searchsorted(stamps, commands[0] - SAME))
    own = stamps[late:]
    period = float(np.median(np.diff(stamps)))
    cuts = pieces(own, mapping.longest_gap * period)
    remarks = (*raw.remarks, *_list_gaps(raw.name, own, stamps[0], period, mapping.longest_gap, len(cuts)))
    label = read_label(raw, mapping)
    lags = []
    for number, cut in enumerate(cuts):
        part = {"part": number + 1} if len(cuts) > 1 else {}
        trajectory = _mend(_trajectory(raw, own[cut], mapping), mapping)
        _check_size(raw, trajectory, own[cut][0] - stamps[0])
        dropped = raw.dropped + (late if number == 0 else 0)
        derived = "velocity" not in raw.signals
        said = remarks if number == 0 else ()
        lags.append(Episode(trajectory, {**label, **part}, raw.joints, np.diff(own[cut]), dropped, derived, said))
    if not lags:
        raise InputError(f"{raw.name}: no two rows of positions follow its first command")
    return lags


def _list_gaps(name: str, stamps: np.ndarray, start: float, period: float, longest: float, parts: int) -> Iterator[str]:
    """Tell in one line of holes longer than `longest` periods, with their times from the log's start."""
    steps = np.diff(stamps)
    if not len(gaps := np.flatnonzero(steps > longest * period)):
        return
    gaps_text = ", ".join(f"{steps[row]:.3g} s after {stamps[row] - start:.6g} s" for row in gaps[:GAPS])
    more = f" and {len(gaps) - GAPS} more" if len(gaps) > GAPS else ""
    whole = f"mapping.longest_gap={math.ceil(steps.max() / period) + 1}"
    cut = f"cut into {parts} episodes" if parts > 1 else "cut to one episode"
    yield f"{name}: has no row for {gaps_text}{more}, and is {cut}; {whole} keeps it whole"


def _trajectory(raw: Raw, stamps: np.ndarray, mapping: LogMapping) -> Trajectory:
    """Return the rows at `stamps`, or at even steps between the first and the last of them."""
    at = stamps
    if mapping.period is not None:
        count = int(min((stamps[-1] - stamps[0]) / mapping.period + 1e-6, 1e18))
        if count > MOST_ROWS and count > FINER * len(stamps):
            problem = f"would make {count:.3g} rows of {len(stamps):,}; a longer mapping.period makes fewer"
            raise InputError(f"{raw.name}: resampled to {mapping.period:g} s {problem}")
        at = stamps[0] + mapping.period * np.arange(count + 1)
    if len(at) < 2:
        raise InputError(f"{raw.name}: lasts {np.ptp(stamps):.3g} s, not even one mapping.period")
    values = {name: _at(name, series, at) for name, series in raw.signals.items()}
    time = at - at[0]
    columns = {
        column: values[name][:, index]
        for name, series in raw.signals.items()
        if name not in ARRAYS
        for index, column in enumerate(series.names)
    }
    velocity = values["velocity"] if "velocity" in values else np.gradient(values["position"], time, axis=0)
    grounded = values["grounded_action"][:-1] if "grounded_action" in values else None
    if "action" in values:
        action = values["action"][:-1]
    else:  # nothing pulls the joints towards a position
        action = np.repeat(values["position"][:1], len(at) - 1, axis=0)
        columns |= {f"kp_command.{joint}": np.zeros(len(at)) for joint in raw.joints}
    return Trajectory(time, action, values["position"], velocity, grounded, sensors=columns)


def _check_size(raw: Raw, episode: Trajectory, begin: float) -> None:
    """Refuse values that no trajectory file may hold, in the words of the log, which begins `begin` [s] earlier."""
    arrays = {name: array for name in ARRAYS if (array := getattr(episode, name)) is not None}
    for name, values in {**arrays, **episode.sensors}.items():
        if len(wrong := np.argwhere(np.abs(values) > LARGEST)):
            row, joint = wrong[0][0], "".join(f".{raw.joints[column]}" for column in wrong[0][1:])
            what = f"is {values[tuple(wrong[0])]:.3g} {begin + episode.time[row]:.6g} s after the start of {raw.name}"
            problem = f"{what}, which nothing measures ({LARGEST:g} at most); drop or mend the row"
            raise TrajectoryError(raw.file, problem, column=f"{name}{joint}")


def _mend(episode: Trajectory, mapping: LogMapping) -> Trajectory:
    """Return a trajectory without wraps and glitches, if the mapping says so."""
    if mapping.unwrap:
        (episode,) = join_turns([episode])
    if mapping.glitches == "mend" and len(find_glitches([episode], [str(k) for k in range(episode.position.shape[1])])):
        position = mend(episode.position)
        episode = replace(episode, position=position, velocity=np.gradient(position, episode.time, axis=0))
    return episode


def _at(name: str, series: Series, at: np.ndarray) -> np.ndarray:
    if name in (*COMMANDS, *BESIDE, *FLAGS):
        return hold(series.stamps, series.values, at)
    return interpolate(series.stamps, series.values, at)


def read_label(raw: Raw, mapping: LogMapping) -> dict[str, Any]:
    """Return the name of an episode's motion and what else is known of it.

    Raises:
        ConfigError: A {field} is neither in its files nor in its path.
    """
    name = fill(mapping.name, raw.fields, "mapping.name") if mapping.name else raw.name
    about = {key: fill(value, raw.fields, f"mapping.about.{key}") for key, value in mapping.about.items()}
    conditions = together(
        effects
        for label, values in mapping.conditions.items()
        for value, effects in values.items()
        if alike(value, about[label])
    )
    return {**about, "policy": str(name), "file": raw.name, **({"conditions": conditions} if conditions else {})}


def list_unmatched(episodes: Sequence[Episode], mapping: LogMapping) -> Iterator[str]:
    """Tell of conditions that no episode has: most often a value that is written otherwise."""
    for label, values in mapping.conditions.items():
        there = [episode.label[label] for episode in episodes]
        for value in values:
            if not any(alike(value, label) for label in there):
                labels = ", ".join(dict.fromkeys(map(str, there)))
                yield f"mapping.conditions.{label}.{value}: no episode has it; {label} is {labels}"
