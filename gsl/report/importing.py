"""What an import found in foreign logs, as a document and as tables: rates, gaps, jitter, lags, ranges, suspicions."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.other_commands import OTHER_COMMANDS
from gsl.core.series import Lag
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
RATES = 0.1  # relative, by which episodes may differ in their rate
SHOWN = 40  # rows of a table

Document = dict[str, Any]


def report(found: Sequence[Episode], files: int, period: float | None, turning: Collection[str] = ()) -> Document:
    """Return what there is to say of the trajectories.

    Args:
        found: In order, of the same joints.
        files: How many files they come from.
        period: What they were resampled to [s], None if their rows are as they were.
        turning: Joints of which the mapping says that they are in radians however far they turn.
    """
    lags = [lags_of(one) for one in found]
    told = suspicions(found, lags, turning)
    return {
        "files": files,
        "episodes": [_episode(one, row) for one, row in zip(found, lags, strict=True)],
        "channels": list(_channels(found)),
        "control_period": nominal(found, period),
        "refused": [_words(one) for one in told if one.refused],
        "warnings": [*(_words(one) for one in told if not one.refused), *_of_rates(found, period), *_stuck(found)],
    }


def nominal(found: Sequence[Episode], period: float | None) -> float:
    """Return the control period of the file [s]: what was resampled to, or the median step."""
    middle = np.quantile(np.concatenate([one.steps for one in found]), 0.5, method="lower")
    return period or float(np.round(middle, 6))


def _words(one: Suspicion) -> str:
    return f"{one.column}: {one.problem}"


def _episode(one: Episode, lags: Sequence[Lag]) -> Document:
    steps = one.steps
    clear = [lag.seconds for lag in lags if is_clear(lag)]
    return {
        **one.label,
        "rows": len(steps) + 1,
        "rows_written": len(one.trajectory.time),
        "dropped": one.dropped,
        "seconds": float(one.trajectory.time[-1]),
        "rate": float(1.0 / np.median(steps)),
        "jitter": float(np.std(steps)),
        "longest_step": float(steps.max()),
        "lag": float(np.median(clear)) if clear else None,
    }


def _channels(found: Sequence[Episode]) -> Iterator[Document]:
    """Return for each column its range, and whether it is constant or stuck at an end."""
    for name, parts, commands in _columns(found):
        values = np.concatenate(parts).astype(float)
        group = name.partition(".")[0]
        at_end = measure_stops if group == "position" else measure_saturation
        moving = [at_end(*pair) for pair in zip(parts, commands, strict=True)] if commands else []
        yield {
            "column": name,
            "unit": UNITS.get(name, UNITS.get(name.rpartition(".")[0], UNITS.get(group, ""))),
            "least": float(values.min()),
            "most": float(values.max()),
            "constant": bool(np.ptp(values) == 0.0),
            "saturated": float(np.average(moving, weights=[len(part) for part in parts])) if moving else 0.0,
        }


def _columns(found: Sequence[Episode]) -> Iterator[tuple[str, list[np.ndarray], list[np.ndarray]]]:
    """Return each column, an array an episode, and the commands of its joint beside it where it has one."""
    joints = found[0].joints
    for group in ("action", "position", "velocity"):
        for k, joint in enumerate(joints):
            parts = [getattr(one.trajectory, group)[: len(one.trajectory), k] for one in found]
            yield f"{group}.{joint}", parts, _commands(found, k) if group == "position" else []
    for name in found[0].trajectory.sensors:
        parts = [one.trajectory.sensors[name][: len(one.trajectory)] for one in found if name in one.trajectory.sensors]
        joint = name.rpartition(".")[2]
        commands = _commands(found, joints.index(joint)) if name.startswith("torque.") and joint in joints else []
        yield name, parts, commands if len(commands) == len(parts) else []


def _commands(found: Sequence[Episode], k: int) -> list[np.ndarray]:
    return [one.trajectory.action[:, k] for one in found]


def _stuck(found: Sequence[Episode]) -> Iterator[str]:
    for channel in _channels(found):
        if channel["saturated"] > STUCK:
            share = f"{100 * channel['saturated']:.0f} %"
            told = f"at one end in {share} of the rows while its command moves: saturated, or a stop?"
            yield f"{channel['column']}: {told}"
    for k, joint in enumerate(found[0].joints):
        others = [one.trajectory.sensors.get(f"{group}.{joint}", 0.0) for one in found for group in OTHER_COMMANDS]
        if all(np.ptp(one) < MOVES for one in [*_commands(found, k), *others]):
            yield f"action.{joint}: hardly ever changes, so that nothing can be learned of this joint"


def _of_rates(found: Sequence[Episode], period: float | None) -> Iterator[str]:
    usual = np.array([np.median(one.steps) for one in found])
    if period is not None:
        if period < 0.8 * usual.max():
            rows = f"rows come every {usual.max():.4g} s"
            yield f"time: resampled to {period:g} s, but {rows}: what is between is made up"
        return
    step = nominal(found, period)
    far = max(float(np.abs(one.steps - step).max()) for one in found)
    alike = np.ptp(usual) < RATES * step
    if far > UNEVEN * step or not alike:
        told = f"steps differ from {step:g} s by up to {far:.3g} s" if alike else _rates(usual)
        yield f"time: {told}; gsl diagnose wants even rows: mapping.period={step:.2g} resamples"


def _rates(usual: np.ndarray) -> str:
    return f"episodes have rates of {1.0 / usual.max():.0f} to {1.0 / usual.min():.0f} Hz"


def tables(told: Mapping[str, Any]) -> Iterator[tuple[str, tuple[str, ...], list[tuple[str, ...]], str | None]]:
    """Return title, columns, rows and caption of each table."""
    episodes, channels = told["episodes"], told["channels"]
    rows = [_row(one) for one in episodes[:SHOWN]]
    titles = ("episode", "name", "rows", "time [s]", "rate [Hz]", "jitter [ms]", "longest step [ms]", "lag [ms]")
    more = f"and {len(episodes) - SHOWN} more" if len(episodes) > SHOWN else None
    yield f"{len(episodes)} episodes in {told['files']} files", titles, rows, more
    yield "channels", ("column", "unit", "least", "most", ""), [_channel(one) for one in channels], None


def _row(one: Mapping[str, Any]) -> tuple[str, ...]:
    part = f" part {one['part']}" if "part" in one else ""
    return (
        f"{one['file']}{part}",
        one["policy"] if one["policy"] != one["file"] else "",
        str(one["rows"]),
        f"{one['seconds']:.2f}",
        f"{one['rate']:.1f}",
        f"{1e3 * one['jitter']:.2f}",
        f"{1e3 * one['longest_step']:.1f}",
        "-" if one["lag"] is None else f"{1e3 * one['lag']:.0f}",
    )


def _channel(one: Mapping[str, Any]) -> tuple[str, ...]:
    remark = "constant" if one["constant"] else "saturated?" if one["saturated"] > STUCK else ""
    return one["column"], one["unit"], f"{one['least']:.4g}", f"{one['most']:.4g}", remark
