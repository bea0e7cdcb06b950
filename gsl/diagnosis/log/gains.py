"""Gains that a log has of its servos, which those of the simulator then have: kp and kd of each joint.

Where none varies, the simulator's gains are those of the log. Where some do, they are sent row by row, as shares of
the robot's own (gsl/core/other_commands.py), and the simulator's are the robot's own.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gsl.core.other_commands import GAIN_EFFECT, GAINS, LOGGED_GAINS, SAME, find_varying_gains, read_gains
from gsl.core.plant import nominal
from gsl.effects.effect import together
from gsl.errors import InputError
from gsl.worlds.bullet import BulletWorld

Sensors = Sequence[Mapping[str, np.ndarray]]
ROUNDED = 1e-5  # relative: worlds are written with six digits


def with_logged_gains(sim: BulletWorld, sensors: Sensors, name: str) -> BulletWorld:
    """Return the simulator with the gains of a log, by `servo_gain`; the same one where the log has none or these.

    Args:
        sim: Whose servos replay the log. One that has the log's gains beneath what was diagnosed of it stays as it is.
        sensors: Columns of each trajectory.
        name: Of the log.

    Raises:
        InputError: A gain is below 0, or the simulator has none that a factor would change.
    """
    robot, servo = sim.plant.robot, sim.plant.servo
    ours, varies = nominal(robot).servo, next(find_varying_gains(sensors, robot.controlled), None) is not None
    factors, usual = (defaultdict[str, dict[str, float]](dict) for _ in range(2))
    for joint, column, gain in _columns(robot.controlled):
        values = read_gains(sensors, column)
        if not len(values):
            continue
        if (least := float(values.min())) < 0.0:
            raise InputError(
                f"{name}: {column} is {least:.4g}; a gain is not below 0: is its sign or its column wrong?"
            )
        k, most = robot.motors.index(joint), float(values.max())
        nominal_gain, own = float(getattr(ours, gain)[k]), float(getattr(servo, gain)[k])
        wanted = nominal_gain if varies else most
        if most > 0.0 and 0.0 in (own, wanted):
            raise InputError(f"{name}: {column} is {most:.4g}, but {gain} of the simulator is 0; choose another sim=")
        for there, of in ((factors, own), (usual, nominal_gain)):
            if abs(wanted - of) > SAME * max(wanted, of):
                there[joint][gain] = wanted / of
    if not factors or (usual and _has(sim.effects, _entries(usual))):
        return sim
    return replace(sim, effects=together([sim.effects, {GAIN_EFFECT: _entries(factors)}]))


def list_added_gains(before: BulletWorld, after: BulletWorld) -> dict[str, Any]:
    """Return what metrics say of gains that a log gave to a simulator, nothing if it gave none."""
    if after is before:
        return {}
    return {LOGGED_GAINS: _gains(after.effects)[len(_gains(before.effects)) :]}


def _gains(effects: Mapping[str, Any]) -> list[Any]:
    return together([effects]).get(GAIN_EFFECT, [])


def _entries(factors: Mapping[str, Mapping[str, float]]) -> list[dict[str, Any]]:
    return [{**gains, "joints": joint} for joint, gains in factors.items()]


def _has(effects: Mapping[str, Any], entries: Sequence[Mapping[str, Any]]) -> bool:
    """Whether effects have such gains, rounded as files round."""
    return all(any(_alike(other, entry) for other in _gains(effects)) for entry in entries)


def _alike(other: Mapping[str, Any], entry: Mapping[str, Any]) -> bool:
    return other.get("joints") == entry["joints"] and all(
        abs(other.get(gain, 1.0) - entry.get(gain, 1.0)) <= ROUNDED * entry.get(gain, 1.0) for gain in GAINS.values()
    )


def unseen_gains(sensors: Sensors, joints: Sequence[str]) -> str | None:
    """Return a warning of joints whose kp is 0 in every row, if there are some: a log of them shows no stiffness."""
    values = {joint: read_gains(sensors, f"kp_command.{joint}") for joint in joints}
    if not (unseen := [joint for joint, some in values.items() if len(some) and not some.any()]):
        return None
    return (
        f"This log never shows the gains of {', '.join(unseen)}: kp is 0 in every row. The corrected simulator has "
        "kp 0 there, too, and follows no position: log position commands as well before you train in it."
    )


def _columns(joints: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    for column, gain in GAINS.items():
        for joint in joints:
            yield joint, f"{column}.{joint}", gain
