"""Claims that a hypothesis cannot uphold: values beyond their documented range, or against a channel of the log.

A voltage, a temperature or a torque that was logged takes no part in any fit: it can only refute a name.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis import nuisance
from gsl.diagnosis.attribute import Hypothesis
from gsl.diagnosis.experiment import Experiment
from gsl.diagnosis.records import Record
from gsl.effects.effect import applied, built

SPREAD = (2.0, 98.0)  # percentiles between which a channel moves
LEAST_SAG, SHARE = 0.2, 0.5  # predicted sag that a log has to show [V], and the least part of it that it must
LEAST_WARMTH = 1.0  # by which a motor warms up in an episode before its gain can fade for it [°C]
WORSE = 1.3  # factor on the error of a predicted torque, without a cause over with it, that refutes the cause


def refuted(hypothesis: Hypothesis, found: Experiment, plant: Plant) -> dict[str, str]:
    """Return the effects of a hypothesis that lose their claim to the name, with the reason.

    Args:
        hypothesis: Fitted.
        found: The log.
        plant: The simulator without it.
    """
    reasons: dict[str, str] = {}
    n = len(found.joints)
    with_it = nuisance.calibrated(applied(plant, built(hypothesis.effects)), hypothesis.fit.nuisances[:, :n])
    for candidate, values in zip(hypothesis.candidates, hypothesis.parameters, strict=True):
        told = ", ".join(f"{name} {value:.3g}" for name, value in zip(candidate.free, values, strict=True))
        if not candidate.claims_its_name(values):
            reasons[candidate.effect] = f"it would take {told}, outside the documented range"
        elif reason := _RULES.get(candidate.effect, _silent)(found, plant, with_it):
            reasons[candidate.effect] = reason
    return reasons


def _silent(found: Experiment, plant: Plant, with_it: Plant) -> str | None:
    return None


def _no_sag(found: Experiment, plant: Plant, with_it: Plant) -> str | None:
    """Whether the supply's logged voltage falls by much less than the current would have it."""
    voltage = _logged(found, "voltage")
    if voltage is None:
        return None
    current = np.concatenate(
        [(np.abs(_torque(with_it, record)) / with_it.servo.torque_constant).sum(axis=1) for record in found.records]
    )
    fall = float(with_it.servo.supply_resistance.max() * np.ptp(np.percentile(current, SPREAD)))
    seen = float(np.ptp(np.percentile(voltage, SPREAD)))
    if fall < LEAST_SAG or seen >= SHARE * fall:
        return None
    return f"the logged voltage moves by {seen:.2g} V where it would take {fall:.2g} V"


def _no_warmth(found: Experiment, plant: Plant, with_it: Plant) -> str | None:
    """Whether no logged motor that fades gets warm."""
    fading = [name for k, name in enumerate(found.joints) if with_it.servo.fade[k] > plant.servo.fade[k]]
    logs = [record.sensors.get(f"temperature.{name}") for record in found.records for name in fading]
    rises = [float(log.max() - log[0]) for log in logs if log is not None]
    if not rises or max(rises) >= LEAST_WARMTH:
        return None
    return f"no motor gets warmer than {max(rises):.2g} °C in an episode"


def _other_torque(found: Experiment, plant: Plant, with_it: Plant) -> str | None:
    """Whether the logged torques are those of the servo without the cause."""
    errors = np.zeros(2)
    changed = (with_it.servo.limit != plant.servo.limit) | ~np.isclose(with_it.servo.kp, plant.servo.kp, rtol=0.1)
    for record in found.records:
        for k, name in enumerate(found.joints):
            if changed[k] and f"torque.{name}" in record.sensors:
                measured = record.sensors[f"torque.{name}"][:-1]
                errors += [np.sum((_torque(one, record)[:, k] - measured) ** 2) for one in (with_it, plant)]
    if errors[0] <= WORSE**2 * errors[1]:
        return None
    return "the logged torques are those of a servo without it"


_RULES: dict[str, Callable[[Experiment, Plant, Plant], str | None]] = {
    "supply_sag": _no_sag,
    "gain_fade": _no_warmth,
    "torque_limit": _other_torque,
    "servo_gain": _other_torque,
}


def _logged(found: Experiment, name: str) -> np.ndarray | None:
    """Return a channel of all records that have it, end to end, None if none has."""
    logs = [record.sensors[name] for record in found.records if name in record.sensors]
    return np.concatenate(logs) if logs else None


def _torque(plant: Plant, record: Record) -> np.ndarray:
    """Return what servos ask for at each command [N·m], latency and friction apart, shape (T, n_motors)."""
    servo, drive = applied(plant, built(record.conditions)).servo, plant.robot.drive
    error = record.targets + servo.offset - record.position[:-1][:, drive]
    return np.clip(servo.kp * error - servo.kd * record.velocity[:-1][:, drive], -servo.limit, servo.limit)
