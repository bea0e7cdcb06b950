"""One episode of a policy at a task in a world: a function of these and the seed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from gsl.core.interfaces import Grounding, Policy, PolicyRun, Task, World
from gsl.core.layout import Layout
from gsl.core.trajectory import Trajectory
from gsl.errors import ConfigError
from gsl.grounding.preparation import prepare
from gsl.policies.programme import OpenLoopRun
from gsl.worlds.grounded import GroundedEnv

LONGEST = 100_000  # steps of an episode that nothing ends


@dataclass(frozen=True)
class Scenario:
    """Everything of a rollout but the parameters and the seed."""

    world: World
    task: Task
    policy: Policy
    role: str
    grounding: Grounding

    def __post_init__(self) -> None:
        """Refuse an episode without a step."""
        if self.ticks < 1:
            period = self.world.layout.control_period
            duration = f"{self.task.duration:g}"
            raise ConfigError("task.duration", f"must be at least one control period ({period:g} s)", given=duration)

    @property
    def ticks(self) -> int:
        """Control steps of an episode that does not end early; an open-loop policy has its own number."""
        planned = self.task.duration / self.world.layout.control_period
        return round(min(planned, LONGEST))

    def prepare(self, settled: Mapping[str, Any] | None = None) -> Scenario:
        """Return the scenario with a grounding ready to act, in the world that it makes.

        Args:
            settled: What a search has settled of it: its metrics.
        """
        world, grounding = prepare(self.grounding, self.world, settled)
        return replace(self, world=world, grounding=grounding)

    def make(self) -> gymnasium.Env:
        """Build the environment that `rollout` acts in."""
        return GroundedEnv(self.world.make(), self.grounding)


def rollout(scenario: Scenario, env: gymnasium.Env, parameters: np.ndarray, seed: int) -> Trajectory:
    """Run one episode.

    Args:
        scenario: What is to be done.
        env: From `scenario.make`; nothing of earlier episodes stays in it.
        parameters: Of the policy.
        seed: Of the world and of the grounding.
    """
    layout = scenario.world.layout
    observation, _ = env.reset(seed=seed, options={"posture": scenario.policy.posture(parameters, layout)})
    policy = start_policy(scenario.policy, parameters, layout)
    with _needing("task", layout):
        task = scenario.task.start(layout, observation, scenario.role)
    observations, actions, sent, rewards, ended = [observation], [], [], [], False
    for _ in range(policy.ticks if isinstance(policy, OpenLoopRun) else scenario.ticks):
        action = policy.act(observation)
        before, (observation, own, ended, cut, info) = observation, env.step(action)
        judged = task.step(before, observation, ended)
        observations.append(observation)
        actions.append(action)
        sent.append(info["grounded_action"])
        rewards.append(own if judged.reward is None else judged.reward)
        if ended or cut or judged.ended:
            break
    record = _record_states if layout.states else _record
    trajectory = record(layout, np.array(observations), np.array(actions), np.array(rewards), ended=ended)
    grounded = np.array(sent)
    return trajectory if np.array_equal(grounded, actions) else replace(trajectory, grounded_action=grounded)


def play_once(scenario: Scenario, parameters: np.ndarray, seed: int) -> Trajectory:
    """Run one episode in an environment of its own; arguments as those of `rollout`."""
    env = scenario.make()
    try:
        return rollout(scenario, env, parameters, seed)
    finally:
        env.close()


def start_policy(policy: Policy, parameters: np.ndarray, layout: Layout) -> PolicyRun:
    """Return a policy at the beginning of an episode.

    Raises:
        ConfigError: It needs what the world does not observe.
    """
    with _needing("policy", layout):
        return policy.start(parameters, layout)


@contextmanager
def _needing(what: str, layout: Layout) -> Iterator[None]:
    try:
        yield
    except KeyError as error:
        robot = "a robot without feet takes task=excite in gsl collect; a search needs a policy of your own"
        other = "a gymnasium environment goes with task=own_reward and policy=mlp"
        hint = other if layout.states else f"{robot} (docs/howto/own-policy.md)"
        raise ConfigError(what, f"needs {error.args[0]}, which this world does not observe; {hint}") from error


def _record(layout: Layout, states: np.ndarray, actions: np.ndarray, rewards: np.ndarray, *, ended: bool) -> Trajectory:
    sensors = {
        column: states[:, layout[part].start + index]
        for part, columns in layout.columns.items()
        for index, column in enumerate(columns)
    }
    down = np.zeros(len(states), dtype=bool)
    down[-1] = ended
    return Trajectory(
        time=layout.control_period * np.arange(len(states)),
        action=actions,
        position=states[:, layout["position"]],
        velocity=states[:, layout["velocity"]],
        reward=rewards,
        fell=down,
        sensors=sensors,
    )


def _record_states(
    layout: Layout, states: np.ndarray, actions: np.ndarray, rewards: np.ndarray, *, ended: bool
) -> Trajectory:
    nothing, over = np.zeros((len(states), 0)), np.zeros(len(states), dtype=bool)
    over[-1] = ended
    time = layout.control_period * np.arange(len(states))
    return Trajectory(time, actions, nothing, nothing, reward=rewards, sensors={"terminated": over}, state=states)
