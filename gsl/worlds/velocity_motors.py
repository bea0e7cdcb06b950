"""Velocity motors: the engine's constraint turns every joint so that it is on its target at the next control tick.

    target <- command(t - delay), smoothed, rounded                 as in servo.py, once a control period T
    speed   = clip(dead(target + offset - q) / T, +-max_velocity)   asked of the engine for the whole period
    torque  = what the engine's solver needs for that speed, at most the torque limit

SimSpark moves its joints so: an agent sends a speed every 20 ms, the effector clips it at the joint's greatest speed
and hands it to the motor of ODE's hinge (dParamVel), which has a greatest torque (dParamFMax). The
joint follows a path one tick late. It does not yield to a load below the torque limit: such motors are stiff.
There is no gain, no friction and no rotor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gsl.core.compiled import compile_inner
from gsl.core.plant import Plant
from gsl.core.servo import ROW, Servo
from gsl.effects.effect import Effect, name_of
from gsl.errors import ConfigError
from gsl.worlds.servo import delay_command, shape_target
from gsl.worlds.servo_state import ServoState

Motors = Literal["servo", "velocity"]
HEARD = {"limit", "delay", "smoothing", "quantum", "deadband", "offset"}  # fields of a servo that act here


@dataclass(frozen=True)
class VelocityMotors:
    """The motors of a plant.

    Attributes:
        parameters: Of the servos, from `servo.packed`; only those of `HEARD` are read.
        fastest: Greatest speed [rad/s], shape (n_motors,).
    """

    parameters: np.ndarray
    fastest: np.ndarray

    @classmethod
    def of(cls, plant: Plant, parameters: np.ndarray) -> VelocityMotors:
        """Return the motors of a plant, given its servos' parameters."""
        joints = [plant.robot.joint(name) for name in plant.robot.motors]
        return cls(parameters, np.array([joint.max_velocity for joint in joints]))

    def run(
        self, bullet: Any, client: int, body: int, joints: Sequence[int], substeps: int, step: float,
        state: ServoState, outside: Callable[[np.ndarray, float], np.ndarray] | None,
    ) -> None:  # fmt: skip
        """Step Bullet through a control period.

        Args:
            bullet: The module.
            client: pybullet's number of the client.
            body: pybullet's number of the robot.
            joints: Bullet's numbers of the motors.
            substeps: Physics steps.
            step: Physics period [s].
            state: Its filters move on; `commands` and `clock` are the caller's.
            outside: Given motion and time, applies what acts from outside; None where nothing does.
        """
        motion = _motion(bullet, client, body, joints)
        speed = np.empty(len(joints))
        ask_speed(self.parameters, state, motion[0], self.fastest, substeps * step, speed)
        bullet.setJointMotorControlArray(
            body, joints, bullet.VELOCITY_CONTROL, targetVelocities=speed.tolist(),
            velocityGains=[1.0] * len(joints), forces=self.parameters[ROW.limit].tolist(), physicsClientId=client,
        )  # fmt: skip
        for k in range(substeps):
            if outside is not None:
                outside(motion, float(state.clock[0]) + k * step)
            bullet.stepSimulation(client)


@compile_inner
def ask_speed(
    parameters: np.ndarray, state: ServoState, position: np.ndarray, fastest: np.ndarray, period: float,
    speed: np.ndarray,
) -> None:  # fmt: skip
    """Fill `speed` [rad/s] for one control period and move the filters of `state` on.

    Args:
        parameters: From `servo_state.pack`.
        state: Its newest command is issued now.
        position: Of the joints now [rad], shape (n_motors,).
        fastest: Greatest speed [rad/s], shape (n_motors,).
        period: Control period [s].
        speed: Result, shape (n_motors,).
    """
    for i in range(len(position)):
        target = delay_command(state.commands, i, -parameters[ROW.delay, i] / period, 1.0)
        target = shape_target(parameters, state.memory, i, target, period)
        error = target + parameters[ROW.offset, i] - position[i]
        error -= min(parameters[ROW.deadband, i], max(-parameters[ROW.deadband, i], error))
        speed[i] = min(fastest[i], max(-fastest[i], error / period))


def check_motors(plant: Plant, effects: Iterable[Effect]) -> None:
    """Refuse effects that act on what velocity motors do not have.

    Args:
        plant: Without them.
        effects: In the order in which they are applied.

    Raises:
        ConfigError: One of them does.
    """
    for effect in effects:
        after = effect.apply(plant)
        changed = {
            name
            for name, before, now in zip(Servo._fields, plant.servo, after.servo, strict=True)
            if not np.array_equal(before, now)
        }
        if changed - HEARD or after.hook is not None or after.torque_noise.any():
            raise ConfigError(
                f"effects.{name_of(effect)}", "does not act on velocity motors; leave it out, or take motors=servo"
            )
        plant = after


def check_servos(motors: Motors, setting: str = "sim.motors") -> None:
    """Refuse a simulator that cannot be diagnosed: the chain model, which replays logs, has servos.

    Args:
        motors: Of the simulator.
        setting: That the user would have to change.

    Raises:
        ConfigError: Its joints are turned by velocity motors.
    """
    if motors != "servo":
        raise ConfigError(
            setting, "logs are replayed with servos alone; take a simulator with motors=servo", given=motors
        )


def _motion(bullet: Any, client: int, body: int, joints: Sequence[int]) -> np.ndarray:
    motion = np.empty((2, len(joints)))
    motion[0], motion[1], _, _ = zip(*bullet.getJointStates(body, joints, client), strict=True)
    return motion
