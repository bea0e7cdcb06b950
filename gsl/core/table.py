"""A world of few states and actions as a table, solved exactly: policy evaluation and policy iteration.

Undiscounted, as in the paper's section 8.1. What never ends is worth -`step cost` / `ENDLESS`, a very low value, so
that every policy has one. Sutton, Barto: Reinforcement learning (2018), chapter 4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

ENDLESS = 1e-9  # chance per step that an episode stops by itself
TIE = 1e-6  # difference of values below which two actions are equally good
ROUNDS = 1000

Outcomes = Mapping[int, Mapping[int, Sequence[tuple[float, int, float, bool]]]]
"""Gymnasium's form: P[state][action] = [(probability, next state, reward, terminated), ...]."""


@dataclass(frozen=True)
class Table:
    """Transitions and rewards of S states and A actions.

    Attributes:
        chances: P(s' | s, a), shape (S, A, S).
        rewards: Of a transition, shape (S, A, S).
        terminal: States that end an episode, shape (S,).
        start: Distribution of the first state, shape (S,).
    """

    chances: np.ndarray
    rewards: np.ndarray
    terminal: np.ndarray
    start: np.ndarray

    @classmethod
    def of(cls, outcomes: Outcomes, start: np.ndarray) -> Table:
        """Return the table that an environment's `P` describes."""
        n, m = len(outcomes), len(outcomes[0])
        chances, paid, terminal = np.zeros((n, m, n)), np.zeros((n, m, n)), np.zeros(n, dtype=bool)
        for state, actions in outcomes.items():
            for action, entries in actions.items():
                for chance, after, reward, ended in entries:
                    chances[state, action, after] += chance
                    paid[state, action, after] += chance * reward
                    terminal[after] |= ended
        return cls.paying(chances, paid, terminal, start)

    @classmethod
    def paying(cls, chances: np.ndarray, paid: np.ndarray, terminal: np.ndarray, start: np.ndarray) -> Table:
        """Return the table whose transitions pay `paid` on average, chances times rewards, shape (S, A, S)."""
        rewards = np.divide(paid, chances, out=np.zeros_like(paid), where=chances > 0.0)
        return cls(chances, rewards, terminal, start)

    def disturb(self, noise: float) -> Table:
        """Return the table of a world that replaces an action, with chance `noise`, by one drawn from all."""
        if not noise:
            return self
        paid = self.chances * self.rewards
        chances, paid = (
            (1.0 - noise) * array + noise * array.mean(axis=1, keepdims=True) for array in (self.chances, paid)
        )
        return Table.paying(chances, paid, self.terminal, self.start)

    def values(self, policy: np.ndarray) -> np.ndarray:
        """Return the expected return from every state, shape (S,), of a policy: an action a state, shape (S,)."""
        rows = np.arange(len(policy))
        going = np.where(self.terminal[:, None], 0.0, (1.0 - ENDLESS) * self.chances[rows, policy])
        paid = np.where(self.terminal, 0.0, (self.chances * self.rewards).sum(axis=2)[rows, policy])
        values: np.ndarray = np.linalg.solve(np.eye(len(policy)) - going, paid)
        return values

    def value(self, policy: np.ndarray) -> float:
        """Return the expected return of a policy from the start."""
        return float(self.start @ self.values(policy))

    def improve(self, policy: np.ndarray) -> np.ndarray:
        """Return the greedy policy on a policy's values, shape (S,).

        Of equally good actions it keeps the policy's own, else takes the first.
        """
        values = np.where(self.terminal, 0.0, self.values(policy))
        worth = (self.chances * (self.rewards + (1.0 - ENDLESS) * values)).sum(axis=2)
        good = worth >= worth.max(axis=1, keepdims=True) - TIE
        kept = good[np.arange(len(policy)), policy]
        choices: np.ndarray = np.where(kept, policy, good.argmax(axis=1))
        return choices

    def solve(self, policy: np.ndarray) -> np.ndarray:
        """Return an optimal policy by policy iteration from another, shape (S,)."""
        for _ in range(ROUNDS):
            better = self.improve(policy)
            if np.array_equal(better, policy):
                break
            policy = better
        return policy
