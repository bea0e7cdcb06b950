"""What a learned servo has learned, to look at: how joints answer a step, and what motion costs at constant speed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gsl.core.plant import Plant
from gsl.core.slides import in_angles, levers
from gsl.models.servo import ServoModel
from gsl.report.shown import scale_of
from gsl.report.style import GROUNDED, SIMULATION, WIDTH, figure, headline, look, save
from gsl.worlds.held import Held

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEP, SECONDS = 0.1, 0.5  # of the answer to a step [rad], [s]
SETTLE = 50  # control periods at rest before it


def servo_curves(path: Path, plant: Plant, model: ServoModel, step: float, period: float) -> None:
    """Write the curves of a learned servo as a PNG file, one column a group of joints.

    Args:
        path: Of the file.
        plant: The servo that it stands on.
        model: What was learned.
        step: Physics period [s].
        period: Control period [s].
    """
    title = "What the servo has learned: how a joint answers a step, and what constant speed costs"
    save(servo_curves_figure(plant, model, step, period, list_groups(plant, model), title=title), path)


def list_groups(plant: Plant, model: ServoModel) -> list[int]:
    """Return the groups, by number, that have a joint of their own."""
    return [g for g in range(len(model.groups)) if (_members(model, plant) == g).any()]


def servo_curves_figure(
    plant: Plant,
    model: ServoModel,
    step: float,
    period: float,
    groups: Sequence[int],
    *,
    title: str = "",
    width: float = WIDTH,
) -> Figure:
    """Return the figure.

    Args:
        plant: The servo that it stands on.
        model: What was learned.
        step: Physics period [s].
        period: Control period [s].
        groups: By number, a column each.
        title: What there is to see.
        width: Of the figure [in].
    """
    plants = (("simulator", in_angles(plant), SIMULATION), ("learned servo", in_angles(model.on(plant)), GROUNDED))
    ways = levers(plants[0][1].robot)
    with look():
        whole = figure(5.2, width)
        axes, shown = whole.subplots(2, len(groups), squeeze=False), ""
        for column, g in enumerate(groups):
            joint = int(np.argmax(_members(model, plant) == g))
            way, scale, slides = ways[joint], scale_of(model.joints[joint], plant.robot.slides), ways[joint] != 1.0
            for label, drives, colour in plants:
                time, answer = step_response(drives, joint, step, period)
                axes[0, column].plot(time, scale.factor * way * answer, color=colour, label=label, linewidth=1.8)
                speed, torque = motion_cost(drives, joint, step, period)
                axes[1, column].plot(way * speed, torque / way, color=colour, label=label, linewidth=1.8)
            axes[0, column].set_title(f"{model.groups[g]}: {model.joints[joint]}", loc="left")
            axes[0, column].set_xlabel("time after a step [s]")
            axes[1, column].set_xlabel(f"speed [{'m/s' if slides else 'rad/s'}]")
            if scale.unit != shown:
                shown = scale.unit
                axes[0, column].set_ylabel(f"answer [{shown}]")
                axes[1, column].set_ylabel("force at that speed [N]" if slides else "torque at that speed [N·m]")
        axes[0, 0].legend(frameon=False)
        headline(whole, title)
    return whole


def _members(model: ServoModel, plant: Plant) -> np.ndarray:
    return model.group[: len(plant.robot.controlled)]


def step_response(plant: Plant, joint: int, step: float, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Return time [s] and the joint's position from where it was [rad] after its target jumps, shape (T,) each."""
    rest = _stance(plant)
    target = np.repeat(rest[None], round(SECONDS / period), axis=0)
    target[:, joint] += STEP * _room(plant, joint, rest)
    before = np.repeat(rest[None], 2, axis=0)
    played = Held.of(plant, step, period).play([np.vstack([before, target])], [rest], SETTLE)[0]
    answer = played[len(before) :, joint] - played[len(before), joint]
    return period * np.arange(len(answer)), answer


def motion_cost(plant: Plant, joint: int, step: float, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Return speeds [rad/s] and the torque that keeps each of them [N·m]: friction and damping.

    That is kp times the following error, the part of it left out that a delayed command makes.
    """
    rest, speeds, lags = _stance(plant), np.linspace(0.1, 2.0, 8), []
    toward = _room(plant, joint, rest)
    for speed in speeds:
        ticks = round(0.3 / speed / period) + 4
        path = np.repeat(rest[None], ticks, axis=0)
        path[:, joint] += toward * np.minimum(speed * period * np.arange(ticks), 0.3)
        played = Held.of(plant, step, period).play([path], [rest], SETTLE)[0]
        middle = slice(ticks // 2, ticks - 3)
        behind = float(np.mean(toward * (path[middle, joint] - played[1:][middle, joint])))
        lags.append(behind - speed * plant.servo.delay[joint])
    return speeds, plant.servo.kp[joint] * np.array(lags)


def _stance(plant: Plant) -> np.ndarray:
    robot = plant.robot
    neutral = [
        np.clip(robot.stance.get(name, 0.0), robot.joint(name).lower, robot.joint(name).upper) for name in robot.motors
    ]
    return np.array(neutral)


def _room(plant: Plant, joint: int, rest: np.ndarray) -> float:
    """Return the direction in which the joint has more room, +1 or -1."""
    limits = plant.robot.joint(plant.robot.motors[joint])
    return 1.0 if limits.upper - rest[joint] >= rest[joint] - limits.lower else -1.0
