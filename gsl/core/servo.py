"""The numbers of a joint servo, declared once: name, meaning, unit, and the value that does nothing.

    kp: Annotated[T, Number("proportional gain", "N·m/rad")]

The kernel reads a number as `rows[ROW.kp, i]`; packing, learned servos, tests and docs follow from the declaration.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Generic, NamedTuple, get_type_hints

import numpy as np
from typing_extensions import TypeVar

T = TypeVar("T", default=np.ndarray)


class Number(NamedTuple):
    """What a number of a servo is.

    Attributes:
        meaning: A few words.
        unit: SI unit, empty for a pure number.
        inert: The value that does nothing.
    """

    meaning: str
    unit: str = ""
    inert: float = 0.0


class Servo(NamedTuple, Generic[T]):
    """One joint servo per motor: every number is an array of shape (n_motors,).

        u = kp (1 - fade t) dead(target + offset - q) - kd dq/dt, within the torque limit and the speed line
        torque = u (1 - duty_loss |u| / limit) - viscous dq/dt - dry friction

    The order is that of the kernel's rows.
    """

    kp: Annotated[T, Number("proportional gain", "N·m/rad")]
    kd: Annotated[T, Number("derivative gain", "N·m·s/rad")]
    limit: Annotated[T, Number("torque limit", "N·m", np.inf)]
    no_load_speed: Annotated[T, Number("speed at which driving torque vanishes", "rad/s", np.inf)]
    coulomb: Annotated[T, Number("dry friction at the output", "N·m")]
    viscous: Annotated[T, Number("friction proportional to speed", "N·m·s/rad")]
    stribeck: Annotated[T, Number("dry friction added at low speed", "N·m")]
    stribeck_velocity: Annotated[T, Number("how low that speed is", "rad/s", 1.0)]
    load_friction: Annotated[T, Number("dry friction added per torque in the gear")]
    armature: Annotated[T, Number("rotor inertia seen at the output", "kg·m²")]
    delay: Annotated[T, Number("how much later the target arrives", "s")]
    smoothing: Annotated[T, Number("time constant of the filter on the target", "s")]
    quantum: Annotated[T, Number("step of the target", "rad")]
    deadband: Annotated[T, Number("half width of the errors that the servo ignores", "rad")]
    play: Annotated[T, Number("full width of the backlash between rotor and output", "rad")]
    compliance: Annotated[T, Number("of the spring between rotor and output", "rad/(N·m)")]
    supply_resistance: Annotated[T, Number("of the common supply as the motor's limits see it", "Ω")]
    torque_constant: Annotated[T, Number("torque per current, at the output", "N·m/A", 1.0)]
    duty_loss: Annotated[T, Number("share of the driving torque lost at the torque limit")]
    fade: Annotated[T, Number("share of kp lost in a second of the episode", "1/s")]
    offset: Annotated[T, Number("of the joint's zero: it goes to target + offset", "rad")]
    sensor_delay: Annotated[T, Number("age of what the encoder reports to servo and log", "s")]
    lower_stop: Annotated[T, Number("where the joint hits something hard, below", "rad", -np.inf)]
    upper_stop: Annotated[T, Number("where the joint hits something hard, above", "rad", np.inf)]
    motor_encoder: Annotated[T, Number("1 where the encoder is on the motor's side of play and compliance, else 0")]

    @classmethod
    def of(cls, **values: np.ndarray) -> Servo:
        """Return servos with these numbers, the others such that they do nothing."""
        zero = np.zeros(len(next(iter(values.values()))))
        return Servo(**{name: values.get(name, zero + each.inert) for name, each in numbers().items()})


ROW = Servo(*range(len(Servo._fields)))
"""The row of each number in the kernel's parameters."""


def numbers() -> Mapping[str, Number]:
    """Return what each number of a servo is, by name, in order."""
    hints = get_type_hints(Servo, include_extras=True)
    return {name: hints[name].__metadata__[0] for name in Servo._fields}
