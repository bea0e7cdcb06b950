"""What an import found in foreign logs, as a document and as tables: rates, gaps, jitter, lags, ranges, suspicions."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.other_commands import OTHER_COMMANDS
from gsl.core.series import Lag
from gsl.core.slides import unit_of_slide
from gsl.core.words import several
from gsl.storage.importers.assembly import Episode
from gsl.storage.importers.suspicions import (
    MOVES,
    STUCK,
    Suspicion,
    is_clear,
    lags_of,
    measure_saturation,
    measure_stops,
    suspicions,
)
from gsl.storage.trajectory_contract import UNITS

UNEVEN = 0.5  # of a period, by which a row may be early or late before a diagnosis refuses it
SLIDE = 0.05  # what counts as a radian of a joint that slides [m]: no robot says how far it goes
RATES = 0.1  # relative, by which episodes may differ in their rate
SHOWN = 40  # rows of a table

Document = dict[str, Any]


def report(
    episodes: Sequence[Episode],
    files: int,
    period: float | None,
    turning: Collection[str] = (),
    sliding: Collection[str] = (),
) -> Document:
    """Return what there is to say of the trajectories.

    Args:
        episodes: In order, of the same joints.
        files: How many files they come from.
        period: What they were resampled to [s], None if their rows are as they were.
        turning: Joints of which the mapping says that they are in radians however far they turn.
        sliding: Joints whose positions it has in metres.
    """
    lags = [lags_of(episode) for episode in episodes]
    doubts = suspicions(episodes, lags, turning, sliding)
    return {
        "files": files,
        "episodes": [_episode(episode, row) for episode, row in zip(episodes, lags, strict=True)],
        "channels": list(_channels(episodes, sliding)),
        "control_period": nominal(episodes, period),
        "refused": [_words(doubt) for doubt in doubts if doubt.refused],
        "warnings": [
            *(_words(doubt) for doubt in doubts if not doubt.refused),
            *_of_rates(episodes, period),
            *_stuck(episodes, sliding),
        ],
    }


def nominal(episodes: Sequence[Episode], period: float | None) -> float:
    """Return the control period of the file [s]: what was resampled to, or the median step."""
    middle = np.quantile(np.concatenate([episode.steps for episode in episodes]), 0.5, method="lower")
    return period or float(np.round(middle, 6))


def _words(doubt: Suspicion) -> str:
    return f"{doubt.column}: {doubt.problem}"


def _episode(episode: Episode, lags: Sequence[Lag]) -> Document:
    steps = episode.steps
    clear = [lag.seconds for lag in lags if is_clear(lag)]
    return {
        **episode.label,
        "rows": len(steps) + 1,
        "rows_written": len(episode.trajectory.time),
        "dropped": episode.dropped,
        "seconds": float(episode.trajectory.time[-1]),
        "rate": float(1.0 / np.median(steps)),
        "jitter": float(np.std(steps)),
        "longest_step": float(steps.max()),
        "lag": float(np.median(clear)) if clear else None,
    }


def _channels(episodes: Sequence[Episode], sliding: Collection[str] = ()) -> Iterator[Document]:
    """Return for each column its range, and whether it is constant or stuck at an end."""
    for name, parts, commands in _columns(episodes):
        values = np.concatenate(parts).astype(float)
        group = name.partition(".")[0]
        at_end = measure_stops if group == "position" else measure_saturation
        moving = [at_end(*pair) for pair in zip(parts, commands, strict=True)] if commands else []
        unit = UNITS.get(name, UNITS.get(name.rpartition(".")[0], UNITS.get(group, "")))
        yield {
            "column": name,
            "unit": unit_of_slide(unit) if name.partition(".")[2] in sliding else unit,
            "least": float(values.min()),
            "most": float(values.max()),
            "constant": bool(np.ptp(values) == 0.0),
            "saturated": float(np.average(moving, weights=[len(part) for part in parts])) if moving else 0.0,
        }


def _columns(episodes: Sequence[Episode]) -> Iterator[tuple[str, list[np.ndarray], list[np.ndarray]]]:
    """Return each column, an array an episode, and the commands of its joint beside it where it has one."""
    joints = episodes[0].joints
    for group in ("action", "position", "velocity"):
        for k, joint in enumerate(joints):
            parts = [getattr(episode.trajectory, group)[: len(episode.trajectory), k] for episode in episodes]
            yield f"{group}.{joint}", parts, _commands(episodes, k) if group == "position" else []
    for name in episodes[0].trajectory.sensors:
        parts = [
            episode.trajectory.sensors[name][: len(episode.trajectory)]
            for episode in episodes
            if name in episode.trajectory.sensors
        ]
        joint = name.rpartition(".")[2]
        commands = _commands(episodes, joints.index(joint)) if name.startswith("torque.") and joint in joints else []
        yield name, parts, commands if len(commands) == len(parts) else []


def _commands(episodes: Sequence[Episode], k: int) -> list[np.ndarray]:
    return [episode.trajectory.action[:, k] for episode in episodes]


def _stuck(episodes: Sequence[Episode], sliding: Collection[str]) -> Iterator[str]:
    for channel in _channels(episodes):
        if channel["saturated"] > STUCK:
            share = f"{100 * channel['saturated']:.0f} %"
            problem = f"at one end in {share} of the rows while its command moves: saturated, or a stop?"
            yield f"{channel['column']}: {problem}"
    for k, joint in enumerate(episodes[0].joints):
        others = [
            episode.trajectory.sensors.get(f"{group}.{joint}", 0.0) for episode in episodes for group in OTHER_COMMANDS
        ]
        least = MOVES * (SLIDE if joint in sliding else 1.0)
        if all(np.ptp(commands) < least for commands in [*_commands(episodes, k), *others]):
            yield f"action.{joint}: hardly ever changes, so that nothing can be learned of this joint"


def _of_rates(episodes: Sequence[Episode], period: float | None) -> Iterator[str]:
    usual = np.array([np.median(episode.steps) for episode in episodes])
    if period is not None:
        if period < 0.8 * usual.max():
            rows = f"rows come every {usual.max():.4g} s"
            yield f"time: resampled to {period:g} s, but {rows}: what is between is made up"
        return
    step = nominal(episodes, period)
    far = max(float(np.abs(episode.steps - step).max()) for episode in episodes)
    alike = np.ptp(usual) < RATES * step
    if far > UNEVEN * step or not alike:
        problem = f"steps differ from {step:g} s by up to {far:.3g} s" if alike else _rates(usual)
        yield f"time: {problem}; gsl diagnose wants even rows: mapping.period={step:.2g} resamples"


def _rates(usual: np.ndarray) -> str:
    return f"episodes have rates of {1.0 / usual.max():.0f} to {1.0 / usual.min():.0f} Hz"


def tables(document: Mapping[str, Any]) -> Iterator[tuple[str, tuple[str, ...], list[tuple[str, ...]], str | None]]:
    """Return title, columns, rows and caption of each table."""
    episodes, channels = document["episodes"], document["channels"]
    rows = [_row(episode) for episode in episodes[:SHOWN]]
    titles = ("episode", "name", "rows", "time [s]", "rate [Hz]", "jitter [ms]", "longest step [ms]", "lag [ms]")
    more = f"and {len(episodes) - SHOWN} more" if len(episodes) > SHOWN else None
    yield f"{several(len(episodes), 'episode')} in {several(document['files'], 'file')}", titles, rows, more
    yield "channels", ("column", "unit", "least", "most", ""), [_channel(channel) for channel in channels], None


def _row(episode: Mapping[str, Any]) -> tuple[str, ...]:
    part = f" part {episode['part']}" if "part" in episode else ""
    return (
        f"{episode['file']}{part}",
        episode["policy"] if episode["policy"] != episode["file"] else "",
        str(episode["rows"]),
        f"{episode['seconds']:.2f}",
        f"{episode['rate']:.1f}",
        f"{1e3 * episode['jitter']:.2f}",
        f"{1e3 * episode['longest_step']:.1f}",
        "-" if episode["lag"] is None else f"{1e3 * episode['lag']:.0f}",
    )


def _channel(channel: Mapping[str, Any]) -> tuple[str, ...]:
    remark = "constant" if channel["constant"] else "saturated?" if channel["saturated"] > STUCK else ""
    return channel["column"], channel["unit"], f"{channel['least']:.4g}", f"{channel['most']:.4g}", remark
