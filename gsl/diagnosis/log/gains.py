"""Gains that a log has of its servos, which those of the simulator then have: kp and kd, constant for each joint."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gsl.effects.effect import together
from gsl.errors import InputError
from gsl.worlds.bullet import BulletWorld

GAINS = {"kp_command": "kp", "kd_command": "kd"}  # group of columns -> gain of the servo
SAME = 1e-6  # relative: a gain that differs less is the same, as files round


def with_logged_gains(sim: BulletWorld, sensors: Sequence[Mapping[str, np.ndarray]], name: str) -> BulletWorld:
    """Return the simulator with the gains of a log, by `servo_gain`; the same one where the log has none or these.

    Args:
        sim: Whose servos replay the log.
        sensors: Columns of each trajectory.
        name: Of the log.

    Raises:
        InputError: A gain varies, or the simulator has none that a factor would change.
    """
    robot, servo = sim.plant.robot, sim.plant.servo
    factors: dict[str, dict[str, float]] = defaultdict(dict)
    for joint, column, gain in _columns(robot.controlled):
        if (value := _read_gain([one[column] for one in sensors if column in one], f"{name}: {column}")) is None:
            continue
        own = float(getattr(servo, gain)[robot.motors.index(joint)])
        if abs(value - own) <= SAME * max(value, own):
            continue
        if own == 0.0:
            raise InputError(f"{name}: {column} is {value:.4g}, but {gain} of the simulator is 0; choose another sim=")
        factors[joint][gain] = value / own
    if not factors:
        return sim
    entries = [{**gains, "joints": joint} for joint, gains in factors.items()]
    return replace(sim, effects=together([sim.effects, {"servo_gain": entries}]))


def _columns(joints: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    for column, gain in GAINS.items():
        for joint in joints:
            yield joint, f"{column}.{joint}", gain


def _read_gain(parts: Sequence[np.ndarray], where: str) -> float | None:
    """Return the one value of a gain in all trajectories, None where no trajectory has it."""
    if not parts:
        return None
    values: Any = np.concatenate([part[:-1] for part in parts])  # the last row has no command
    low, high = float(values.min()), float(values.max())
    if high - low > SAME * max(abs(low), abs(high)):
        raise InputError(
            f"{where} varies from {low:.4g} to {high:.4g}; replays take gains that are constant: import rows of equal "
            "gains apart, or say them by mapping.conditions"
        )
    if low < 0.0:
        raise InputError(f"{where} is {low:.4g}; a gain is not below 0: is its sign or its column wrong?")
    return low
