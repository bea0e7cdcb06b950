"""Programmes: the sets of commands that a benchmark's cases share, one excitation in several sizes and lengths.

The last of several is what somebody in a hurry records: few unlike motions, each once.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gsl.core.body import Robot
from gsl.policies.excitation import Excitation, Motion

FEW: tuple[Motion, ...] = ("steps_small", "triangle_slow", "chirp", "poses", "mirrored")
SMALLEST = 0.75  # factor on the amplitude
LENGTHS = (0.92, 1.08)  # factors on the duration


class Programme(NamedTuple):
    """Names of its motions and their commands, each of shape (T, n_joints) [rad]."""

    names: tuple[str, ...]
    commands: tuple[np.ndarray, ...]

    def targets(self, robot: Robot) -> list[np.ndarray]:
        """Return the commands as motor targets [rad], shape (T, n_motors) each."""
        return [commands[:, robot.drive] for commands in self.commands]


def draw_programmes(like: Excitation, count: int, period: float, rng: np.random.Generator) -> list[Programme]:
    """Return excitations: the first as it is, the others a little smaller and of other lengths, the last of few.

    Args:
        like: What they are variations of.
        count: How many.
        period: Control period [s].
        rng: Of sizes and lengths.
    """
    made = [like]
    for _ in range(count - 1):
        amplitude = like.amplitude * round(float(rng.uniform(SMALLEST, 1.0)), 2)
        ticks = round(like.duration * float(rng.uniform(*LENGTHS)) / period)
        made.append(replace(like, amplitude=amplitude, duration=max(1.5, ticks * period)))
    few = tuple(motion for motion in FEW if motion in like.motions)
    if count > 1 and few:
        made[-1] = replace(made[-1], motions=few, variants=like.variants[:1], repeats=1)
    return [_play(excitation, period) for excitation in made]


def _play(excitation: Excitation, period: float) -> Programme:
    pieces = excitation.programme
    commands = [excitation.commands(piece.about["motion"], piece.about["variant"], period) for piece in pieces]
    return Programme(tuple(piece.label for piece in pieces), tuple(commands))
