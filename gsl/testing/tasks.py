"""What a task promises: a unit, a reward and an end for every step, and an outcome of finite figures."""

from __future__ import annotations

import numpy as np

from gsl.core.interfaces import REAL, SIM, Step, Task, World
from gsl.testing.components import check_component, require
from gsl.testing.episodes import WORLD, observe, record

TICKS = 25


def check_task(task: Task, *, world: World = WORLD) -> None:
    """Check a task.

    Args:
        task: Its settings.
        world: In which it is set; the NAO on the ground by default.
    """
    check_component(task)
    require(task, isinstance(task, Task), "needs `duration`, `unit`, `shown`, `start` and `outcome`")
    require(task, task.duration > 0.0, "lasts no time")
    require(task, isinstance(task.unit, str), "its unit is no text")
    require(task, bool(np.isfinite(task.shown)) and task.shown != 0.0, "its `shown` is no factor")
    observations = observe(world, TICKS)
    for role in (REAL, SIM):
        first, second = (_judge(task, world, observations, role) for _ in range(2))
        require(task, first == second, "judges otherwise in another episode that shows it the same")
    trajectory = record(world, task)
    before = trajectory.position.copy()
    for name, value in task.outcome(world.layout, trajectory).items():
        require(task, bool(np.isfinite(value)), f"reports {name} = {value}")
    require(task, np.array_equal(before, trajectory.position), "changes the trajectory that it is given")


def _judge(task: Task, world: World, observations: np.ndarray, role: str) -> list[Step]:
    run, steps = task.start(world.layout, observations[0], role), []
    for before, after in zip(observations[:-1], observations[1:], strict=True):
        step = run.step(before, after, False)
        require(task, isinstance(step, Step), "its step() returns no Step(reward, ended)")
        require(task, step.reward is None or bool(np.isfinite(step.reward)), f"rewards a step with {step.reward}")
        steps.append(Step(step.reward, bool(step.ended)))
    return steps
