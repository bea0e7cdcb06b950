"""A simulator's servos as actuators of Isaac Lab: implicit ones, or delayed PD where commands arrive late."""

from __future__ import annotations

import numpy as np

from gsl.core.plant import Plant
from gsl.export.parts import UNLIMITED, Export, Simulator, unheld

HELD = ("kp", "kd", "limit", "coulomb", "viscous", "armature", "delay")
REMARKS = {"no_load_speed": "DCMotorCfg has such a line, by saturation_effort and velocity_limit, but no delay"}
_HEAD = '''"""{robot} in Isaac Lab: ArticulationCfg(actuators=ACTUATORS). Physics steps: {step:g} s.

Frictions are efforts [N·m], of slides [N], as in Isaac Lab 2.2 and later on Isaac Sim 5 and later.{missing}
"""

from isaaclab.actuators import {kinds}

ACTUATORS = {{
'''


def export_isaac(simulator: Simulator) -> Export:
    """Return a module with the dictionary ACTUATORS; joints of one delay are a group."""
    plant, step = simulator.plant, simulator.step
    steps = np.round(plant.servo.delay / step).astype(int)
    missing = unheld(plant, HELD, REMARKS)
    rounded = np.abs(steps * step - plant.servo.delay) > 1e-9
    if rounded.any():
        k = int(np.argmax(rounded))
        missing.append(f"delay in whole physics steps: {steps[k] * step:g} s for {plant.servo.delay[k]:.4g} s")
    groups = "".join(_group(plant, np.flatnonzero(steps == count), int(count)) for count in np.unique(steps))
    kinds = ", ".join(sorted({_kind(int(count)) for count in steps}))
    notes = "".join(f"\nNot held: {line}." for line in missing)
    head = _HEAD.format(robot=plant.robot.name, step=step, kinds=kinds, missing=f"\n{notes}" if notes else "")
    return Export({f"{simulator.name}_isaac_lab.py": f"{head}{groups}}}\n"}, missing)


def _kind(steps: int) -> str:
    return "DelayedPDActuatorCfg" if steps else "ImplicitActuatorCfg"


def _group(plant: Plant, members: np.ndarray, steps: int) -> str:
    servo, names = plant.servo, [plant.robot.motors[k] for k in members]
    limit = "effort_limit" if steps else "effort_limit_sim"
    values = {
        "stiffness": servo.kp, "damping": servo.kd, "armature": servo.armature, "friction": servo.coulomb,
        "dynamic_friction": servo.coulomb, "viscous_friction": servo.viscous,
    }  # fmt: skip
    if (servo.limit[members] < UNLIMITED).all():
        values[limit] = servo.limit
    lines = [f'    "delay_{steps}_steps": {_kind(steps)}(', f"        joint_names_expr={names!r},"]
    for key, numbers in values.items():
        each = {name: float(f"{numbers[k]:.6g}") for name, k in zip(names, members, strict=True)}
        lines.append(f"        {key}={each!r},")
    if steps:
        lines += [f"        min_delay={steps},", f"        max_delay={steps},"]
    return "\n".join([*lines, "    ),", ""])
