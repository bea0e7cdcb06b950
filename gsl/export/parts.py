"""What a simulator is made of for other tools: files by name, and a line for everything that a format cannot hold."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gsl.core.plant import Plant, nominal
from gsl.core.servo import numbers
from gsl.core.slides import unit_of_slide

UNLIMITED = 1e6  # a torque limit or speed beyond which there is none


class Simulator(NamedTuple):
    """What is exported.

    Attributes:
        plant: Robot, servos and the rest.
        step: Physics period [s].
        period: Control period [s].
        floating: Whether the base is free.
        name: Of the files.
    """

    plant: Plant
    step: float
    period: float
    floating: bool
    name: str


class Export(NamedTuple):
    """What a format makes of a simulator.

    Attributes:
        files: Contents by file name.
        missing: What it cannot hold, a line each.
        lacking: Libraries for want of which a file was left out, by the name that they are imported by.
    """

    files: Mapping[str, str | bytes]
    missing: Sequence[str]
    lacking: Sequence[str] = ()


def unheld(plant: Plant, held: Collection[str], remarks: Mapping[str, str] | None = None) -> list[str]:
    """Return a line for everything that acts in a simulator and that a format cannot hold.

    Args:
        plant: The simulator.
        held: Numbers of the servo that the format has, and of `surroundings`.
        remarks: What to do about a number that it has not, by name.
    """
    remarks = remarks or {}
    lines = [line for name, line in _servo(plant) if name not in held for line in [_with(line, remarks.get(name))]]
    return lines + [_with(line, remarks.get(name)) for name, line in _surroundings(plant) if name not in held]


def _with(line: str, remark: str | None) -> str:
    return f"{line}; {remark}" if remark else line


def _servo(plant: Plant) -> Iterator[tuple[str, str]]:
    unused = {"stribeck_velocity": "stribeck", "supply_resistance": "supply_resistance"}
    for name, number in numbers().items():
        values = getattr(plant.servo, name)
        if name == "torque_constant" or (name in unused and not getattr(plant.servo, unused[name]).any()):
            continue
        acting = [k for k, value in enumerate(values) if value != number.inert]
        if acting:
            joint = plant.robot.motors[acting[0]]
            rest = f" and {len(acting) - 1} more joints" if len(acting) > 1 else ""
            unit = unit_of_slide(number.unit) if joint in plant.robot.slides else number.unit
            yield (
                name,
                f"{name} ({number.meaning}): {values[acting[0]]:.4g} {unit} at {joint}{rest}".replace("  ", " "),
            )


def _surroundings(plant: Plant) -> Iterator[tuple[str, str]]:
    bare = nominal(plant.robot)
    parts: Mapping[str, tuple[bool, str]] = {
        "law": (plant.law is not None, "learned servo: format=servo writes it as TorchScript and ONNX"),
        "hook": (plant.hook is not None, "a torque hook of your own"),
        "action_noise": (bool(plant.action_noise.any()), "action noise"),
        "torque_noise": (bool(plant.torque_noise.any()), "torque noise"),
        "encoder_noise": (bool(plant.sensors.encoder_noise.any()), "noise of the encoders"),
        "bias": (bool(plant.sensors.bias.any()), "bias of the encoders"),
        "pushes": (bool(plant.pushes), "pushes from outside"),
        "contact": (plant.contact != bare.contact, "changes of the ground"),
        "gravity": (not np.array_equal(plant.gravity, bare.gravity), "tilted gravity"),
    }
    yield from ((name, line) for name, (acts, line) in parts.items() if acts)


def by_joint(plant: Plant, values: np.ndarray) -> dict[str, float]:
    """Return numbers by motor."""
    return dict(zip(plant.robot.motors, map(float, values), strict=True))


def text(*values: float) -> str:
    """Return numbers for an XML attribute, to ten digits."""
    return " ".join(f"{value:.10g}" for value in values)
