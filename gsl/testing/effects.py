"""What an effect promises: it maps a plant to a plant, within its scope, and its neutral value does nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.compiled import describe_uncompilable
from gsl.core.plant import Plant, nominal
from gsl.core.setting import settings_of
from gsl.effects.effect import PLACES, Effect, check_own, name_of
from gsl.robots.nao import nao
from gsl.testing.components import alike, check_component, flat, require
from gsl.worlds.fits import check_plant
from gsl.worlds.held import Held, Windows
from gsl.worlds.servo_state import COMMANDS

STEP, PERIOD = 0.002, 0.02  # of Bullet's worlds [s]
SWING, TICKS = 0.2, 15  # of the commands that are replayed [rad], [control periods]


def check_effect(effect: Effect, *, robot: Robot | None = None, neutral: Mapping[str, Any] | None = None) -> None:
    """Check an effect.

    Args:
        effect: With a strength at which it acts.
        robot: To act on; the NAO by default.
        neutral: Settings with which it does nothing, where they are not 0 of a sum or 1 of a factor.
    """
    check_component(effect)
    check_own(name_of(effect), type(effect))
    _check_words(effect)
    plant = nominal(nao() if robot is None else robot)
    before = flat(plant)
    after = effect.apply(plant)
    require(effect, alike(before, flat(plant)), "changes the plant that it is applied to; return another one")
    require(effect, isinstance(after, Plant), "its apply() returns no plant")
    require(effect, not alike(before, flat(after)), "does nothing at the strength of this check")
    check_plant(after, STEP, PERIOD)
    if after.hook is not None:
        torque = np.asarray(after.hook(np.zeros((2, len(plant.robot.motors))), 0.0))
        require(effect, torque.shape == (len(plant.robot.motors),), "its torque hook returns no torque for each motor")
        require(effect, bool(np.isfinite(torque).all()), "its torque hook returns a torque that is not finite")
    elif type(effect).kind != "contact":
        require(effect, bool(np.isfinite(_replay(after)).all()), "makes a robot in the air run away")
        _check_ends(effect, plant)
    _check_neutral(effect, plant, neutral)
    _check_scope(effect, plant)


def _check_words(effect: Effect) -> None:
    """Check what help, searches and reports say of it."""
    text = " ".join((type(effect).__doc__ or "").split())
    for words in ("Signature: ", "Confused with "):
        require(effect, words in text, f"its docstring has no '{words.strip()}', which a diagnosis reports")
    for each in settings_of(type(effect)).values():
        if each.name not in PLACES and each.upper is not None:
            require(effect, bool(each.source), f"{each.name} has a range without a source")


def _check_ends(effect: Any, plant: Plant) -> None:
    """Check that both ends of every documented range can be simulated: searches and draws go there."""
    for each in settings_of(type(effect)).values():
        for end in (each.lower, each.upper):
            if end is not None:
                moved = _replay(replace(effect, **{each.name: end}).apply(plant))
                promise = f"makes a robot in the air run away at {each.name} = {end:g}; narrow its documented range"
                require(effect, bool(np.isfinite(moved).all()), promise)


def _check_neutral(effect: Any, plant: Plant, neutral: Mapping[str, Any] | None) -> None:
    if neutral is None:
        settings = settings_of(type(effect)).values()
        neutral = {each.name: each.neutral for each in settings if each.neutral is not None}
    if not neutral:
        return
    still = replace(effect, **neutral).apply(plant)
    replayed = still.hook is None and type(effect).kind != "contact"
    same = np.array_equal(_replay(still), _replay(plant)) if replayed else alike(flat(still), flat(plant))
    require(effect, bool(same), f"does something at {', '.join(f'{k} = {v}' for k, v in neutral.items())}")


def _check_scope(effect: Any, plant: Plant) -> None:
    if "joints" not in settings_of(type(effect)):
        return
    joint = plant.robot.motors[-1]
    elsewhere = ~plant.mask(joint)
    after = replace(effect, joints=joint).apply(plant)
    for name, now, then in (
        *zip(plant.servo._fields, after.servo, plant.servo, strict=True),
        ("encoder_noise", after.sensors.encoder_noise, plant.sensors.encoder_noise),
        ("bias", after.sensors.bias, plant.sensors.bias),
        ("action_noise", after.action_noise, plant.action_noise),
        ("torque_noise", after.torque_noise.T, plant.torque_noise.T),
    ):
        same = np.array_equal(now[elsewhere], then[elsewhere])
        require(effect, same, f"with joints={joint} it changes {name} of other joints")


def _replay(plant: Plant) -> np.ndarray:
    """Return joint positions under a swing of all joints in the air [rad], shape (1, TICKS, n_motors)."""
    n = len(plant.robot.motors)
    joints = [plant.robot.joint(name) for name in plant.robot.motors]
    start = np.array([0.5 * (joint.lower + joint.upper) for joint in joints])
    time = np.arange(TICKS + COMMANDS - 1)[::-1, None]
    commands = start + SWING * np.sin(0.4 * time + np.arange(n)) - SWING * np.sin(np.arange(n))
    windows = Windows(np.ascontiguousarray(commands)[None], np.array([[start, np.zeros(n)]]), np.zeros(1))
    try:
        return Held.of(plant, STEP, PERIOD).replay(windows)
    except Exception as error:
        if (line := describe_uncompilable(error)) is None:
            raise
        raise AssertionError(line) from None
