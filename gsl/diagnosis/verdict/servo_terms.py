"""Terms of a servo law: simple functions of what a joint does, along the replays of a hypothesis, and their answers.

A term moves the joint's target. How far that moves the joint later is what its replays answer to a small step of the
target from the beginning of a window on, which is the same for all terms.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.diagnosis.settings import LawSettings
from gsl.diagnosis.simulate.calibration import OFFSET, PROBES
from gsl.diagnosis.simulate.in_the_air import Effects
from gsl.diagnosis.simulate.simulator import Bench

GAIN, INERTIA, LAG, SPEED, LOAD, POSITION, REVERSAL, TIME = FORMS = (
    "gain", "inertia", "lag", "speed", "load", "position", "reversal", "time",
)  # fmt: skip
SHARP = 10.0  # usual speeds over that at which dry friction has its size
ENDS = (0.1, 0.5, 0.9)  # quantiles of a joint's positions: its middle and its usual ends
LONG = 5.0  # time over which something changes in an episode [s]


class Replays(NamedTuple):
    """Replays of one part of a log by a hypothesis, and how joints answer there.

    Attributes:
        z: Residuals [floors], shape (W, scored, n_joints).
        targets: Of every control period, and of older ones [rad], shape (lags + 1, W, T, n_joints).
        position: In the middle of each period [rad], shape (W, T, n_joints).
        speed: There [rad/s], shape (W, T, n_joints).
        clock: Time since the episode began [s], shape (W, T).
        answer: To a target that moves for one period, by time from then on [floors / rad], shape (W, T, n_joints).
        warm_up: Periods that are not scored.
        floor: [rad], shape (n_joints,).
    """

    z: np.ndarray
    targets: np.ndarray
    position: np.ndarray
    speed: np.ndarray
    clock: np.ndarray
    answer: np.ndarray
    warm_up: int
    floor: np.ndarray


def replay(bench: Bench, effects: Effects, shifts: np.ndarray, lags: int) -> Replays | None:
    """Return the replays of a bench by a hypothesis; None if one of them diverges.

    Args:
        bench: The windows.
        effects: Of the hypothesis.
        shifts: Its calibration, shape (7, n_joints).
        lags: Number of older targets.
    """
    pieces, simulator, n = bench.pieces, bench.simulator, bench.joints
    up, down = shifts.copy(), shifts.copy()
    up[OFFSET] += PROBES[OFFSET]
    down[OFFSET] -= PROBES[OFFSET]
    paths = [simulator.simulate(effects, part, pieces) for part in (shifts, up, down)]
    if not np.isfinite(paths).all():
        return None
    path = np.concatenate([pieces.windows.motion[:, :1, :n], paths[0]], axis=1)
    sent, length = pieces.windows.commands[..., :n], paths[0].shape[1]
    step = (paths[1] - paths[2]) / (2.0 * PROBES[OFFSET] * bench.comparison.floor)
    return Replays(
        bench.comparison.residual(paths[0], pieces),
        np.array([sent[:, lag : lag + length][:, ::-1] for lag in range(lags + 1)]),
        0.5 * (path[:, 1:] + path[:, :-1]),
        np.diff(path, axis=1) / simulator.period,
        pieces.windows.clock[:, None] + simulator.period * np.arange(length),
        np.diff(step, axis=1, prepend=0.0),
        pieces.warm_up,
        bench.comparison.floor,
    )


class Scales(NamedTuple):
    """What is usual of one joint: speed [rad/s], error [rad], and the `ENDS` of its positions [rad]."""

    speed: float
    error: float
    ends: np.ndarray


def find_scales(replays: Replays, k: int) -> Scales:
    """Return what is usual of joint k."""
    speed, error = replays.speed[..., k], replays.targets[0, ..., k] - replays.position[..., k]
    ends = np.quantile(replays.position[..., k], ENDS)
    return Scales(float(np.sqrt((speed**2).mean())) + 1e-9, float(np.sqrt((error**2).mean())) + 1e-9, ends)


def make_terms(replays: Replays, k: int, usual: Scales, how: LawSettings) -> tuple[np.ndarray, np.ndarray]:
    """Return the form of each term, shape (n_terms,), and the terms of joint k, shape (n_terms, W, T).

    One unit of a lag is a radian, as an older target has it; that of any other term is what is usual of it.
    """
    targets, q, v = replays.targets[..., k], replays.position[..., k], replays.speed[..., k]
    e, s, clock = (targets[0] - q) / usual.error, v / usual.speed, replays.clock / LONG
    low, middle, high = usual.ends
    x, moves = 2.0 * (q - middle) / (high - low + 1e-9), np.tanh(SHARP * s)
    near_ends = np.maximum(0.0, x), np.tanh(3.0 * (x - 1.0)), np.tanh(3.0 * (x + 1.0))
    terms = {
        GAIN: [np.ones_like(x), e, s],
        INERTIA: [np.gradient(s, axis=1)],
        LAG: [targets[lag + 1] - targets[lag] for lag in range(how.lags)],
        SPEED: [moves, np.tanh(s), s * np.abs(s)],
        LOAD: [np.tanh(5.0 * e), np.tanh(e), e * np.abs(e), np.abs(e) * moves, e * np.abs(s)],
        POSITION: [x, np.tanh(3.0 * x), np.cos(np.pi * x), *near_ends],
        REVERSAL: [(pass_play(q, width) - q) / width for width in how.plays],
        TIME: [clock, e * clock],
    }
    forms = [form for form, parts in terms.items() for _ in parts]
    return np.array(forms), np.array([term for parts in terms.values() for term in parts])


def find_variables(replays: Replays, k: int, how: LawSettings) -> dict[str, np.ndarray]:
    """Return what the terms of joint k are functions of, by form but for a lag, shape (W, T)."""
    q = replays.position[..., k]
    return {
        GAIN: replays.targets[0, ..., k] - q,
        INERTIA: np.gradient(replays.speed[..., k], axis=1),
        SPEED: replays.speed[..., k],
        LOAD: replays.targets[0, ..., k] - q,
        POSITION: q,
        REVERSAL: q - pass_play(q, how.plays[-1]),
        TIME: replays.clock,
    }


def pass_play(position: np.ndarray, width: float) -> np.ndarray:
    """Return what is beyond a play of full width [rad], at first in its middle; positions of shape (W, T)."""
    beyond, here = np.empty_like(position), position[:, 0]
    for t, now in enumerate(position.T):
        here = np.clip(here, now - 0.5 * width, now + 0.5 * width)
        beyond[:, t] = here
    return beyond


def find_answers(replays: Replays, k: int, terms: np.ndarray) -> np.ndarray:
    """Return how much one unit of each term, and a log that is late, move the residuals of joint k.

    Args:
        replays: By the hypothesis.
        k: The joint.
        terms: Its terms, shape (n_terms, W, T).

    Returns:
        In floors, and in floors / s of the log that is late, which comes last; shape (n_terms + 1, W, scored).
    """
    moved, length = np.zeros_like(terms), terms.shape[2]
    for lag in range(length):
        moved[:, :, lag:] += terms[:, :, : length - lag] * replays.answer[:, lag, None, k]
    late = -replays.speed[None, ..., k] / replays.floor[k]
    return np.concatenate([moved, late])[:, :, replays.warm_up :]
