"""A learned servo: changes of a servo's own numbers joint by joint, and a law for what no number says."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.servo import Servo, numbers
from gsl.core.servo_law import HIDDEN, INPUTS, LAGS, NOBODY, ServoLaw
from gsl.core.slides import levers, power
from gsl.errors import ConfigError

FACTORS = ("kp", "kd", "limit")  # numbers that are multiplied
SUMS = ("delay", "coulomb", "viscous", "deadband", "armature", "offset")  # and those that are added to
LOSSES = ("load_friction", "duty_loss")  # and so are these, in replays alone: gradients leave them as they are
NUMBERS = (*FACTORS, *SUMS, *LOSSES)
SLIDES = "slides"  # group of the motors that slide, where others turn
UNLIMITED = 1e9  # in a checkpoint, which holds finite numbers alone
UNDAMPED = 0.02  # damping a stiffness [s] of a servo without, whose unit of friction would be none: a NAO's
LEAST_INERTIA = 0.2  # share of the rotor's inertia that is left: below it the joint is not stable at 2 ms


@dataclass(frozen=True)
class ServoModel:
    """A learned servo of a robot with n motors, which share networks in G groups.

    Attributes:
        robot: Name of the robot.
        joints: Its motors, in order.
        groups: Names of the groups.
        numbers: Logarithms of FACTORS [-], SUMS [s, N·m, N·m·s/rad, rad, kg·m², rad] and LOSSES [-], by name, shape
            (n,) each.
        lag: See `ServoLaw`, shape (n, LAGS).
        group: Of each motor, shape (n,).
        network: The other fields of `ServoLaw` by name.
        noise: Torque noise that explains what held-out motions leave: at every step and constant [N·m], shape (n, 2).
        base: The servo that it stands on, by field of `Servo`, shape (n,) each.
    """

    kind: ClassVar[str] = "servo_model"

    robot: str
    joints: tuple[str, ...]
    groups: tuple[str, ...]
    numbers: Mapping[str, np.ndarray]
    group: np.ndarray
    lag: np.ndarray
    network: Mapping[str, np.ndarray]
    noise: np.ndarray
    base: Mapping[str, np.ndarray]

    def on(self, plant: Plant) -> Plant:
        """Return a plant of the same robot whose servos are the learned ones."""
        servo, change = plant.servo, self.numbers
        fields = {name: getattr(servo, name) * np.exp(change[name]) for name in FACTORS}
        fields |= {name: np.maximum(0.0, getattr(servo, name) + change[name]) for name in (*SUMS[:-2], *LOSSES)}
        least = LEAST_INERTIA * servo.armature
        fields |= {"armature": np.maximum(least, servo.armature + change["armature"])}
        fields |= {"offset": servo.offset + change["offset"]}
        law = ServoLaw(self.group, servo.kp / servo.limit, servo.limit, self.lag, **self.network)
        return replace(plant.with_servo(**fields), law=law)

    def changes(self, name: str) -> bool:
        """Whether anything was learned of a group of joints."""
        own = self.group == self.groups.index(name)
        return bool(own.any()) and (
            any(values[own].any() for values in self.numbers.values())
            or bool(self.lag[own].any())
            or any(self.network[key][self.groups.index(name)].any() for key in ("last", "last_bias"))
        )

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint holds, by name."""
        numbers = {f"numbers.{name}": values for name, values in self.numbers.items()}
        network = {f"network.{name}": values for name, values in self.network.items()}
        base = {f"base.{name}": values for name, values in self.base.items()}
        return {**numbers, **network, **base, "group": self.group, "lag": self.lag, "noise": self.noise}

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says about it."""
        return {"kind": self.kind, "robot": self.robot, "joints": list(self.joints), "groups": list(self.groups)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> ServoModel:
        """Return the model of a checkpoint.

        Raises:
            KeyError: An array or a part of the description is missing.
            ValueError: An array has another shape.
        """
        joints, groups = tuple(about["joints"]), tuple(about["groups"])
        numbers = {name: arrays[f"numbers.{name}"] for name in NUMBERS}
        network = {name: arrays[f"network.{name}"] for name in NETWORK}
        wanted = {**{f"numbers.{name}": (len(joints),) for name in NUMBERS}, "lag": (len(joints), LAGS)}
        wanted |= {"group": (len(joints),), "noise": (len(joints), 2)}
        wanted |= {f"network.{k}": v for k, v in shapes(len(groups)).items()}
        wanted |= {f"base.{name}": (len(joints),) for name in Servo._fields}
        for name, shape in wanted.items():
            if arrays[name].shape != shape:
                raise ValueError(f"{name} has the shape {arrays[name].shape}, not {shape}")
        base = {name: arrays[f"base.{name}"] for name in Servo._fields}
        return cls(
            about["robot"], joints, groups, numbers, arrays["group"], arrays["lag"], network, arrays["noise"], base
        )

    def in_metres(self, plant: Plant, base: Plant) -> ServoModel:
        """Return a model that was learned with slides in angles for the same robot with slides in metres.

        Args:
            plant: On which it was learned, in angles.
            base: The same in metres.
        """
        way, units = levers(plant.robot), numbers()
        own = {name: self.numbers[name] * way ** -power(units[name].unit) for name in SUMS}
        return replace(self, numbers={**self.numbers, **own}, noise=self.noise / way[:, None], base=base_servo(base))

    def shift(self, plant: Plant, change: np.ndarray) -> ServoModel:
        """Return the model with numbers changed, in `units`, shape (NUMBERS, n_joints); coupled motors follow."""
        each = change[:, plant.robot.drive] * np.array([units(plant)[name] for name in NUMBERS])
        return replace(self, numbers={name: self.numbers[name] + each[k] for k, name in enumerate(NUMBERS)})

    def within(self, plant: Plant, longest: float) -> ServoModel:
        """Return the model with delays that a simulator can remember, `longest` [s] in all."""
        delay = np.minimum(self.numbers["delay"], longest - plant.servo.delay)
        return replace(self, numbers={**self.numbers, "delay": delay})


def units(plant: Plant) -> dict[str, np.ndarray]:
    """Return what one unit of each number is, shape (n,), in the units of `ServoModel.numbers`.

    About how far robots of one class are from their data sheets: see the ranges of the effects.
    """
    each, servo = np.ones(len(plant.servo.kp)), plant.servo
    damping = np.where(servo.kd > 0.0, servo.kd, UNDAMPED * servo.kp)
    damping = np.where(damping > 0.0, damping, UNDAMPED * np.minimum(servo.limit, UNLIMITED))  # driven by torques alone
    rotor = servo.armature + 1e-3 * damping
    return {
        "kp": 0.2 * each, "kd": 0.3 * each, "limit": 0.1 * each, "delay": 0.01 * each, "coulomb": 0.05 * servo.limit,
        "viscous": 0.1 * damping, "deadband": 0.003 * each, "armature": 0.3 * rotor,
        "offset": 0.005 * each, "load_friction": 0.1 * each, "duty_loss": 0.1 * each,
    }  # fmt: skip


NETWORK = ("first", "first_bias", "second", "second_bias", "last", "last_bias")


def shapes(groups: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of a network's arrays by name."""
    sizes = (INPUTS, HIDDEN), (HIDDEN,), (HIDDEN, HIDDEN), (HIDDEN,), (HIDDEN, 2), (2,)
    return {name: (groups, *size) for name, size in zip(NETWORK, sizes, strict=True)}


def neutral(plant: Plant, rng: np.random.Generator) -> ServoModel:
    """Return a learned servo that changes nothing, its hidden layers drawn at random.

    A motor of several groups is of the smallest one: a leg's knee belongs to the knees. Slides are like no hinge.
    """
    robot, n = plant.robot, len(plant.robot.motors)
    rest = "others" if robot.groups or 0 < len(robot.slides) < n else "all"
    member = {motor: SLIDES if motor in robot.slides and rest != "all" else rest for motor in robot.motors}
    for name in sorted(robot.groups, key=lambda name: -len(robot.groups[name])):
        member |= {motor: name for motor in robot.motors if motor in robot.groups[name]}
    names = tuple(dict.fromkeys(member[motor] for motor in robot.motors))
    group = np.array([names.index(member[motor]) for motor in robot.motors])
    arrays = {
        name: rng.standard_normal(shape) / np.sqrt(shape[1]) if name in ("first", "second") else np.zeros(shape)
        for name, shape in shapes(len(names)).items()
    }
    numbers = {name: np.zeros(n) for name in NUMBERS}
    lag, noise = np.zeros((n, LAGS)), np.zeros((n, 2))
    return ServoModel(robot.name, robot.motors, names, numbers, group, lag, arrays, noise, base_servo(plant))


def base_servo(plant: Plant) -> dict[str, np.ndarray]:
    """Return the servo below a learned one by field, shape (n,) each; what has no limit is `UNLIMITED`."""
    return {name: np.clip(array, -UNLIMITED, UNLIMITED) for name, array in plant.servo._asdict().items()}


def with_group(model: ServoModel, other: ServoModel, name: str) -> ServoModel:
    """Return the model with the joints of a group as in another model of the same robot."""
    g = model.groups.index(name)
    own = model.group == g
    numbers = {key: np.where(own, other.numbers[key], values) for key, values in model.numbers.items()}
    network = {key: values.copy() for key, values in model.network.items()}
    for key, values in network.items():
        values[g] = other.network[key][g]
    lag, group = np.where(own[:, None], other.lag, model.lag), np.where(own, other.group, model.group)
    return replace(model, numbers=numbers, lag=lag, group=group, network=network)


def with_groups(model: ServoModel, other: ServoModel, names: Iterable[str]) -> ServoModel:
    """Return the model with the joints of some groups as in another model of the same robot."""
    for name in names:
        model = with_group(model, other, name)
    return model


def without_group(model: ServoModel, name: str) -> ServoModel:
    """Return the model with the joints of a group as they were."""
    own = model.group == model.groups.index(name)
    numbers = {key: np.where(own, 0.0, values) for key, values in model.numbers.items()}
    lag, group = np.where(own[:, None], 0.0, model.lag), np.where(own, NOBODY, model.group)
    return replace(model, numbers=numbers, lag=lag, group=group)


def other_base(plant: Plant, model: ServoModel) -> str:
    """Return in what the servo below differs from the one that a model was learned on, nothing if it does not."""
    for name, own in base_servo(plant).items():
        values = model.base[name]
        if not np.allclose(own, values, rtol=1e-6, atol=0.0):
            k = int(np.argmax(~np.isclose(own, values, rtol=1e-6, atol=0.0)))
            return f"{name} of {model.joints[k]} was {values[k]:.4g} there and is {own[k]:.4g} here"
    return ""


def having_servo(plant: Plant, model: ServoModel, name: str) -> Plant:
    """Return a plant with a learned servo.

    Args:
        plant: The robot with its effects.
        model: The servo.
        name: What the user calls it.

    Raises:
        ConfigError: It is of another robot, or would be the second one.
    """
    robot = plant.robot
    if (model.robot, model.joints) != (robot.name, robot.motors):
        theirs = f"the {model.robot}" if model.robot != robot.name else "other joints"
        raise ConfigError("servo", f"was learned for {theirs}, the world has the {robot.name}", given=name)
    return model.on(plant)
