"""What a simulator of a robot on the ground answers to commands: windows replayed in Bullet from measured states."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gsl.core.body import lump
from gsl.core.console import Silent
from gsl.core.plant import GRAVITY, Plant
from gsl.diagnosis.log.records import OnGround, Pieces
from gsl.diagnosis.simulate.calibration import ZERO, calibrate, draw_shifts
from gsl.diagnosis.simulate.in_the_air import Effects, Item, Result, change
from gsl.rollout.parallel import in_parallel
from gsl.worlds.engine import Engine
from gsl.worlds.physics import Physics, Reading
from gsl.worlds.servo_state import COMMANDS
from gsl.worlds.start import lowest_point

HEIGHT = 1e-3  # error of a logged height [m]: estimate
ROBOTS = 6  # of one make that are drawn to see how they differ
SUNK = 4e-4  # of the lowest sole at the beginning of a window [m]: in contact, as a stance foot is


@dataclass(frozen=True)
class Walking:
    """Replays of a robot on the ground; of the joints only the zeros are calibrated on the fly, in the log.

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
    spread = 1.0
    accurate = False

    @property
    def log_step(self) -> float:
        """Physics period of logs that a self-test makes [s]."""
        return self.step

    def simulate(self, effects: Effects, shifts: np.ndarray, pieces: Pieces) -> np.ndarray:
        """Return replayed joints [rad] and base, shape (W, T, n_channels); of `shifts` only zeros play a part."""
        plant = change(self.plant, effects)
        channels = self._replay(plant, pieces.windows)
        if shifts.size:
            joints = len(plant.robot.controlled)
            channels[..., :joints] += shifts[ZERO, :joints]
        return channels

    def side_by_side(
        self, work: Callable[[Any, Item], Result], items: Sequence[Item], done: Callable[[Result], object]
    ) -> list[Result]:
        """Return what some work makes of each item, one after the other: their replays are what is side by side."""
        results = list[Result]()
        for item in items:
            results.append(work(self, item))
            done(results[-1])
        return results

    def _replay(self, plant: Plant, windows: Any) -> np.ndarray:
        physics = Physics(self.step, self.iterations, self.period, floating=True)
        windows = windows._replace(motion=read_motion(plant, windows.motion))
        heights = find_heights(plant, windows)
        shares = np.array_split(np.arange(len(heights)), min(self.workers, len(heights)))
        parts = [(OnGround(*(part[share] for part in windows)), heights[share]) for share in shares]
        if len(parts) == 1:
            return _replay_all(plant, physics, *parts[0])
        with Silent().progress(len(parts), "") as progress:
            return np.concatenate(in_parallel(_replay_part, (plant, physics), parts, len(parts), progress))


def _replay_part(frozen: bytes, part: tuple[OnGround, np.ndarray]) -> np.ndarray:
    plant, physics = pickle.loads(frozen)  # our own bytes, from the parent process
    return _replay_all(plant, physics, *part)


def _replay_all(plant: Plant, physics: Physics, windows: OnGround, heights: np.ndarray) -> np.ndarray:
    engine, joints = Engine(plant, physics), len(plant.robot.controlled)
    rows = zip(zip(*windows, strict=True), heights, strict=True)
    channels = [_replay_window(engine, OnGround(*row), float(height), joints) for row, height in rows]
    engine.close()
    return np.array(channels)


def _replay_window(engine: Engine, window: OnGround, height: float, joints: int) -> np.ndarray:
    """Return what one window leads to, shape (T, n_channels).

    Args:
        engine: With the plant.
        window: Its fields are without their first axis.
        height: Of the base above the ground at the beginning [m].
        joints: Number of joints that a log shows.
    """
    length = len(window.commands) - COMMANDS + 1
    base, motion = window.base, window.motion
    place = np.array([base[0], base[1], height])
    lifted = base[2] - height  # where the log's ground is
    start = Reading(motion, place, tuple(base[6:10].tolist()), base[10:13], base[13:16], 1.0, np.zeros(0))
    engine.load(start, window.commands[length:], float(window.clock))
    rows, yaw = [], float(base[5])
    for t in range(length):
        engine.run(window.commands[length - 1 - t])
        reading = engine.read()
        angles = Rotation.from_quat(reading.quaternion).as_euler("ZYX")[::-1]
        yaw += float(np.angle(np.exp(1j * (angles[2] - yaw))))
        sensed = engine.encoders(reading)[0, :joints] + engine.plant.sensors.bias[:joints]
        rows.append(np.r_[sensed, reading.place + [0.0, 0.0, lifted], angles[:2], yaw])
    return np.array(rows)


def read_motion(plant: Plant, measured: np.ndarray) -> np.ndarray:
    """Return how joints move at the beginning of windows where encoders tell `measured`, shape (W, 2, n_motors).

    In the air a warm-up forgets a wrong start; on the ground the robot stands on it.
    """
    place = measured[:, 0] - plant.sensors.bias + plant.servo.sensor_delay * measured[:, 1]
    return np.stack([place, measured[:, 1]], axis=1)


def find_heights(plant: Plant, windows: OnGround) -> np.ndarray:
    """Return the height of the base over the ground at the beginning of windows [m], shape (W,).

    A log tells it with an error that would lift a sole off hard ground, or press it in; so the lowest sole is where a
    stance foot is. In soft ground it is deeper where the log has it deeper, as far as that is more than noise; where
    the log's own ground is it does not matter.
    """
    robot = lump(plant.robot)
    turns = Rotation.from_quat(windows.base[:, 6:10]).as_matrix()
    low = np.array([lowest_point(robot, *pose) for pose in zip(windows.motion[:, 0], turns, strict=True)])
    soles, stiffness = windows.base[:, 2] + low, plant.contact.stiffness
    if stiffness is None:
        return -SUNK - low
    sunk = plant.robot.mass * GRAVITY / (8.0 * stiffness)  # at eight corners
    seen = sunk**2 / (sunk**2 + HEIGHT**2)
    return -SUNK - sunk + seen * (soles - np.median(soles)) - low


def model_error(simulator: Walking, pieces: Pieces, rng: np.random.Generator) -> np.ndarray:
    """Return how far a replay on the ground is off with nothing wrong, by both reasons below, shape (n_channels,)."""
    result: np.ndarray = np.hypot(restart_error(simulator, pieces), jitter_error(simulator, pieces, rng))
    return result


def restart_error(simulator: Walking, pieces: Pieces) -> np.ndarray:
    """Return how far a replay is off that starts from a log of the simulator itself, rms, shape (n_channels,).

    A log does not show bristles, contact forces or what is under way to the servos: a window that starts from it is off
    even if the simulator is right.

    Args:
        simulator: Nominal.
        pieces: Windows, each of which is replayed, logged and replayed again from the end of its warm-up.
    """
    windows: Any = pieces.windows
    replay = simulator.simulate({}, np.zeros(0), pieces)
    first, joints = pieces.warm_up - 1, len(simulator.plant.robot.controlled)
    drive, base = simulator.plant.robot.drive, windows.base.copy()
    speed = np.gradient(replay, simulator.period, axis=1)[:, first]
    base[:, :6] = replay[:, first, joints:]
    base[:, 6:10] = Rotation.from_euler("ZYX", base[:, 5:2:-1]).as_quat()
    base[:, 10:13] = speed[:, joints : joints + 3]
    base[:, 13:16] = _gyro(replay[:, first, joints + 3 :], speed[:, joints + 3 :])
    motion = np.stack([replay[:, first][:, drive], speed[:, drive]], axis=1)
    left = pieces.windows.length - pieces.warm_up
    again = OnGround(windows.commands[:, : left + COMMANDS - 1], motion, windows.clock, base)
    second = simulator.simulate({}, np.zeros(0), replace(pieces, windows=again))
    skipped = min(pieces.warm_up, left // 2)
    error = second[:, skipped:] - replay[:, first + 1 + skipped :]
    result: np.ndarray = np.sqrt(np.nanmedian(error**2, axis=(0, 1)) / 0.455)  # of a normal distribution
    return result


def jitter_error(simulator: Walking, pieces: Pieces, rng: np.random.Generator) -> np.ndarray:
    """Return how far robots of one make are off their simulator with the zeros calibrated, rms, shape (n_channels,).

    On the ground nothing else is calibrated: what servos of one make differ by has to be part of the floor.

    Args:
        simulator: Nominal.
        pieces: Windows that such robots replay.
        rng: Of the robots.
    """
    plant, joints = simulator.plant, len(simulator.plant.robot.controlled)
    nominal, errors = simulator.simulate({}, np.zeros(0), pieces), []
    for _ in range(ROBOTS):
        shifts = draw_shifts(rng, joints)
        zeros, shifts[ZERO] = shifts[ZERO, plant.robot.drive], 0.0
        other = calibrate(plant, shifts)
        other = other.with_servo(offset=other.servo.offset + zeros)
        error = (replace(simulator, plant=other).simulate({}, np.zeros(0), pieces) - nominal)[:, pieces.warm_up :]
        error[..., :joints] -= np.nanmedian(error[..., :joints], axis=(0, 1))
        errors.append(error)
    result: np.ndarray = np.sqrt(np.nanmedian(np.array(errors) ** 2, axis=(0, 1, 2)) / 0.455)
    return result


def _gyro(angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return angular velocities in base axes [rad/s] from roll, pitch, yaw and their rates, shapes (W, 3)."""
    roll, pitch = angles[:, 0], angles[:, 1]
    x = rates[:, 0] - np.sin(pitch) * rates[:, 2]
    y = np.cos(roll) * rates[:, 1] + np.sin(roll) * np.cos(pitch) * rates[:, 2]
    z = -np.sin(roll) * rates[:, 1] + np.cos(roll) * np.cos(pitch) * rates[:, 2]
    return np.stack([x, y, z], axis=1)
