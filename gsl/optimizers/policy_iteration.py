"""Policy iteration on the table of the grounded simulator, exact (the paper's section 8.1)."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from gsl.core.interfaces import Policy, Simulator
from gsl.core.setting import component
from gsl.errors import ConfigError
from gsl.policies.table import ActionTable


@component
class PolicyIteration:
    """One generation: the optimum. Of equally good actions it keeps the policy's own, else takes the first."""

    @property
    def generations(self) -> int:
        """One."""
        return 1

    @property
    def steps_taken(self) -> int:
        """None."""
        return 0

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
        """Yield the optimal actions, see `Learner`."""
        if not isinstance(policy, ActionTable):
            raise ConfigError("policy", "policy iteration improves an action_table; say policy=action_table")
        yield simulator.table().solve(parameters.astype(int)).astype(float)
