"""Counterfactuals on the ground: windows of a walk replayed in Bullet from measured states of joints and base."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from scipy.spatial.transform import Rotation

from gsl.core.body import lumped
from gsl.core.plant import GRAVITY, Plant
from gsl.diagnosis.records import OnGround, Pieces
from gsl.diagnosis.replay import Effects
from gsl.effects.effect import applied, built
from gsl.worlds.engine import Engine, Physics, Reading
from gsl.worlds.servo import COMMANDS
from gsl.worlds.start import lowest_point

SUNK = 4e-4  # of the lowest sole at the beginning of a window [m]: in contact, as a stance foot is


@dataclass(frozen=True)
class Walking:
    """Replays of a robot on the ground; joints are as the simulator has them, nothing is calibrated on the fly.

    Attributes:
        plant: The simulator.
        step: Physics period [s].
        period: Control period [s].
        iterations: Of the constraint solver.
        workers: Processes that replay side by side.
    """

    plant: Plant
    step: float
    period: float
    iterations: int = 50
    workers: int = 1
    calibrates = False

    def told(self, effects: Effects, nuisances: np.ndarray, pieces: Pieces) -> np.ndarray:
        """Return replayed joints [rad] and base, shape (W, T, n_channels); `nuisances` play no part."""
        plant = applied(self.plant, built(effects))
        physics = Physics(self.step, self.iterations, self.period, floating=True)
        shares = np.array_split(np.arange(len(pieces)), min(self.workers, len(pieces)))
        parts = [OnGround(*(part[share] for part in pieces.windows)) for share in shares]
        if len(parts) == 1:
            return _all_replayed(plant, physics, parts[0])
        parallel = Parallel(n_jobs=len(parts), max_nbytes=None)  # else joblib leaves a file for every call
        return np.concatenate(parallel(delayed(_all_replayed)(plant, physics, one) for one in parts))


def _all_replayed(plant: Plant, physics: Physics, windows: OnGround) -> np.ndarray:
    engine, joints = Engine(plant, physics), len(plant.robot.controlled)
    told = [_replayed(engine, OnGround(*row), joints) for row in zip(*windows, strict=True)]
    engine.close()
    return np.array(told)


def _replayed(engine: Engine, window: OnGround, joints: int) -> np.ndarray:
    """Return what one window leads to, shape (T, n_channels); the fields of `window` are without their first axis."""
    length = len(window.commands) - COMMANDS + 1
    base, robot, motion = window.base, lumped(engine.plant.robot), _moving(engine.plant, window.motion)
    place, turn = base[:3].copy(), Rotation.from_quat(base[6:10])
    place[2] = -_sunk(engine.plant) - lowest_point(robot, motion[0], turn.as_matrix())
    lifted = base[2] - place[2]  # where the log's ground is
    start = Reading(motion, place, tuple(base[6:10].tolist()), base[10:13], base[13:16], 1.0, ())
    engine.load(start, window.commands[length:], float(window.clock))
    told, yaw = [], float(base[5])
    for t in range(length):
        engine.run(window.commands[length - 1 - t])
        reading = engine.read()
        angles = Rotation.from_quat(reading.quaternion).as_euler("ZYX")[::-1]
        yaw += float(np.angle(np.exp(1j * (angles[2] - yaw))))
        sensed = engine.encoders(reading)[0, :joints] + engine.plant.sensors.bias[:joints]
        told.append(np.r_[sensed, reading.place + [0.0, 0.0, lifted], angles[:2], yaw])
    return np.array(told)


def _moving(plant: Plant, measured: np.ndarray) -> np.ndarray:
    """Return how the joints move at the beginning of a window, shape (2, n_motors), where encoders tell `measured`.

    In the air a warm-up forgets a wrong start; on the ground the robot stands on it.
    """
    late = plant.servo.sensor_delay * measured[1]
    return np.array([measured[0] - plant.sensors.bias + late, measured[1]])


def _sunk(plant: Plant) -> float:
    """Return how deep the lowest sole is in the ground [m]: a soft one carries it at eight corners."""
    stiffness = plant.contact.stiffness
    return SUNK + (0.0 if stiffness is None else plant.robot.mass * GRAVITY / (8.0 * stiffness))


def restart_error(simulator: Walking, pieces: Pieces) -> np.ndarray:
    """Return how far a replay is off that starts from a log of the simulator itself, rms, shape (n_channels,).

    A log does not show bristles, contact forces or what is under way to the servos: a window that starts from it is off
    even if the simulator is right.

    Args:
        simulator: Nominal.
        pieces: Windows, each of which is replayed, logged and replayed again from the end of its warm-up.
    """
    windows: Any = pieces.windows
    told = simulator.told({}, np.zeros(0), pieces)
    first, joints = pieces.warm_up - 1, len(simulator.plant.robot.controlled)
    drive, base = simulator.plant.robot.drive, windows.base.copy()
    speed = np.gradient(told, simulator.period, axis=1)[:, first]
    base[:, :6] = told[:, first, joints:]
    base[:, 6:10] = Rotation.from_euler("ZYX", base[:, 5:2:-1]).as_quat()
    base[:, 10:13] = speed[:, joints : joints + 3]
    base[:, 13:16] = _gyro(told[:, first, joints + 3 :], speed[:, joints + 3 :])
    motion = np.stack([told[:, first][:, drive], speed[:, drive]], axis=1)
    left = pieces.windows.length - pieces.warm_up
    again = OnGround(windows.commands[:, : left + COMMANDS - 1], motion, windows.clock, base)
    retold = simulator.told({}, np.zeros(0), replace(pieces, windows=again))
    skipped = min(pieces.warm_up, left // 2)
    error = retold[:, skipped:] - told[:, first + 1 + skipped :]
    result: np.ndarray = np.sqrt(np.nanmedian(error**2, axis=(0, 1)) / 0.455)  # of a normal distribution
    return result


def _gyro(angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return angular velocities in base axes [rad/s] from roll, pitch, yaw and their rates, shapes (W, 3)."""
    roll, pitch = angles[:, 0], angles[:, 1]
    x = rates[:, 0] - np.sin(pitch) * rates[:, 2]
    y = np.cos(roll) * rates[:, 1] + np.sin(roll) * np.cos(pitch) * rates[:, 2]
    z = -np.sin(roll) * rates[:, 1] + np.cos(roll) * np.cos(pitch) * rates[:, 2]
    return np.stack([x, y, z], axis=1)
