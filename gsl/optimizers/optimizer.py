"""What improves a policy beside a search over candidates: a learner that acts in the simulator itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol, runtime_checkable

import gymnasium
import numpy as np

from gsl.core.table import Table
from gsl.policies.policy import Policy


class Simulator(Protocol):
    """The simulator, grounded, as a learner sees it."""

    def env(self) -> gymnasium.Env:
        """Return a gymnasium environment that rewards what the task rewards."""

    def table(self) -> Table:
        """Return all transitions and rewards, if they are known."""


@runtime_checkable
class Learner(Protocol):
    """Improves parameters a generation at a time; it does not go on after a kill, but begins again."""

    @property
    def generations(self) -> int:
        """How often parameters are kept."""

    @property
    def taken(self) -> int:
        """Steps that it takes in the simulator, none of one that asks for its table."""

    def learn(
        self,
        simulator: Simulator,
        policy: Policy,
        parameters: np.ndarray,
        seed: int,
        *,
        bold: bool,
        advance: Callable[[int], None],
    ) -> Iterator[np.ndarray]:
        """Yield the parameters after each generation.

        Args:
            simulator: To learn in.
            policy: Whose parameters they are.
            parameters: Where to begin, shape (n_parameters,).
            seed: Of all randomness.
            bold: Whether they are π0's own start values, from which nothing has been learned yet.
            advance: Is told how many steps more are taken.
        """
