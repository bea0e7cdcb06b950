"""A plant is what a world is made of, as data: robot, servos, contact, sensors. An effect maps a plant to a plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gsl.core.body import Robot


@dataclass(frozen=True)
class Servo:
    """One joint servo per motor; every field has shape (n_motors,).

        u = kp (target - q) - kd dq/dt,  |u| <= limit, and <= limit (1 - |v| / no_load_speed) where it drives the motion

    Attributes:
        kp, kd: Gains [N·m/rad], [N·m·s/rad].
        limit: Torque limit [N·m].
        no_load_speed: Speed at which driving torque vanishes [rad/s].
        coulomb: Dry friction at the output [N·m].
        viscous: Friction proportional to speed [N·m·s/rad].
        armature: Rotor inertia seen at the output [kg·m²].
        delay: How much later the target arrives [s].
        play: Full width of the backlash between rotor and output [rad].
    """

    kp: np.ndarray
    kd: np.ndarray
    limit: np.ndarray
    no_load_speed: np.ndarray
    coulomb: np.ndarray
    viscous: np.ndarray
    armature: np.ndarray
    delay: np.ndarray
    play: np.ndarray


@dataclass(frozen=True)
class Contact:
    """Friction coefficients of foot and ground; Bullet multiplies them."""

    foot_friction: float = 0.8
    ground_friction: float = 1.0


@dataclass(frozen=True)
class Sensors:
    """What the log shows of the joints.

    Attributes:
        encoder_noise: Standard deviation of the logged positions [rad], shape (n_motors,).
    """

    encoder_noise: np.ndarray


@dataclass(frozen=True)
class Plant:
    """Robot, servos, contact and sensors."""

    robot: Robot
    servo: Servo
    contact: Contact
    sensors: Sensors

    def mask(self, joints: str | Sequence[str]) -> np.ndarray:
        """Return which motors a scope names, shape (n_motors,): `all`, a group of the robot, joint names or a mix.

        Raises:
            KeyError: with the name that is neither a group nor a motor.
        """
        names: set[str] = set()
        for word in (joints,) if isinstance(joints, str) else joints:
            names |= set(self._members(word))
        return np.array([motor in names for motor in self.robot.motors])

    def _members(self, word: str) -> Sequence[str]:
        if word == "all":
            return self.robot.motors
        if word in self.robot.groups:
            return self.robot.groups[word]
        if word in self.robot.motors:
            return (word, *(motor for motor, driver in self.robot.coupled.items() if driver == word))
        raise KeyError(word)

    def with_servo(self, **fields: np.ndarray) -> Plant:
        """Return the plant with other servo fields."""
        return replace(self, servo=replace(self.servo, **fields))


def nominal(robot: Robot) -> Plant:
    """Return the plant of a robot with nothing but its sourced constants."""
    joints = [robot.joint(name) for name in robot.motors]
    gains = np.array([robot.gains[name] for name in robot.motors])
    zero = np.zeros(len(joints))
    servo = Servo(
        kp=gains[:, 0],
        kd=gains[:, 1],
        limit=np.array([joint.effort for joint in joints]),
        no_load_speed=robot.no_load_speed * np.array([joint.max_velocity for joint in joints]),
        coulomb=zero,
        viscous=zero,
        armature=np.array([joint.armature for joint in joints]),
        delay=zero,
        play=zero,
    )
    return Plant(robot, servo, Contact(), Sensors(encoder_noise=zero))
