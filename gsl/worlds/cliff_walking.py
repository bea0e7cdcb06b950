"""Cliff Walking (the paper's section 8.1; Sutton and Barto, example 6.6): along a cliff from one corner to the other.

    . . . . . . . . . . . .
    . . . . . . . . . . . .
    . . . . . . . . . . . .
    S c c c c c c c c c c G

Reaching G is worth 100, falling off the cliff -10, every step -0.1; both end the episode; a step into a wall leaves the
agent where it is. In a noisy world an action is replaced, with the chance `noise`, by one drawn from all four.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

ROWS, COLUMNS = 4, 12
MOVES = ((-1, 0), (0, 1), (1, 0), (0, -1))  # up, right, down, left: of equally good actions the first is taken
GOAL, CLIFF, STEP = 100.0, -10.0, -0.1
LONGEST = 1000  # steps of an episode

Outcome = tuple[float, int, float, bool]


class CliffWalking(gymnasium.Env):
    """States are cells, row by row from the upper left; `P` holds all transitions as in gymnasium's toy texts."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  gymnasium's own name and type

    def __init__(self, noise: float = 0.0) -> None:
        if not 0.0 <= noise <= 1.0:
            raise ValueError(f"noise={noise} is no chance between 0 and 1")
        self.noise = noise
        self.observation_space = gymnasium.spaces.Discrete(ROWS * COLUMNS)
        self.action_space = gymnasium.spaces.Discrete(len(MOVES))
        self.initial_state_distrib = np.eye(ROWS * COLUMNS)[(ROWS - 1) * COLUMNS]
        self.P = {
            state: {action: self._outcomes(state, action) for action in range(len(MOVES))}
            for state in range(ROWS * COLUMNS)
        }

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[int, dict[str, Any]]:
        """Begin in the lower left corner."""
        super().reset(seed=seed)
        self._state, self._steps = int(self.initial_state_distrib.argmax()), 0
        return self._state, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Move."""
        if self.np_random.random() < self.noise:
            action = int(self.np_random.integers(len(MOVES)))
        self._steps += 1
        self._state, reward, ended = _move(self._state, int(action))
        return self._state, reward, ended, self._steps >= LONGEST, {}

    def _outcomes(self, state: int, action: int) -> list[Outcome]:
        chances = self.noise / len(MOVES) + (1.0 - self.noise) * np.eye(len(MOVES))[action]
        return [(float(chance), *_move(state, move)) for move, chance in enumerate(chances) if chance > 0.0]


def _move(state: int, action: int) -> tuple[int, float, bool]:
    """Return where a move leads, what it is worth, and whether that is an end."""
    row, column = divmod(state, COLUMNS)
    down, right = MOVES[action]
    row, column = min(max(row + down, 0), ROWS - 1), min(max(column + right, 0), COLUMNS - 1)
    end = row == ROWS - 1 and column > 0
    reward = STEP + (GOAL if end and column == COLUMNS - 1 else CLIFF if end else 0.0)
    return row * COLUMNS + column, reward, end
