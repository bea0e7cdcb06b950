"""The diagnosed world: the simulator's configuration with what was found switched on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis import nuisance
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.replay import Effects
from gsl.effects.effect import together
from gsl.storage.diagnosis_report import DIGITS


def diagnosed_effects(found: Findings) -> dict[str, Any]:
    """Return what the simulator lacks: the reference's findings, the diagnosed effects, then the calibration.

    Every entry is one of a world's `effects:`; the calibration comes joint by joint. Where nothing may be named it is
    all there is.
    """
    joints, chosen = found.experiment.joints, found.answer
    parts = [chosen.effects, calibration(joints, chosen.fit.nuisances[:, : len(joints)], found.uncalibrated)]
    if found.baseline is not None:
        parts = [found.baseline.effects, calibration(joints, found.baseline.nuisances, found.simulator.plant), *parts]
    return joined(parts)


def calibration(joints: Sequence[str], nuisances: np.ndarray, plant: Plant) -> Effects:
    """Return nuisances, shape (7, n_joints), as effects of single joints of a plant, other effects in it already."""
    rows = {joint: nuisances[:, k] for k, joint in enumerate(joints)}
    unit, torque = nuisance.inertia_unit(plant.servo), plant.robot.torque_unit
    lightest = (nuisance.LEAST - 1.0) * plant.servo.armature
    return {
        "servo_gain": [
            {"kp": np.exp(row[nuisance.KP]), "kd": np.exp(row[nuisance.KD]), "joints": joint}
            for joint, row in rows.items()
        ],
        "coulomb_friction": [
            {"torque": torque * row[nuisance.COULOMB], "joints": joint} for joint, row in rows.items()
        ],
        "viscous_friction": [
            {"coefficient": torque * row[nuisance.VISCOUS], "joints": joint} for joint, row in rows.items()
        ],
        "armature": [
            {"inertia": max(row[nuisance.INERTIA] * unit[k], lightest[k]), "joints": joint}
            for k, (joint, row) in enumerate(rows.items())
        ],
        "sensor_bias": [{"bias": row[nuisance.ZERO], "joints": joint} for joint, row in rows.items()],
        "zero_offset": [{"offset": row[nuisance.OFFSET], "joints": joint} for joint, row in rows.items()],
    }


def joined(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return several `effects:` mappings as one, numbers rounded to what a file should show."""
    return {name: [_rounded(entry) for entry in entries] for name, entries in together(parts).items()}


def _rounded(entry: Mapping[str, Any]) -> dict[str, Any]:
    return {key: round(float(value), DIGITS) if isinstance(value, float) else value for key, value in entry.items()}
