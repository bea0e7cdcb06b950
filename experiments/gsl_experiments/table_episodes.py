"""Episodes in a world that is a table, many at once: what they return, and which transitions they show."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.table import Table


class Episodes(NamedTuple):
    """What some episodes come to.

    Attributes:
        returns: Shape (episodes,).
        seen: How often each transition occurred, shape (S, A, S).
    """

    returns: np.ndarray
    seen: np.ndarray


def play(
    table: Table, policy: np.ndarray, episodes: int, rng: np.random.Generator, *, explore: float = 0.0, most: int = 1000
) -> Episodes:
    """Play episodes side by side.

    Args:
        table: The world.
        policy: An action a state, shape (S,).
        episodes: How many.
        rng: Draws.
        explore: Chance of an action drawn uniformly from all.
        most: Steps, after which an episode is cut.
    """
    cells, choices = table.chances.shape[:2]
    sums = table.chances.cumsum(axis=2)
    state = rng.choice(cells, size=episodes, p=table.start)
    returns, seen, going = np.zeros(episodes), np.zeros(table.chances.shape), np.arange(episodes)
    for _ in range(most):
        going = going[~table.terminal[state[going]]]
        if not len(going):
            break
        here, other = state[going], rng.random(len(going)) < explore
        action = np.where(other, rng.integers(choices, size=len(going)), policy[here])
        after = (sums[here, action] <= rng.random(len(going))[:, None]).sum(axis=1)
        after = np.minimum(after, cells - 1)
        np.add.at(seen, (here, action, after), 1.0)
        returns[going] += table.rewards[here, action, after]
        state[going] = after
    return Episodes(returns, seen)
