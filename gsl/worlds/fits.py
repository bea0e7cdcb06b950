"""Whether a plant can be simulated with a world's periods: servos remember only so much, and play needs a rotor."""

from __future__ import annotations

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.plant import Plant
from gsl.errors import ConfigError, InputError
from gsl.worlds.encoder import REMEMBERED
from gsl.worlds.held import refuse_hook
from gsl.worlds.servo_state import COMMANDS
from gsl.worlds.velocity_motors import Motors, check_servos


def check_periods(step: float, period: float) -> None:
    """Refuse a control period that is not a multiple of the physics period, both in [s].

    Raises:
        ConfigError: if it is not.
    """
    ratio = period / step
    if abs(ratio - round(ratio)) > 1e-9 or ratio < 1.0:
        raise ConfigError("period", f"{period} s is not a multiple of the physics step {step} s")


def fitting_step(step: float, period: float) -> float:
    """Return the physics period nearest to `step` that divides the control period [s]."""
    return period / max(1, round(period / step))


def check_plant(plant: Plant, step: float, period: float) -> None:
    """Refuse a plant whose servos cannot be simulated.

    Args:
        plant: The robot with its effects.
        step: Physics period [s].
        period: Control period [s].

    Raises:
        ConfigError: if a delay is longer than what is remembered, or a joint has play and no rotor.
    """
    servo = plant.servo
    _check_delay("command_latency", servo.delay.max(), COMMANDS - 1, period, "control periods")
    _check_delay("sensor_delay", servo.sensor_delay.max(), REMEMBERED, step, "physics steps")
    for name, size in (("backlash", servo.play), ("joint_compliance", servo.compliance)):
        bare = (size > 0.0) & (servo.armature <= 0.0)
        if bare.any():
            joint = plant.robot.motors[int(np.argmax(bare))]
            raise ConfigError(f"effects.{name}.joints", f"{joint} has no rotor; effects.armature.inertia gives it one")


def check_replayable(motors: Motors, plant: Plant) -> None:
    """Refuse a simulator in which logs of joints cannot be replayed and compared.

    Args:
        motors: Of the simulator.
        plant: Of the simulator.

    Raises:
        ConfigError: Its joints are turned by velocity motors, or it has a torque hook.
    """
    check_servos(motors)
    refuse_hook(plant)


def check_hinges(robot: Robot, log: str) -> None:
    """Refuse a log of a robot on the ground whose joints slide: Bullet replays it, in metres.

    Raises:
        InputError: Some of them do.
    """
    if robot.slides:
        problem = f"on the ground no log of joints that slide is compared, and {', '.join(robot.slides)} slide"
        raise InputError(f"{log}: {problem}; log the robot in the air")


def check_base(robot: Robot, *, floating: bool) -> None:
    """Refuse to let a robot go that has no weight of its own, or no feet to stand on.

    Raises:
        ConfigError: if it would have to.
    """
    if floating and (lump(robot).links[robot.base].mass <= 0.0 or not robot.feet):
        raise ConfigError("floating", f"the {robot.name} has no feet to stand on; say floating=false", given="true")


def _check_delay(name: str, delay: float, count: int, length: float, what: str) -> None:
    if delay > count * length + 1e-9:
        line = f"at most {count * length:g} s are remembered, {count} {what} of {length:g} s"
        raise ConfigError(f"effects.{name}.delay", line, given=f"{delay:g}")
