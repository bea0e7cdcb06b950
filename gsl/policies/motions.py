"""The motions that excite a robot's servos, as waves between -1 and 1 a joint: zero, and at rest, at both ends.

What sets the joints of one motion apart is their `Parts`; how far a wave of 1 goes is not known here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gsl.core.seeds import derive_seed
from gsl.policies.sides import Pair

RISE, GENTLE = 2.5, 1.2  # speed at which a wave, and a slow one, grows from rest and returns to it [1/s]
HOLD, LONGER, LATER = 0.42, 0.1, 0.3  # of a step: hold, how much longer and how much later in the last joint [s]
LADDERS = ((1 / 3, 0.0, -2 / 3, 0.0, 1.0, 0.0), (0.85, 0.0, -0.25, 0.0, 0.55, 0.0))
POSE, RAMP = 0.7, 0.5  # how long a pose is held, and the way to the next one [s]
SLOW, FAST, KNEE = 0.3, 5.0, 0.8  # of the chirp: from, to, and where its speed ceases to rise [Hz]
SWAY = 0.8  # of the mirrored motion [Hz]


class Parts(NamedTuple):
    """What a motion's joints do differently: even spreads over [0, 1) in orders of their own, each of shape (n,).

    Attributes:
        phase: Where a joint begins in its wave.
        tempo: How its frequency or its holds differ.
        level: How its amplitude differs.
        sign: +1 or -1, as many of the one as of the other.
        pairs: Left and right joints.
        variant: 0 or 1.
    """

    phase: np.ndarray
    tempo: np.ndarray
    level: np.ndarray
    sign: np.ndarray
    pairs: tuple[Pair, ...]
    variant: int

    @property
    def amplitude(self) -> np.ndarray:
        """Signed size of each joint's wave, shape (n,)."""
        return self.sign * (0.7 + 0.3 * self.level)


def parts(motion: str, variant: int, joints: int, pairs: tuple[Pair, ...]) -> Parts:
    """Return the parts of a motion: a function of its name, its variant and the number of joints."""
    rng = np.random.default_rng(derive_seed("excitation", motion, variant))
    phase, tempo, level = ((rng.permutation(joints) + rng.random(joints)) / joints for _ in range(3))
    return Parts(phase, tempo, level, 2.0 * (rng.permutation(joints) % 2) - 1.0, pairs, variant)


def steps(time: np.ndarray, length: float, these: Parts) -> np.ndarray:
    """Return jumps from rest and back in three sizes, each joint in an order and at times of its own.

    Args:
        time: Since the motion began [s], shape (T,).
        length: Of the motion [s].
        these: The joints' parts.

    Returns:
        Wave, shape (T, n), as do the other motions.
    """
    hold, late = HOLD + LONGER * these.tempo, LATER * these.phase
    rung = np.floor((time[:, None] - late) / hold).astype(int)
    ladder, whole = np.array(LADDERS[these.variant]), (length - late) // hold
    first = 2 * np.floor(0.5 * len(ladder) * these.level).astype(int)
    return np.where((rung >= 0) & (rung < whole), ladder[(rung + first) % len(ladder)], 0.0) * these.sign


def triangle(time: np.ndarray, length: float, these: Parts, *, frequency: float) -> np.ndarray:
    """Return constant speeds back and forth, near a frequency [Hz]."""
    cycles = frequency * (0.9 + 0.2 * these.tempo + 0.15 * these.variant) * time[:, None] + these.phase
    wave = these.amplitude * (4.0 * np.abs((cycles + 0.75) % 1.0 - 0.5) - 1.0)
    return _from_rest(time, length, wave, max(GENTLE, 4.0 * frequency))


def chirp(time: np.ndarray, length: float, these: Parts) -> np.ndarray:
    """Return rising frequencies, in the second variant falling ones; the amplitude falls as the frequency rises."""
    time = time[:, None] if these.variant == 0 else length - time[:, None]
    ratio = FAST * (0.8 + 0.2 * these.tempo) / SLOW
    frequency = SLOW * ratio ** (time / length)
    cycles = (frequency - SLOW) * length / np.log(ratio) + these.phase
    wave = np.minimum(1.0, KNEE / frequency) * these.amplitude * np.sin(2.0 * math.pi * cycles)
    return _from_rest(time[:, 0], length, wave)


def poses(time: np.ndarray, length: float, these: Parts) -> np.ndarray:
    """Return postures on both sides of the rest, held, with smooth ways between them."""
    ramp = min(RAMP, 0.25 * length)
    count = max(1, int((length - ramp) / (POSE + ramp)))
    hold = (length - (count + 1) * ramp) / count
    size = np.array([these.sign * (-1.0) ** k * (0.6 + 0.4 * ((these.level + 0.37 * k) % 1.0)) for k in range(count)])
    jumps = np.diff(np.vstack([0.0 * these.sign, size, 0.0 * these.sign]), axis=0)
    begun = np.clip((time[:, None] - (hold + ramp) * np.arange(count + 1)) / ramp, 0.0, 1.0)
    return 0.5 * (1.0 - np.cos(math.pi * begun)) @ jumps


def mirror(time: np.ndarray, length: float, these: Parts) -> np.ndarray:
    """Return left and right as mirror images, then in antiphase; a joint without a counterpart goes its own way."""
    half = 0.5 * length
    cycles = SWAY * (0.8 + 0.4 * these.tempo + 0.15 * these.variant) * time[:, None] + these.phase
    wave = _from_rest(time % half, half, these.amplitude * np.sin(2.0 * math.pi * cycles))
    for left, right, sign in these.pairs:
        wave[:, right] = sign * wave[:, left] * np.where(time < half, 1.0, -1.0)
    return wave


def one_by_one(time: np.ndarray, length: float, these: Parts) -> np.ndarray:
    """Return one joint after the other moving alone, out and back."""
    count = len(these.sign)
    turn = (np.arange(count) + these.variant * (count // 2)) % count
    share = np.clip(time[:, None] * count / length - turn, 0.0, 1.0)
    return these.amplitude * 0.5 * (1.0 - np.cos(2.0 * math.pi * share))


def _from_rest(time: np.ndarray, length: float, wave: np.ndarray, rise: float = RISE) -> np.ndarray:
    """Return a wave that grows from rest and returns to it at a bounded speed [1/s]."""
    widest = rise * np.maximum(np.minimum(time, length - time), 0.0)[:, None]
    return np.clip(wave, -widest, widest)
