"""What a control loop costs beyond its physics steps: whole rollouts, and in other runs of them the steps alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gsl.core.layout import Layout
from gsl.core.servo_law import HIDDEN, INPUTS, LAGS, ServoLaw
from gsl.grounding.gat import LoadedTransformation
from gsl.models.config import ModelConfig
from gsl.models.forward import ForwardModel
from gsl.models.inverse import Regression
from gsl.models.network import Network
from gsl.rollout.rollout import Scenario, rollout
from gsl.worlds.bullet import BulletEnv, BulletWorld

THROUGH_PYBULLET = 0  # the handle of an engine that steps through pybullet, where single steps can be timed
SMALL = 0.01  # weights of a law: less than a hundredth of a torque limit
TRUST = 0.01  # alpha of the untrained grounding: π0 has to stay up


class LoopCost(NamedTuple):
    """CPU times of rollouts, medians.

    Attributes:
        ratio: Whole rollouts / the physics steps in them.
        seconds: Of a rollout [s].
        reload_seconds: Of loading the world anew [s].
        step_us: Of a physics step [µs].
    """

    ratio: float
    seconds: float
    reload_seconds: float
    step_us: float


@dataclass(frozen=True)
class LearnedWorld:
    """A world whose servos have a law, of random weights so small that π0 stays up."""

    world: BulletWorld

    @property
    def layout(self) -> Layout:
        """That of the world."""
        return self.world.layout

    def make(self) -> BulletEnv:
        """Build the environment."""
        rng, servo, n = np.random.default_rng(0), self.world.plant.servo, len(self.world.plant.robot.motors)
        shapes = (n, LAGS), (1, INPUTS, HIDDEN), (1, HIDDEN), (1, HIDDEN, HIDDEN), (1, HIDDEN), (1, HIDDEN, 2), (1, 2)
        arrays = (SMALL * rng.standard_normal(shape) for shape in shapes)
        law = ServoLaw(np.zeros(n, dtype=np.int64), servo.kp / servo.limit, servo.limit, *arrays)
        return BulletEnv(self.world, replace(self.world.plant, law=law))


class StepClock:
    """CPU time spent inside a function, less what it takes to look at the clock."""

    def __init__(self, function: Callable[[int], None]) -> None:
        self._function, self._elapsed, self.calls = function, 0, 0
        self._cost = _clock_cost()

    def __call__(self, client: int) -> None:
        """Call the function and add its time."""
        begin = time.thread_time_ns()
        self._function(client)
        self._elapsed += time.thread_time_ns() - begin
        self.calls += 1

    @property
    def seconds(self) -> float:
        """Time so far [s]."""
        return 1e-9 * (self._elapsed - self.calls * self._cost)


def loops(scenario: Scenario, repeats: int) -> LoopCost:
    """Measure rollouts of the policy's start values: each seed as it is, then with its steps timed."""
    env = scenario.make()
    parameters = scenario.policy.initial
    rollout(scenario, env, parameters, 0)
    engine: Any = env.unwrapped.engine  # type: ignore[attr-defined]
    whole, inside, count, reloads = [], [], [], []
    for seed in range(repeats):
        begin = time.process_time()
        rollout(scenario, env, parameters, seed)
        whole.append(time.process_time() - begin)
        with _time_steps(engine) as clock:
            rollout(scenario, env, parameters, seed)
        inside.append(clock.seconds)
        count.append(clock.calls)
        reloads += _reloads(engine)
    env.close()
    ratio = float(np.median(np.array(whole) / np.array(inside)))
    step = float(np.median(np.array(inside) / np.array(count)))
    return LoopCost(ratio, float(np.median(whole)), float(np.median(reloads)), 1e6 * step)


def make_untrained(scenario: Scenario) -> Scenario:
    """Return the scenario with a grounding of two MLPs of the default size and small random weights."""
    rng, joints = np.random.default_rng(0), scenario.world.layout.joints
    config = ModelConfig(family="mlp", sensors=("gyro", "tilt", "foot_force"))
    windows = (config.of_body, config.of_joints)
    sizes = [(window.size(len(joints)), *config.hidden, len(joints)) for window in windows]
    nets = [
        Network([(0.01 * rng.standard_normal((b, a)), np.zeros(b)) for a, b in pairwise(widths)]) for widths in sizes
    ]
    forward = ForwardModel(nets[0], windows[0], joints)
    inverse = Regression(nets[1], windows[1], joints)
    return replace(scenario, grounding=LoadedTransformation(forward, inverse, alpha=TRUST))


@contextmanager
def _time_steps(engine: Any) -> Iterator[StepClock]:
    """Time the physics steps of an engine, which takes them through pybullet meanwhile: the same steps, to the bit."""
    bullet, handle = engine.bullet, getattr(engine, "handle", THROUGH_PYBULLET)
    plain = bullet.stepSimulation
    engine.handle, bullet.stepSimulation = THROUGH_PYBULLET, StepClock(plain)
    try:
        yield bullet.stepSimulation
    finally:
        engine.handle, bullet.stepSimulation = handle, plain


def _reloads(engine: Any) -> list[float]:
    reading, targets, taken = engine.read(), np.zeros((1, len(engine.joints))), []
    for _ in range(3):
        begin = time.process_time()
        engine.load(reading, targets)
        taken.append(time.process_time() - begin)
    return taken


def _clock_cost() -> float:
    """What two looks at the clock take beyond what is between them [ns]."""
    taken = []
    for _ in range(2000):
        begin = time.thread_time_ns()
        taken.append(time.thread_time_ns() - begin)
    return float(np.median(taken))
