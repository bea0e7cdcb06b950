"""Joints whose calibration is further off than robots of one make differ by, and by how much."""

from __future__ import annotations

import numpy as np

from gsl.diagnosis import nuisance
from gsl.diagnosis.diagnose import Findings

FAR_OFF = 4.5  # spreads of the calibration from which on it is told: nearly what a rotor may be too light by


def far_off(found: Findings) -> list[str]:
    """Return the joints whose calibration is far off, each with all that is, the furthest first."""
    exp, sizes = found.experiment, found.simulator.spread * nuisance.SIZES[:, None]
    fitted = found.answer.fit.nuisances[:, : len(exp.joints)]
    off = np.abs(fitted / sizes)
    inertias = nuisance.inertia_unit(found.uncalibrated.servo)
    told = []
    for k, joint in enumerate(exp.joints):
        rows = [row for row in np.argsort(-off[:, k]) if off[row, k] >= FAR_OFF]
        shifts = [_shift(row, fitted[row, k], exp.robot.torque_unit, inertias[k]) for row in rows]
        told += [f"{joint} ({', '.join(shifts)})"] if shifts else []
    return told


def _shift(row: int, value: float, torque_unit: float, inertia_unit: float) -> str:
    name = nuisance.NAMES[row]
    if row in (nuisance.KP, nuisance.KD):
        return f"{name} × {np.exp(value):.2f}"
    if row in (nuisance.ZERO, nuisance.OFFSET):
        return f"{name} {1e3 * value:+.0f} mrad"
    if row == nuisance.INERTIA:
        end = ", at its limit" if value in nuisance.INERTIAS else ""
        return f"inertia {1e3 * inertia_unit * value:+.2g} g·m²{end}"
    unit = "N·m" if row == nuisance.COULOMB else "N·m·s/rad"
    return f"{name} {torque_unit * value:+.2g} {unit}"
