"""What an episode that was run somewhere else is worth: the task judges its log, or what a person measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gsl.core.interfaces import ByDistance, Task
from gsl.core.layout import Layout
from gsl.core.observation import observations
from gsl.core.trajectory import Trajectory
from gsl.rollout.parallel import Episode
from gsl.rollout.rollout import Scenario
from gsl.storage.answers import Answered

_BASE: Mapping[str, int] = {"base.position": 3, "base.orientation": 4, "base.velocity": 3}


class Verdict(NamedTuple):
    """An episode as a search sees it, and its log, if there is one, with the rewards of the task."""

    episode: Episode
    trajectory: Trajectory | None


def observe(layout: Layout, trajectory: Trajectory) -> Layout:
    """Return a layout with all that a log knows of the base."""
    extras = {
        part: size
        for part, size in _BASE.items()
        if all(column in trajectory.sensors for column in Layout((), {part: size}, 1.0).columns[part])
    }
    return replace(layout, sizes={**layout.sizes, **extras})


def by_distance(task: Task, layout: Layout) -> bool:
    """Tell whether somebody has to measure how far the robot got: its task wants to know, its sensors do not tell."""
    return isinstance(task, ByDistance) and "base.position" not in layout.sizes


def judge(scenario: Scenario, answer: Answered, steps: int) -> Verdict | None:
    """Return what an answer is worth, None where it does not say enough: a distance or a value is missing.

    A stop for safety counts as a fall, and a fall without a measured distance as one on the spot.

    Args:
        scenario: What was to be done.
        answer: What is known of the episode.
        steps: How long it was to be.
    """
    task, down = scenario.task, answer.fell or answer.stopped
    trajectory = None if answer.trajectory is None else _fallen(answer.trajectory, fell=down)
    length = steps if trajectory is None else len(trajectory)
    if answer.value is not None:
        return Verdict(Episode(answer.value, down, length, {}), _pay(trajectory, answer.value))
    distance = 0.0 if answer.distance is None and down else answer.distance
    if isinstance(task, ByDistance) and distance is not None and (trajectory is None or not _sees_itself(trajectory)):
        score = task.judge_distance(distance, fell=down)
        return Verdict(Episode(score.value, down, length, score.outcome), _pay(trajectory, score.value))
    if trajectory is None or (isinstance(task, ByDistance) and not _sees_itself(trajectory)):
        return None
    layout = observe(scenario.world.layout, trajectory)
    whole = _reward(scenario, layout, trajectory)
    return Verdict(Episode(whole.value, down, len(whole), task.outcome(layout, whole)), whole)


def _sees_itself(trajectory: Trajectory) -> bool:
    return "base.position.x" in trajectory.sensors


def _fallen(trajectory: Trajectory, *, fell: bool) -> Trajectory:
    """Return a log that ends at its first fall: what a robot does when it lies is not what it was asked."""
    if trajectory.fell is not None and trajectory.fell.any():
        trajectory = _cut(trajectory, max(1, int(np.argmax(trajectory.fell))))
    down = np.zeros(len(trajectory) + 1, dtype=bool)
    down[-1] = fell
    return replace(trajectory, fell=down)


def _pay(trajectory: Trajectory | None, value: float) -> Trajectory | None:
    """Let the last step earn all: nobody knows when it was earned."""
    return None if trajectory is None else replace(trajectory, reward=np.r_[np.zeros(len(trajectory) - 1), value])


def _reward(scenario: Scenario, layout: Layout, trajectory: Trajectory) -> Trajectory:
    """Let the task judge every step as it does in a rollout; what comes after its end is cut off."""
    seen, rewards = observations(trajectory, layout), []
    task = scenario.task.start(layout, seen[0], scenario.role)
    assert trajectory.fell is not None
    for before, after, fell in zip(seen[:-1], seen[1:], trajectory.fell[1:], strict=True):
        step = task.step(before, after, bool(fell))
        rewards.append(step.reward or 0.0)
        if step.ended:
            break
    return replace(_cut(trajectory, len(rewards)), reward=np.array(rewards))


def _cut(trajectory: Trajectory, steps: int) -> Trajectory:
    rows, sent = slice(steps + 1), trajectory.grounded_action
    return replace(
        trajectory,
        time=trajectory.time[rows],
        action=trajectory.action[:steps],
        grounded_action=None if sent is None else sent[:steps],
        position=trajectory.position[rows],
        velocity=trajectory.velocity[rows],
        fell=None if trajectory.fell is None else trajectory.fell[rows],
        sensors={name: values[rows] for name, values in trajectory.sensors.items()},
    )
