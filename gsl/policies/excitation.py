"""An excitation: a menu of safe open-loop motions of a robot in the air that shows what its servos do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Annotated, Literal, NamedTuple, get_args

import numpy as np

from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.policies import motions
from gsl.policies.limits import Limits, limits
from gsl.policies.programme import OpenLoopRun, Piece
from gsl.policies.sides import Pair, pairs
from gsl.robots.catalogue import robot

REST = 0.3  # at both ends of a motion [s]

Motion = Literal[
    "steps_small",
    "steps_large",
    "triangle_slow",
    "triangle_medium",
    "triangle_fast",
    "chirp",
    "poses",
    "mirrored",
    "one_by_one",
]
Variant = Literal["a", "b"]
MENU: tuple[Motion, ...] = get_args(Motion)
VARIANTS: tuple[Variant, ...] = get_args(Variant)


class _Kind(NamedTuple):
    """A wave, the share of the room that it takes, and the field of the limits that bounds its jumps, if it jumps."""

    wave: Callable[[np.ndarray, float, motions.Parts], np.ndarray]
    share: float = 1.0
    jump: str = ""


_KINDS: Mapping[Motion, _Kind] = {
    "steps_small": _Kind(motions.steps, jump="small"),
    "steps_large": _Kind(motions.steps, jump="jump"),
    "triangle_slow": _Kind(partial(motions.triangle, frequency=0.2), 0.5),
    "triangle_medium": _Kind(partial(motions.triangle, frequency=0.5), 0.4),
    "triangle_fast": _Kind(partial(motions.triangle, frequency=1.2), 0.3),
    "chirp": _Kind(motions.chirp, 0.35),
    "poses": _Kind(motions.poses, 0.5),
    "mirrored": _Kind(motions.mirror, 0.4),
    "one_by_one": _Kind(motions.one_by_one, 0.3),
}


@component
class Excitation:
    """Plays its motions one after the other, an episode each; they keep the limits of the robot (limits.py).

    Its one parameter is the number of a motion's variant in the menu. With a `file` its stage plays that instead.
    """

    robot: Annotated[str, setting("whose joints it moves; that of the world")]
    motions: Annotated[tuple[Motion, ...], setting("what is played", min_length=1)] = MENU
    variants: Annotated[tuple[Variant, ...], setting("of each motion: one to fit, one to check", min_length=1)] = (
        VARIANTS
    )
    repeats: Annotated[int, setting("how often the `repeated` motions are played", ge=1, le=100)] = 2
    repeated: Annotated[tuple[Motion, ...], setting("motions whose first variant is played again")] = (
        "steps_large",
        "triangle_medium",
    )
    amplitude: Annotated[float, setting("factor on every amplitude", gt=0, le=1)] = 1.0
    duration: Annotated[float, setting("of a motion", unit="s", ge=1.5, le=600)] = 3.5
    file: Annotated[str | None, setting("command file to play instead of the menu", min_length=1)] = None

    names = ("motion",)
    initial = np.zeros(1)
    scale = np.zeros(1)

    def __post_init__(self) -> None:
        """Refuse a robot that does not exist."""
        robot(self.robot)

    @cached_property
    def limits(self) -> Limits:
        """What the robot's joints may be asked."""
        return limits(robot(self.robot))

    @cached_property
    def _pairs(self) -> tuple[Pair, ...]:
        return pairs(robot(self.robot))

    @property
    def programme(self) -> tuple[Piece, ...]:
        """Every variant of every motion once, then the repeats."""
        once = [(motion, variant) for motion in self.motions for variant in self.variants]
        again = [(motion, self.variants[0]) for motion in self.repeated if motion in self.motions]
        return tuple(_piece(*motion) for motion in once + (self.repeats - 1) * again)

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return the rest, well inside all limits: arms forward and down, legs bent [rad], shape (n_joints,).

        Raises:
            ConfigError: if the world's robot is another.
        """
        if layout.joints != self.limits.joints:
            raise ConfigError("policy.robot", "has other joints than the world's robot", given=self.robot)
        return self.limits.rest

    def start(self, parameters: np.ndarray, layout: Layout) -> OpenLoopRun:
        """Return a motion at its beginning."""
        motion, variant = divmod(int(parameters[0]), len(VARIANTS))
        return OpenLoopRun(self.commands(MENU[motion], VARIANTS[variant], layout.control_period))

    def commands(self, motion: Motion, variant: Variant, period: float) -> np.ndarray:
        """Return the desired joint positions of a motion [rad], shape (T, n_joints).

        Args:
            motion: Name in the menu.
            variant: Of the motion.
            period: Control period [s].
        """
        bounds, kind = self.limits, _KINDS[motion]
        time, length = period * np.arange(round(self.duration / period)) - REST, self.duration - 2.0 * REST
        these = motions.parts(motion, VARIANTS.index(variant), len(bounds.joints), self._pairs)
        wave = np.where(((time > 0.0) & (time < length))[:, None], kind.wave(time, length, these), 0.0)
        most = getattr(bounds, kind.jump) if kind.jump else np.inf
        up, down = (self.amplitude * np.minimum(kind.share * room, most) for room in (bounds.up, bounds.down))
        way = wave * np.where(wave > 0.0, up, down)
        return bounds.rest + (way if kind.jump else slow_down(way, bounds.speed * period))


def _piece(motion: Motion, variant: Variant) -> Piece:
    number = len(VARIANTS) * MENU.index(motion) + VARIANTS.index(variant)
    return Piece(f"{motion}_{variant}", np.array([float(number)]), {"motion": motion, "variant": variant})


def slow_down(way: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Return a way from rest, each joint's made smaller where one step of it is longer than `most` [rad]."""
    longest = np.abs(np.diff(way, axis=0, prepend=0.0)).max(axis=0)
    return way * (most / np.maximum(longest, most))
