"""Plausibility: claims that a hypothesis cannot uphold, by its documented ranges, intervals or a channel of the log.

A voltage, a temperature or a torque that was logged takes no part in any fit: it can only refute a name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gsl.core.body import Robot
from gsl.core.other_commands import split_other_commands
from gsl.core.plant import Plant
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.log.records import Record
from gsl.diagnosis.settings import PlausibilitySettings
from gsl.diagnosis.simulate.in_the_air import change


@dataclass(frozen=True)
class Evidence:
    """What a claim is held against: the log, and the plant without the hypothesis and with it."""

    log: Log
    plant: Plant
    with_it: Plant
    settings: PlausibilitySettings


def refute(
    hypothesis: Hypothesis, log: Log, plant: Plant, settings: PlausibilitySettings | None = None
) -> dict[str, str]:
    """Return the effects of a hypothesis that lose their claim to the name, with the reason.

    Args:
        hypothesis: With its fit.
        log: The log.
        plant: The simulator without it.
        settings: What a channel has to show.
    """
    with_it = change(plant, hypothesis.effects, hypothesis.fit.shifts[:, : len(log.joints)])
    evidence = Evidence(log, plant, with_it, settings or PlausibilitySettings())
    reasons: dict[str, str] = {}
    for candidate, values in hypothesis.pairs:
        numbers = zip(candidate.free, candidate.tell(log.robot, values), strict=True)
        parameters = ", ".join(f"{name} {value:.3g}" for name, value in numbers)
        rule = _RULES.get(candidate.effect)
        if not candidate.claims_its_name(values):
            reasons[candidate.effect] = f"it would take {parameters}, outside the documented range"
        elif rule and (reason := rule(evidence)):
            reasons[candidate.effect] = reason
    return reasons


def find_idle(hypothesis: Hypothesis, widening: float, robot: Robot) -> dict[str, str]:
    """Return the effects whose intervals hold what does nothing, in all their strengths, with the reason.

    Args:
        hypothesis: With its fit.
        widening: How much wider an interval is than noise alone makes it.
        robot: Whose log it is.
    """
    reasons = {}
    for candidate, (low, high) in zip(hypothesis.candidates, hypothesis.intervals(widening), strict=True):
        strong, neutral = candidate.strong, candidate.neutral
        if strong.any() and ((low <= neutral) & (neutral <= high))[strong].all():
            k = int(np.argmax(strong))
            numbers = candidate.tell(robot, np.array([low, high, neutral]))[:, k]
            holds = f"{candidate.free[k]} {numbers[0]:.3g} to {numbers[1]:.3g}, holds {numbers[2]:g}"
            reasons[candidate.effect] = f"its 95 % interval, {holds}, which does nothing"
    return reasons


def _check_sag(evidence: Evidence) -> str | None:
    """Return a reason if the supply's logged voltage falls by much less than the current would have it."""
    log, servo, how = evidence.log, evidence.with_it.servo, evidence.settings
    voltages = [record.sensors["voltage"] for record in log.records if "voltage" in record.sensors]
    if not voltages:
        return None
    torques = [np.abs(_torque(evidence.with_it, record)) for record in log.records]
    current = np.concatenate([(torque / servo.torque_constant).sum(axis=1) for torque in torques])
    fall = float(servo.supply_resistance.max() * np.ptp(np.percentile(current, how.spread)))
    seen = float(np.ptp(np.percentile(np.concatenate(voltages), how.spread)))
    if fall < how.sag or seen >= how.sag_share * fall:
        return None
    return f"the logged voltage moves by {seen:.2g} V where it would take {fall:.2g} V"


def _check_warmth(evidence: Evidence) -> str | None:
    """Return a reason if no logged motor that fades gets warm."""
    log, fade, before = evidence.log, evidence.with_it.servo.fade, evidence.plant.servo.fade
    fading = [name for k, name in enumerate(log.joints) if fade[k] > before[k]]
    channels = [record.sensors.get(f"temperature.{name}") for record in log.records for name in fading]
    rises = [float(channel.max() - channel[0]) for channel in channels if channel is not None]
    if not rises or max(rises) >= evidence.settings.warmth:
        return None
    return f"no motor gets warmer than {max(rises):.2g} °C in an episode"


def _check_torque(evidence: Evidence) -> str | None:
    """Return a reason if the logged torques are those of the servo without the cause."""
    log, plants, errors = evidence.log, (evidence.with_it, evidence.plant), np.zeros(2)
    new, old = (plant.servo for plant in plants)
    changed = (new.limit != old.limit) | ~np.isclose(new.kp, old.kp, rtol=0.1)
    for record in log.records:
        for k, name in enumerate(log.joints):
            if changed[k] and f"torque.{name}" in record.sensors:
                measured = record.sensors[f"torque.{name}"][:-1]
                errors += [np.sum((_torque(plant, record)[:, k] - measured) ** 2) for plant in plants]
    if errors[0] <= evidence.settings.worse**2 * errors[1]:
        return None
    return "the logged torques are those of a servo without it"


_RULES: dict[str, Callable[[Evidence], str | None]] = {
    "supply_sag": _check_sag,
    "gain_fade": _check_warmth,
    "torque_limit": _check_torque,
    "servo_gain": _check_torque,
}


def _torque(plant: Plant, record: Record) -> np.ndarray:
    """Return what servos ask for at each command [N·m], latency and friction apart, shape (T, n_motors)."""
    servo, drive = change(plant, record.conditions).servo, plant.robot.drive
    error = record.targets + servo.offset - record.position[:-1][:, drive]
    speed, feed, of_kp, of_kd = split_other_commands(record.commands, len(drive))
    wanted = of_kp * servo.kp * error + of_kd * servo.kd * (speed - record.velocity[:-1][:, drive]) + feed
    return np.clip(wanted, -servo.limit, servo.limit)
