"""A simulator's servos as parameters of Rhoban's bam, model M4, a JSON file a joint."""

from __future__ import annotations

import json

from gsl.export.parts import Export, Simulator, unheld

HELD = ("coulomb", "viscous", "stribeck", "stribeck_velocity", "load_friction", "armature", "offset", "delay", "limit")
REMARKS = {
    "kp": "bam's actuator has a firmware gain of its own, kp and error_gain; set these",
    "kd": "bam's damping is the motor's back EMF, kt² / R",
    "no_load_speed": "bam's follows from kt and the voltage",
}


def export_bam(simulator: Simulator, actuator: str) -> Export:
    """Return the files; kt and R are such that the torque limit is what the supply's voltage gives at rest.

    Args:
        simulator: Whose servos.
        actuator: bam's name of the servo, such as `xl330`.
    """
    plant, servo = simulator.plant, simulator.plant.servo
    files: dict[str, str | bytes] = {}
    for k, joint in enumerate(plant.robot.motors):
        kt = float(servo.torque_constant[k])
        entries = {
            "kt": kt,
            "R": kt * plant.robot.supply_voltage / float(servo.limit[k]),
            "armature": float(servo.armature[k]),
            "q_offset": float(servo.offset[k]),
            "command_delay": float(servo.delay[k]),
            "friction_base": float(servo.coulomb[k]),
            "friction_stribeck": float(servo.stribeck[k]),
            "load_friction_base": float(servo.load_friction[k]),
            "load_friction_stribeck": 0.0,
            "dtheta_stribeck": float(servo.stribeck_velocity[k]),
            "alpha": 2.0,
            "friction_viscous": float(servo.viscous[k]),
            "model": "m4",
            "actuator": actuator,
        }
        files[f"{simulator.name}_bam_{joint}.json"] = json.dumps(entries, indent=2) + "\n"
    return Export(files, unheld(plant, HELD, REMARKS))
