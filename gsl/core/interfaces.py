"""The five interfaces: world, task, policy, grounding and optimiser, with who calls what when.

One episode (gsl/rollout/rollout.py) uses four of them:

    env = world.make()                              # once a process
    observation = env.reset(...)                    # once an episode, in `policy.posture`
    policy, task, grounding = ....start(...)        # once an episode
    each control step:
        action      = policy.act(observation)       # (n_joints,), desired positions [rad]
        sent        = grounding.transform(observation, action)
        observation = env.step(sent)
        reward      = task.step(before, observation, fell)

`optimize` lets the fifth choose the parameters of a policy: a `Search` by values of episodes, a `Learner` by steps of
its own. A component is a frozen dataclass (`gsl.core.setting.component`) that can be pickled; its fields are settings.
What changes in an episode is in the object that `start` returns. An observation is flat, shape (layout.size,).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, Protocol, runtime_checkable

import gymnasium
import numpy as np

from gsl.core.layout import Layout
from gsl.core.table import Table
from gsl.core.trajectory import Batch, Trajectory
from gsl.errors import ConfigError

REAL: Literal["real"] = "real"
SIM: Literal["sim"] = "sim"


@runtime_checkable
class World(Protocol):
    """A body to act on."""

    @property
    def layout(self) -> Layout:
        """What an observation holds, and the control period [s]."""

    def make(self) -> gymnasium.Env:
        """Build the environment; each worker process does so once, and resets it for every episode."""


class Step(NamedTuple):
    """What a task says of one control step; no reward stands for the one that the world itself gives."""

    reward: float | None
    ended: bool


class TaskRun(Protocol):
    """A task in one episode."""

    def step(self, before: np.ndarray, after: np.ndarray, fell: bool) -> Step:
        """Judge the step between two observations."""


class Judged(NamedTuple):
    """What an episode is worth, and what is reported of it, by name with unit."""

    value: float
    outcome: Mapping[str, float]


@runtime_checkable
class ByDistance(Protocol):
    """A task whose value follows from a distance, so that a tape measure will do."""

    def judge_distance(self, distance: float, *, fell: bool) -> Judged:
        """Return what a real episode is worth in which the robot got so far forward [m]."""


@runtime_checkable
class Task(Protocol):
    """What we want of a body.

    Attributes:
        duration: Planned length of an episode [s]; infinite where the world ends it.
        unit: Of a value as people are shown it.
        shown: What a value is multiplied by to be in that unit.

    Where an episode may end in another way than by a fall, `falls: ClassVar[bool] = False` has none reported.
    """

    @property
    def duration(self) -> float:
        """Planned length of an episode [s]."""

    unit: ClassVar[str]
    shown: ClassVar[float]

    def start(self, layout: Layout, observation: np.ndarray, role: str) -> TaskRun:
        """Return the task at the beginning of an episode, in the `real` or in the `sim` world."""

    def outcome(self, layout: Layout, trajectory: Trajectory) -> Mapping[str, float]:
        """Return what is reported of an episode, by name with unit."""


class PolicyRun(Protocol):
    """A policy in one episode."""

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return desired joint positions [rad], shape (n_joints,)."""


@runtime_checkable
class Policy(Protocol):
    """A family of policies; one member is a parameter vector, shape (n_parameters,)."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""

    @property
    def initial(self) -> np.ndarray:
        """The parameters of π0, the policy that a search starts from."""

    @property
    def scale(self) -> np.ndarray:
        """Size of a step in each parameter that is as bold as in any other."""

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return the joint positions where an episode starts [rad], shape (n_joints,); empty without joints."""

    def start(self, parameters: np.ndarray, layout: Layout) -> PolicyRun:
        """Return the policy at the beginning of an episode."""


class GroundingRun(Protocol):
    """A grounding in one episode; it remembers what it has seen and sent."""

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return what to send instead of the agent's action [rad], shape (n_joints,)."""


@runtime_checkable
class Grounding(Protocol):
    """A change of the simulator, by its actions, so that it moves as the real robot does."""

    def start(self, layout: Layout, rng: np.random.Generator) -> GroundingRun:
        """Return the grounding at the beginning of an episode, with its own source of randomness."""


class Evidence(NamedTuple):
    """What a grounding learns from; None for what it does not need.

    Attributes:
        real: Trajectories of the real robot, of π0 and of policies around it; others are held out for the check.
        sim: Trajectories of the simulator, of the same policies.
    """

    real: Batch | None
    sim: Batch | None


@runtime_checkable
class Trainable(Grounding, Protocol):
    """A grounding with a model of its own, to be derived from: gsl collects what it needs and keeps what it learned.

    Attributes:
        needs: Which of "real" and "sim" it learns from.
        model: Path or run of `train-grounding`, a setting; empty before it has learned.
    """

    needs: ClassVar[tuple[str, ...]] = (REAL, SIM)
    model: str

    def learn(self, evidence: Evidence, seed: int) -> Mapping[str, np.ndarray]:
        """Return what it has learned, as arrays by name."""

    def load(self, arrays: Mapping[str, np.ndarray]) -> Grounding:
        """Return a grounding that acts by what was learned."""

    def start(self, layout: Layout, rng: np.random.Generator) -> GroundingRun:
        """Refuse with a ConfigError: what `load` returns can be started."""
        raise ConfigError("grounding", "has to learn first; a stage that uses it has to load what it learned")


class Prepared(NamedTuple):
    """A world that a grounding has made, and what changes the actions in it."""

    world: World
    grounding: Grounding


@runtime_checkable
class Preparable(Protocol):
    """A grounding that changes the world, or is made of artifacts; a stage prepares it before the first episode."""

    def parents(self, path: str) -> Mapping[str, Path]:
        """Return the artifacts that it is made of, by role.

        Args:
            path: Dotted name of the setting that the grounding is; a role is the name of a setting below it.
        """

    def check(self, world: World) -> Any:
        """Refuse a world that it is not for, before anything is asked of the real robot.

        Raises:
            ConfigError: It is one.
        """

    def prepare(self, world: World, settled: Mapping[str, Any]) -> Prepared:
        """Return the world that it makes of the simulator, and what acts there.

        Args:
            world: The simulator.
            settled: What a search has settled where the settings leave a choice, by name such as `alpha`.

        Raises:
            ConfigError: The world is not of a kind that it is for.
        """


@runtime_checkable
class HasMargins(Protocol):
    """A grounding with noise or draws on top, which keep a search from what only one simulator rewards."""

    def without_margins(self) -> Grounding:
        """Return the grounding without them."""


class SearchRun(Protocol):
    """A search in progress. The same values lead to the same candidates: a killed search goes on from its log."""

    def ask(self) -> Sequence[np.ndarray]:
        """Return the candidates of the next generation, `candidates` arrays of shape (n_parameters,)."""

    def tell(self, values: Sequence[float]) -> None:
        """Take the candidates' values in the order of `ask`; larger is better."""


@runtime_checkable
class Search(Protocol):
    """An optimiser that judges candidates by the value of whole episodes, which `optimize` rolls out in parallel."""

    @property
    def generations(self) -> int:
        """How often candidates are asked for."""

    @property
    def candidates(self) -> int:
        """How many a generation has, always: another number is refused."""

    def start(self, parameters: np.ndarray, scale: np.ndarray, seed: int) -> SearchRun:
        """Return the search at its beginning.

        Args:
            parameters: Where to begin, shape (n_parameters,).
            scale: Of each parameter, shape (n_parameters,).
            seed: Of all randomness.
        """


class Simulator(Protocol):
    """The simulator, grounded, as a learner sees it."""

    @property
    def layout(self) -> Layout:
        """What an observation holds, and what an action is."""

    def env(self) -> gymnasium.Env:
        """Return a gymnasium environment that rewards what the task rewards."""

    def table(self) -> Table:
        """Return all transitions and rewards, if they are known."""


@runtime_checkable
class Learner(Protocol):
    """An optimiser that acts in the simulator itself; it does not go on after a kill, but begins again."""

    @property
    def generations(self) -> int:
        """How often parameters are kept."""

    @property
    def steps_taken(self) -> int:
        """Steps that it takes in the simulator, none of one that asks for its table."""

    def learn(
        self, simulator: Simulator, policy: Policy, parameters: np.ndarray, seed: int, *,
        bold: bool, advance: Callable[[int], None],
    ) -> Iterator[np.ndarray]:  # fmt: skip
        """Yield the parameters after each generation.

        Args:
            simulator: To learn in.
            policy: Whose parameters they are.
            parameters: Where to begin, shape (n_parameters,).
            seed: Of all randomness.
            bold: Whether they are π0's own start values, from which nothing has been learned yet.
            advance: To be called with the number of further steps that were taken.
        """
