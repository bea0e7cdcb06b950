"""What the joints of a robot may be asked open loop: where they rest and how far, how fast and how abruptly they move.

lower <= target <= upper
path of the target in any 0.2 s    <= 0.2 s x half of max_velocity
one jump                           <= what asks a servo for 8 times its torque limit, and never more than the above
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gsl.core.body import Robot
from gsl.policies.sides import inwards

MARGIN = 0.05  # that a motion of ours keeps from the end of a joint's range [rad], or `Joint.size`s of a slide
TO_THE_CENTRE = 0.35  # of the way from the usual posture to the centre of the range: where a joint rests in the air
REACH = 1.2  # that a motion of ours keeps within of the rest, however wide the range [rad], or `Joint.size`s
BOTH_SIDES = 0.3  # of the reach is left to a joint that turns limbs on both sides, one way towards each other
SPEED_SHARE = 0.5  # of max_velocity
WINDOW = 0.2  # over which the speed of a target is judged [s]
LARGE = 8.0  # torque that the largest jump asks for, in torque limits
SMALL = 0.6  # torque that the largest jump of the small ladder asks for, in torque limits
_ROUNDING = 1e-9


class Breach(NamedTuple):
    """A target that breaks a limit: its control step, its joint and what is wrong with it."""

    step: int
    joint: str
    problem: str


@dataclass(frozen=True)
class Limits:
    """Bounds of the targets of the controlled joints, m for rad of slides; an array has shape (n_joints,).

    Attributes:
        joints: Their names.
        lower, upper: Range [rad].
        rest: Where a motion begins and ends [rad].
        down, up: How far a motion of ours may go below and above the rest [rad].
        speed: Most of the mean speed over `WINDOW` [rad/s].
        jump: Most of the change in one control step, where the speed allows no more [rad].
        small: Size of a jump that leaves the servo well inside its torque limit [rad].
        slides: Names of those that slide.
    """

    joints: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    rest: np.ndarray
    down: np.ndarray
    up: np.ndarray
    speed: np.ndarray
    jump: np.ndarray
    small: np.ndarray
    slides: tuple[str, ...] = ()

    def unit(self, joint: str) -> str:
        """Return the unit of a joint's position."""
        return "m" if joint in self.slides else "rad"


def limits(robot: Robot) -> Limits:
    """Return the limits of a robot; a joint that drives several motors has the narrowest of theirs."""
    motors = [robot.joint(name) for name in robot.motors]
    ranges = [robot.bound_commands(name) for name in robot.motors]
    lower = -narrowest(robot, [-lower for lower, _ in ranges])
    upper = narrowest(robot, [upper for _, upper in ranges])
    usual = np.clip([robot.stance.get(name, 0.0) for name in robot.controlled], lower, upper)
    rest = usual + TO_THE_CENTRE * (0.5 * (lower + upper) - usual)
    down, up = _rooms(robot, lower, upper, usual, rest)
    speed = SPEED_SHARE * narrowest(robot, [joint.max_velocity for joint in motors])
    full = narrowest(robot, [joint.effort / robot.gains[joint.name][0] for joint in motors])
    jump = np.minimum(LARGE * full, speed * WINDOW)
    return Limits(
        joints=robot.controlled,
        lower=lower,
        upper=upper,
        rest=rest,
        down=down,
        up=up,
        speed=speed,
        jump=jump,
        small=np.minimum(SMALL * full, 0.3 * jump),
        slides=robot.slides,
    )


def _rooms(
    robot: Robot, lower: np.ndarray, upper: np.ndarray, usual: np.ndarray, rest: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far a motion may go below and above the rest; no limb gets further inwards than in usual posture."""
    size = narrowest(robot, [robot.joint(name).size for name in robot.motors])
    most = REACH * size * np.where(np.bincount(robot.drive) > 1, BOTH_SIDES, 1.0)
    down, up = (np.clip(np.minimum(most, room - MARGIN * size), 0.0, None) for room in (rest - lower, upper - rest))
    inside = inwards(robot, dict(zip(robot.controlled, rest.tolist(), strict=True)))
    inner = np.maximum(0.0, -inside * (rest - usual))
    return np.where(inside < 0.0, np.minimum(down, inner), down), np.where(inside > 0.0, np.minimum(up, inner), up)


def breach(bounds: Limits, targets: np.ndarray, period: float) -> Breach | None:
    """Return the first target that breaks a limit, if one does.

    Args:
        bounds: The limits.
        targets: Desired positions in the order of `bounds.joints` [rad], shape (T, n_joints).
        period: Control period [s].
    """
    if not np.isfinite(targets).all():
        return _first(bounds, ~np.isfinite(targets), "the target is not a finite number")
    change = np.abs(np.diff(targets, axis=0, prepend=targets[:1]))
    steps = max(1, round(WINDOW / period))
    path = np.cumsum(change, axis=0)
    path[steps:] -= path[:-steps].copy()
    most, far = np.maximum(bounds.jump, bounds.speed * period), bounds.speed * steps * period
    rules = (
        (
            bounds.lower - targets,
            targets,
            bounds.lower,
            "the target of {:.4g} {unit} is below the limit, {:.4g} {unit}",
        ),
        (
            targets - bounds.upper,
            targets,
            bounds.upper,
            "the target of {:.4g} {unit} is above the limit, {:.4g} {unit}",
        ),
        (change - most, change, most, "the target jumps by {:.4g} {unit}, more than the {:.4g} {unit} allowed"),
        (path - far, path, far, "the target moves {:.4g} {unit} in 0.2 s, more than the {:.4g} {unit} allowed"),
    )
    breaches = (_first(bounds, excess > _ROUNDING, text, values, bound) for excess, values, bound, text in rules)
    return next((breach for breach in breaches if breach is not None), None)


def _first(bounds: Limits, wrong: np.ndarray, text: str, *quantities: np.ndarray) -> Breach | None:
    """Return the first entry that is wrong, its values and bounds put into the text."""
    if not wrong.any():
        return None
    step, joint = (int(index) for index in np.argwhere(wrong)[0])
    numbers = (np.broadcast_to(quantity, wrong.shape)[step, joint] for quantity in quantities)
    return Breach(
        step,
        bounds.joints[joint],
        text.format(*numbers, unit=bounds.unit(bounds.joints[joint])),
    )


def narrowest(robot: Robot, values: list[float]) -> np.ndarray:
    """Return the least of a value over the motors that each controlled joint drives, shape (n_joints,)."""
    least = np.full(len(robot.controlled), np.inf)
    np.minimum.at(least, robot.drive, values)
    return least
