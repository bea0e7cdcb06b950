"""A simulator's servos as plain JSON: every number of every joint, with meaning and unit."""

from __future__ import annotations

import numpy as np

from gsl.core.servo import numbers
from gsl.core.slides import unit_of_slide
from gsl.export.parts import Export, Simulator, by_joint, unheld
from gsl.storage.documents import pretty


def export_json(simulator: Simulator) -> Export:
    """Return one file; what has no limit is null."""
    plant = simulator.plant
    held = {
        name: {
            "meaning": number.meaning,
            "unit": number.unit,
            **({"unit_of_slides": unit_of_slide(number.unit)} if plant.robot.slides else {}),
            "joints": {
                joint: value if np.isfinite(value) else None
                for joint, value in by_joint(plant, getattr(plant.servo, name)).items()
            },
        }
        for name, number in numbers().items()
    }
    document = {
        "robot": plant.robot.name,
        "joints": list(plant.robot.motors),
        "slides": list(plant.robot.slides),
        "step": simulator.step,
        "control_period": simulator.period,
        "gravity": plant.gravity.tolist(),
        "law": "torque = clip(kp (target + offset - q) - kd dq/dt, limit) - friction; see gsl/worlds/servo.py",
        "servo": held,
    }
    return Export({f"{simulator.name}.json": pretty(document)}, unheld(plant, (*numbers(), "gravity")))
