"""Models of a world of few states and actions: how often each transition was seen (the paper's section 8.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gsl.core.trajectory import Trajectory
from gsl.errors import InputError


@dataclass(frozen=True)
class Counts:
    """How often an action led from one state to another.

    Attributes:
        seen: Shape (S, A, S).
        kind: `forward_model` of the real world, `inverse_model` of the simulator.
    """

    space: ClassVar[str] = "counts"

    seen: np.ndarray
    kind: str = "forward_model"

    @property
    def chances(self) -> np.ndarray:
        """P(s' | s, a), shape (S, A, S); rows of 0 where nothing was seen."""
        total = self.seen.sum(axis=2, keepdims=True)
        chances: np.ndarray = np.divide(self.seen, total, out=np.zeros(self.seen.shape), where=total > 0)
        return chances

    @property
    def modes(self) -> np.ndarray:
        """P(s' | s, a) with all of it on the likeliest state, the first of equally likely ones, shape (S, A, S)."""
        modes: np.ndarray = np.eye(len(self.seen))[self.seen.argmax(axis=2)] * (
            self.seen.sum(axis=2, keepdims=True) > 0
        )
        return modes

    @property
    def undo(self) -> np.ndarray:
        """Action that leads from one state to another likeliest, -1 where none was seen to, shape (S, S)."""
        chances = self.chances
        undo: np.ndarray = np.where(chances.max(axis=1) > 0.0, chances.argmax(axis=1), -1)
        return undo

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint stores."""
        return {"seen": self.seen.astype(np.float64)}

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says of the arrays."""
        return {"kind": self.kind, "space": self.space, "method": "counts"}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> Counts:
        """Return the model that a checkpoint holds."""
        return cls(arrays["seen"], about["kind"])


def count_transitions(episodes: Sequence[Trajectory], cells: int, choices: int) -> np.ndarray:
    """Return how often each transition occurs in some episodes, shape (S, A, S); actions are those carried out.

    Raises:
        InputError: A state or an action is not the number of one.
    """
    seen = np.zeros((cells, choices, cells))
    for episode in episodes:
        assert episode.state is not None, "a world of cells has states"
        sent = episode.action if episode.grounded_action is None else episode.grounded_action
        state, chosen = _numbers(episode.state[:, 0], cells, "state"), _numbers(sent[:, 0], choices, "action")
        np.add.at(seen, (state[:-1], chosen, state[1:]), 1.0)
    return seen


def _numbers(values: np.ndarray, count: int, what: str) -> np.ndarray:
    numbers = values.astype(int)
    wrong = (numbers != values) | (numbers < 0) | (numbers >= count)
    if wrong.any():
        raise InputError(f"{what} {values[wrong.argmax()]:g} is not one of the {count}, 0 to {count - 1}")
    return numbers
