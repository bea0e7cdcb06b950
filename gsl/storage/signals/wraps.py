"""Angles that wrap: they jump by a turn, or by the range of their encoder, while the joint goes on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from gsl.core.trajectory import Trajectory
from gsl.storage.signals.finding import Finding, Place, count, per_joint

TURN = 2.0 * np.pi
NEARLY = 0.15  # share of a turn by which a jump may be off: the joint goes on meanwhile
END_TO_END = 0.8  # share of a channel's range that a jump from one end to the other takes
CLEAR = 4.0  # times the longest other step of the channel
LEAST = 1.0  # range of a channel below which no encoder wraps [rad]
OWN = 0.5  # share of a jump that its command may move around it: more is a jump that was asked for
AROUND = 3  # rows before a jump in which its command may have asked for it


def find_wraps(
    episodes: Sequence[Trajectory], joints: Sequence[str], levers: Mapping[str, float] = MappingProxyType({})
) -> list[Finding]:
    """Return the positions and commands that wrap; `levers` are the metres in a unit of the joints that slide."""
    findings = []
    for signal in ("position", "action"):
        places = [place for place, _ in _wraps(episodes, signal)]
        turns = {place.joint: turn for place, turn in _wraps(episodes, signal)}
        for finding in per_joint("wrap", signal, places, joints, "", "mapping.unwrap=true joins the turns"):
            size = turns[joints.index(finding.joints[0])]
            way = levers.get(finding.joints[0])
            range_text = f"its range ({size:.3g} rad)" if way is None else f"its range ({size * way:.3g} m)"
            by = "a turn" if way is None and abs(size - TURN) < 1e-9 else range_text
            what = "angle" if way is None else "position"
            findings.append(finding._replace(problem=f"jumps by {by}, {count(finding.times)}: the {what} wraps"))
    return findings


def join(values: np.ndarray, turn: float) -> np.ndarray:
    """Return one angle whose jumps by `turn` are taken out [rad], shape (T,)."""
    result: np.ndarray = np.unwrap(values, period=turn)
    return result


def find_turns(episodes: Sequence[Trajectory]) -> dict[tuple[str, int], float]:
    """Return by how much channels wrap [rad], by signal and joint."""
    return {
        (signal, place.joint): turn for signal in ("position", "action") for place, turn in _wraps(episodes, signal)
    }


def _wraps(episodes: Sequence[Trajectory], signal: str) -> Iterator[tuple[Place, float]]:
    for number, episode in enumerate(episodes):
        for k in range(episode.action.shape[1]):
            values = getattr(episode, signal)[:, k]
            other = episode.action[:, k] if signal == "position" else episode.position[:, k]
            turn, rows = _jumps(values)
            if signal == "action" and turn != TURN:  # a command may jump from one end of its motion to the other
                continue
            for row in rows:
                if not _moves_along(values, other, row, turn):
                    yield Place(k, number, row + 1), turn


def _jumps(values: np.ndarray) -> tuple[float, list[int]]:
    """Return the size of a wrap [rad] and the rows before each; no rows where nothing wraps."""
    steps = np.diff(values)
    if not len(steps) or np.ptp(values) < LEAST:
        return TURN, []
    far = np.abs(steps) >= END_TO_END * np.ptp(values)
    others = float(np.abs(steps[~far]).max(initial=0.0))
    if not far.any() or np.abs(steps[far]).min() <= CLEAR * others or far.sum() > 0.2 * len(steps):
        return TURN, []
    size = float(np.median(np.abs(steps[far])))
    if abs(size - TURN) < NEARLY * TURN:
        return TURN, np.flatnonzero(far).tolist()
    whole = size + float(np.median(np.abs(steps[~far][steps[~far] != 0.0]))) if (steps[~far] != 0.0).any() else size
    return whole, np.flatnonzero(far).tolist()


def _moves_along(values: np.ndarray, other: np.ndarray, row: int, turn: float) -> bool:
    """Whether the other signal of the joint, command or position, moves as far the same way around a jump."""
    jump = values[row + 1] - values[row]
    near = other[max(0, row - AROUND) : min(len(other), row + 2 + AROUND)]
    if turn == TURN:  # command and position may both wrap: a turn is no step that anyone asks for
        return bool(np.ptp(near) > OWN * abs(jump) and not _is_turn(near))
    return bool(np.ptp(near) > OWN * abs(jump))


def _is_turn(near: np.ndarray) -> bool:
    return bool(abs(np.abs(np.diff(near)).max(initial=0.0) - TURN) < NEARLY * TURN)
