"""The action transformation in worlds whose state is a vector, or one of few: GAT expects, SGAT draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.core.draws import Draws
from gsl.core.grounding import ground
from gsl.core.layout import Layout
from gsl.core.table import Table
from gsl.errors import ConfigError
from gsl.models.counts import Counts
from gsl.models.states import NearestChoice, StateForward, StateInverse


@dataclass(frozen=True)
class StateTransformation:
    """A grounding ready to act where actions are numbers from -1 to 1, or choices.

    Attributes:
        forward: f, of the real world.
        inverse: f_inv, of the simulator.
        alpha: How far to go, in [0, 1]; choices cannot be mixed.
        noise: Standard deviation of the noise on top.
        draws: Whether f's answer is drawn and not expected.
    """

    forward: StateForward
    inverse: StateInverse | NearestChoice
    alpha: float = 1.0
    noise: float = 0.0
    draws: bool = False

    def __post_init__(self) -> None:
        """Refuse models that do not fit each other."""
        f, f_inv = self.forward, self.inverse
        if (f.states, f.variables) != (f_inv.states, f_inv.variables):
            problem = "its state or variables of interest and those of the forward model differ; train both alike"
            raise ConfigError("inverse_model", problem)
        if isinstance(f_inv, NearestChoice):
            for name, usual in (("alpha", 1.0), ("noise", 0.0)):
                if (value := getattr(self, name)) != usual:
                    problem = f"choices are no numbers to be mixed; leave it at {usual:g}"
                    raise ConfigError(name, problem, given=f"{value:g}")

    def start(self, layout: Layout, rng: np.random.Generator) -> StateTransformationRun:
        """Return the grounding at the beginning of an episode.

        Raises:
            ConfigError: The world has another state or other actions than the models.
        """
        sizes = self.forward.states, self.forward.actions
        if sizes != (layout.states, layout.choices or len(layout.joints)):
            problem = f"the models are of {sizes[0]} states and {sizes[1]} actions, world= is not"
            raise ConfigError("grounding", problem)
        return StateTransformationRun(self, rng)


class StateTransformationRun:
    """The transformation in one episode; it remembers nothing."""

    def __init__(self, grounding: StateTransformation, rng: np.random.Generator) -> None:
        self._grounding, self._rng = grounding, rng
        self._draws = Draws(rng) if grounding.draws else None

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return the grounded action, shape (n_actions,)."""
        grounding = self._grounding
        if not grounding.forward.choices:
            action = np.minimum(np.maximum(action, -1.0), 1.0)  # as f has seen them
        wanted = grounding.forward.change(observation, action, self._draws)
        match = grounding.inverse.action(observation, action, wanted)
        if grounding.forward.choices:
            return match
        sent = ground(action, match, grounding.alpha)
        if grounding.noise:
            sent = sent + grounding.noise * self._rng.standard_normal(len(sent))
        return np.asarray(np.minimum(np.maximum(sent, -1.0), 1.0))


@dataclass(frozen=True)
class TableTransformation:
    """A grounding ready to act where states and actions are few; what was never seen is left alone.

    Attributes:
        forward: Of the real world.
        inverse: Of the simulator.
        draws: Whether the next state is drawn, or the likeliest one.
    """

    forward: Counts
    inverse: Counts
    draws: bool = False

    @property
    def chances(self) -> np.ndarray:
        """P(carried-out action | s, a), shape (S, A, A)."""
        wanted, undo = self.forward.chances if self.draws else self.forward.modes, self.inverse.undo
        actions = wanted.shape[1]
        does = np.eye(actions + 1)[undo][:, :, :actions]  # -1 is the last row, which does nothing
        reproduced = np.einsum("sat,stb->sab", wanted, does)
        left: np.ndarray = reproduced + (1.0 - reproduced.sum(axis=2, keepdims=True)) * np.eye(actions)
        return left

    def ground(self, table: Table) -> Table:
        """Return the simulator as it is with the grounding in front of it."""
        sent = self.chances
        chances = np.einsum("sab,sbt->sat", sent, table.chances)
        paid = np.einsum("sab,sbt->sat", sent, table.chances * table.rewards)
        return Table.paying(chances, paid, table.terminal, table.start)

    def start(self, layout: Layout, rng: np.random.Generator) -> TableTransformationRun:
        """Return the grounding at the beginning of an episode.

        Raises:
            ConfigError: The world has other states or actions than the models.
        """
        if self.forward.seen.shape[:2] != (layout.cells, layout.choices):
            raise ConfigError("grounding", "the models are of other states or actions than the world")
        return TableTransformationRun(self.chances, rng)


class TableTransformationRun:
    """The transformation in one episode."""

    def __init__(self, sent: np.ndarray, rng: np.random.Generator) -> None:
        self._sums, self._rng = np.cumsum(sent, axis=2), rng

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return the number of the grounded action, shape (1,)."""
        sums = self._sums[int(observation[0]), int(action[0])]
        place = int(np.searchsorted(sums, self._rng.random(), side="right"))
        return np.array([float(min(place, len(sums) - 1))])
