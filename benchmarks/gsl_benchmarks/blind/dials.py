"""Dials: random effects of the library, or from outside it, with everything drawn but how strong they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.plant import Plant
from gsl.core.setting import Setting, settings_of
from gsl.effects.effect import effect_class, list_documented, names
from gsl_benchmarks.blind.extras import EXTRAS, Extra

# Besides effects of contact: not for a log in the air.
UNSEEN = ("encoder_noise", "action_noise", "torque_noise", "external_push")
RANDOM = ("uneven_ground",)  # new in every episode: no replay repeats it
FRICTION, COMPLIANCE = "ground_friction", "ground_compliance"
CALIBRATED = ("servo_gain", "coulomb_friction", "zero_offset", "sensor_bias")  # a calibration hides them: no abstention
GROUPED = 0.3  # share of effects that act on a group only


@dataclass(frozen=True)
class Dial:
    """What turns an effect up.

    Attributes:
        effect: Name in the library, or of an extra.
        fixed: What was drawn: scope, link, side, shapes.
        neutral, end: Values of each dialled parameter that do nothing, and the end of its documented range.
        inverse: Whether a parameter does nothing where it is infinite: its inverse is dialled, its errors are relative.
    """

    effect: str
    fixed: Mapping[str, Any]
    neutral: Mapping[str, float]
    end: Mapping[str, float]
    inverse: bool = False

    def entry(self, share: float) -> dict[str, Any]:
        """Return the effect's parameters at a share of its range between 0 and 1."""
        if self.inverse:
            return {**self.fixed, **{key: end / share for key, end in self.end.items()}}
        dialled = {key: start + share * (self.end[key] - start) for key, start in self.neutral.items()}
        return {**self.fixed, **dialled}

    def mask(self, plant: Plant) -> np.ndarray:
        """Return the controlled joints that it acts on, those that carry a link included, shape (n_joints,)."""
        robot = lump(plant.robot)
        if "link" not in self.fixed:
            return plant.mask(self.fixed.get("joints", "all"))[: len(robot.controlled)]
        above, link = {joint.child: joint for joint in robot.joints}, self.fixed["link"]
        carrying = set()
        while link in above:
            carrying.add(robot.coupled.get(above[link].name, above[link].name))
            link = above[link].parent
        return np.array([name in carrying for name in robot.controlled])


def visible() -> tuple[str, ...]:
    """Return the effects of the library that a robot in the air can show."""
    return tuple(
        name for name in names() if name not in UNSEEN and getattr(effect_class(name), "kind", "") != "contact"
    )


def list_walk_effects() -> tuple[str, ...]:
    """Return the effects of the library that a walk can show and a replay can repeat."""
    return tuple(name for name in names() if name not in (*UNSEEN, *RANDOM))


def draw(effect: str, robot: Robot, rng: np.random.Generator, *, alone: bool = False, floating: bool = False) -> Dial:
    """Draw all of an effect of the library but its strength.

    Args:
        effect: Its name.
        robot: Where it acts.
        rng: Of everything.
        alone: On a single joint.
        floating: On the ground, where it acts on all joints, or on the base.
    """
    target: Any = effect_class(effect)
    settings, hints = list_documented(effect, robot), get_type_hints(target)
    fixed: dict[str, Any] = {}
    if "joints" in settings:
        fixed["joints"] = "all" if floating else _scope(robot, rng, alone=alone)
    if "link" in settings:
        fixed["link"] = robot.base if floating else str(rng.choice([joint.child for joint in lump(robot).joints]))
    for key, hint in hints.items():
        if get_origin(hint) is Literal:
            fixed[key] = str(rng.choice(get_args(hint)))
    ranges = {
        key: setting for key, setting in settings.items() if setting.lower is not None and setting.upper is not None
    }
    dials = {key: start for key, setting in ranges.items() if (start := setting.neutral) is not None}
    shapes = {key: _shape(setting, rng) for key, setting in ranges.items() if key not in dials}
    chosen = str(rng.choice(list(dials)))
    ends = _ends(ranges[chosen], dials[chosen])
    return Dial(effect, {**fixed, **shapes}, {chosen: dials[chosen]}, {chosen: float(rng.choice(ends))})


def draw_on_foot(effect: str, plant: Plant, rng: np.random.Generator) -> Dial:
    """Draw all of an effect but its strength where the robot walks; of the ground, what it is now does nothing."""
    settings = settings_of(effect_class(effect))
    if effect == FRICTION:
        now = plant.contact.foot_friction * plant.contact.ground_friction
        ends = _ends(settings["friction"], now)
        return Dial(effect, {}, {"friction": now}, {"friction": float(rng.choice(ends))})
    if effect == COMPLIANCE:
        softest = settings["stiffness"].lower
        assert softest is not None
        damping = {"damping": _shape(settings["damping"], rng)}
        return Dial(effect, damping, {"stiffness": 0.0}, {"stiffness": softest}, inverse=True)
    return draw(effect, plant.robot, rng, floating=True)


def draw_extra(name: str, robot: Robot, rng: np.random.Generator) -> Dial:
    """Draw all of an effect from outside the library but its strength."""
    extra: Extra = EXTRAS[name]
    fixed: dict[str, Any] = {key: float(rng.uniform(*bounds)) for key, bounds in extra.shapes.items()}
    fixed["joints"] = str(rng.choice(robot.controlled)) if extra.alone else "all"
    return Dial(name, fixed, {extra.strength: 0.0}, {extra.strength: extra.most})


def takes_joint(effect: str) -> bool:
    """Whether an effect can act on a single joint."""
    return "joints" in settings_of(effect_class(effect))


def _scope(robot: Robot, rng: np.random.Generator, *, alone: bool) -> str:
    if alone:
        return str(rng.choice(robot.controlled))
    grouped = robot.groups and rng.random() < GROUPED
    return str(rng.choice(sorted(robot.groups))) if grouped else "all"


def _ends(setting: Setting, start: float) -> list[float]:
    return [end for end in (setting.lower, setting.upper) if end is not None and abs(end - start) > 1e-12]


def _shape(setting: Setting, rng: np.random.Generator) -> float:
    assert setting.lower is not None and setting.upper is not None
    return float(np.exp(rng.uniform(np.log(setting.lower), np.log(setting.upper))))
