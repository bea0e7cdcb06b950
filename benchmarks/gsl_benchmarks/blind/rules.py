"""A table of rules, as a person at the bench would use it: lags, static errors and hysteresis, read off the log.

The features are those of SAGE-style fault tables: how much later than its simulator a joint follows, how far off it
rests and whether that grows with the load, how wide its hysteresis is, and how often its motor is at the limit.
"""

from __future__ import annotations

import numpy as np

from gsl.diagnosis.hypothesis.problem import Problem
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.simulate.calibration import no_shifts

MOVING, RESTING = 0.3, 0.02  # speeds of a replay [rad/s]
CLEAR = 1.0  # floors that a feature has to have
ALONE = 0.6  # share of a feature that one joint has to have to be the only one


def apply_rules(log: Log, arena: Problem) -> tuple[list[str], list[str]]:
    """Return the effects that the rules read, likeliest first, and the joints of the first; none for no gap."""
    replays = arena.train.simulator.simulate({}, no_shifts(len(log.joints)), arena.train.pieces)
    part, first = arena.train.pieces, arena.train.pieces.warm_up
    real, sim = part.real[:, first:], replays[:, first:]
    floor, error = log.comparison.floor, real - sim
    speed = np.gradient(sim, log.period, axis=1)
    commands = part.windows.commands[:, : replays.shape[1], : real.shape[2]][:, ::-1][:, first:]
    servo, n = arena.train.simulator.plant.servo, real.shape[2]
    load = servo.kp[:n] * (commands - sim) / servo.limit[:n]
    features = {
        "zero_offset": np.abs(_mean(error, np.abs(speed) < RESTING)),
        "servo_gain": np.abs(_slope(error, load, np.abs(speed) < RESTING)) * _spread(load),
        "command_latency": np.abs(_slope(error, speed, np.abs(speed) > MOVING)) * _spread(speed),
        "coulomb_friction": np.abs(_mean(error * np.sign(speed), (np.abs(speed) > RESTING) & (np.abs(speed) < MOVING))),
        "torque_limit": np.abs(_mean(error * np.sign(load), np.abs(load) > 0.9)),
        "encoder_noise": np.sqrt(np.mean(np.diff(real, 2, axis=1) ** 2, axis=(0, 1)) / 6.0) - floor,
    }
    effects = {candidate.effect for candidate in arena.library}
    scored = {name: values / floor for name, values in features.items() if name in effects}
    order = sorted(scored, key=lambda name: -float(np.sqrt(np.mean(scored[name] ** 2))))
    strength = scored[order[0]]
    if np.sqrt(np.mean(strength**2)) < CLEAR:
        return [], []
    worst = int(np.argmax(strength))
    alone = strength[worst] ** 2 > ALONE * np.sum(strength**2)
    return order, [log.joints[worst]] if alone else list(log.joints)


def _mean(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the mean of each joint over what a mask keeps, shape (n_joints,)."""
    return np.where(mask, values, 0.0).sum(axis=(0, 1)) / np.maximum(1, mask.sum(axis=(0, 1)))


def _slope(values: np.ndarray, along: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the slope of each joint's values along another quantity, shape (n_joints,)."""
    x = np.where(mask, along - _mean(along, mask), 0.0)
    return (x * values).sum(axis=(0, 1)) / np.maximum(1e-12, (x**2).sum(axis=(0, 1)))


def _spread(values: np.ndarray) -> np.ndarray:
    return np.asarray(values.std(axis=(0, 1)))
