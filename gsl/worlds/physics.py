"""What an engine is asked for and what it says: its settings, loads from outside, and what can be measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from gsl.worlds.velocity_motors import Motors


@dataclass(frozen=True)
class Physics:
    """How the engine computes.

    Attributes:
        step: Physics period [s].
        iterations: Of the constraint solver.
        period: Control period [s], a multiple of `step`.
        floating: Whether the base moves freely above a plane; else it is held in the air.
        motors: What turns the joints; see velocity_motors.py.
    """

    step: float
    iterations: int
    period: float
    floating: bool
    motors: Motors = "servo"

    @property
    def substeps(self) -> int:
        """Physics steps in a control period."""
        return round(self.period / self.step)


class Load(Protocol):
    """Torques on the motors from outside, a control period at a time.

    Attributes:
        drag: Taken off them per speed [N·m·s/rad], shape (n_motors,).
    """

    drag: np.ndarray

    def act(self, times: np.ndarray) -> np.ndarray:
        """Return the torques [N·m] at the times of physics steps [s], (T,) -> (T, n_motors)."""

    def note(self, times: np.ndarray, path: np.ndarray) -> None:
        """Take in how the motors moved at these times [rad], [rad/s], shape (T, 2, n_motors)."""


class Reading(NamedTuple):
    """What can be measured of the robot at one moment; base quantities are of the base's link frame.

    Attributes:
        motion: Motor positions [rad] and velocities [rad/s], shape (2, n_motors).
        place: Base position in world axes [m], shape (3,).
        quaternion: Base orientation, x y z w.
        velocity: Of the base in world axes [m/s], shape (3,).
        gyro: Angular velocity in base axes [rad/s], shape (3,).
        up: Cosine of the base's tilt.
        foot_force: Normal force on each foot [N], shape (n_feet,).
    """

    motion: np.ndarray
    place: np.ndarray
    quaternion: tuple[float, ...]
    velocity: np.ndarray
    gyro: np.ndarray
    up: float
    foot_force: np.ndarray
