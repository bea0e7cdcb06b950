"""Joints that slide in angles, so that all that is said in radians and newton metres counts for them as well.

    angle = position / lever        torque = force · lever        inertia = mass · lever²

The lever of a slide is its `Joint.size`, and its axis in angles is as long. Robots of hinges stay what they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from gsl.core.body import Joint, Robot
from gsl.core.plant import Plant
from gsl.core.servo import numbers


def power(unit: str) -> int:
    """Return with which power of the lever a quantity in angles grows: -1 of rad, 1 of N·m, 2 of kg·m²."""
    over, _, under = unit.partition("/")
    counts = [part.count("N·m") + 2 * part.count("kg·m²") - part.count("rad") for part in (over, under)]
    return counts[0] - counts[1]


def unit_of_slide(unit: str) -> str:
    """Return the unit of a slide for that of a hinge: m for rad, N for N·m, kg for kg·m²."""
    return unit.replace("(N·m)", "N").replace("N·m", "N").replace("kg·m²", "kg").replace("rad", "m")


def levers(robot: Robot) -> np.ndarray:
    """Return metres in the unit of each motor's position, shape (n_motors,): 1 unless the robot is in angles."""
    return np.array([robot.joint(name).lever for name in robot.motors])


def choose_levers(robot: Robot) -> np.ndarray:
    """Return the levers of a robot in angles, shape (n_motors,): a follower has that of its leader."""
    return np.array([robot.joint(robot.coupled.get(name, name)).size for name in robot.motors])


def in_angles(plant: Plant) -> Plant:
    """Return a plant with its slides in angles; itself where none slides, or where they are in angles already."""
    return _in_units(plant, choose_levers(plant.robot))


def in_metres(plant: Plant) -> Plant:
    """Return a plant whose slides were in angles, as it was."""
    return _in_units(plant, 1.0 / levers(plant.robot))


def _in_units(plant: Plant, ratio: np.ndarray) -> Plant:
    """Return the plant with units of position that are so many times as long, (n_motors,); itself where none is."""
    if np.allclose(ratio, 1.0):
        return plant
    servo = {name: getattr(plant.servo, name) * ratio ** power(each.unit) for name, each in numbers().items()}
    sensors = {name: getattr(plant.sensors, name) / ratio for name in ("encoder_noise", "bias")}
    law = plant.law
    return replace(
        plant,
        robot=_robot_in_units(plant.robot, dict(zip(plant.robot.motors, ratio.tolist(), strict=True))),
        servo=plant.servo._replace(**servo),
        sensors=replace(plant.sensors, **sensors),
        action_noise=plant.action_noise / ratio,
        torque_noise=plant.torque_noise * ratio,
        law=law and law._replace(stiffness=law.stiffness * ratio, torque=law.torque * ratio),
    )


def _robot_in_units(robot: Robot, ratio: Mapping[str, float]) -> Robot:
    def scale(values: Mapping[str, Any], exponent: int) -> dict[str, Any]:
        return {
            name: tuple(np.multiply(value, ratio.get(name, 1.0) ** exponent).tolist()) for name, value in values.items()
        }

    return replace(
        robot,
        joints=tuple(
            _joint_in_units(joint, ratio[joint.name]) if joint.name in ratio else joint for joint in robot.joints
        ),
        gains=scale(robot.gains, 2),
        torque_constant={name: value * ratio.get(name, 1.0) for name, value in robot.torque_constant.items()},
        stance={name: value / ratio.get(name, 1.0) for name, value in robot.stance.items()},
        soft=scale(robot.soft, -1),
    )


def _joint_in_units(joint: Joint, ratio: float) -> Joint:
    return replace(
        joint,
        axis=joint.axis * ratio,
        lower=joint.lower / ratio,
        upper=joint.upper / ratio,
        max_velocity=joint.max_velocity / ratio,
        effort=joint.effort * ratio,
        armature=joint.armature * ratio**2,
    )
