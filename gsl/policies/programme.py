"""A programme is a list of open-loop episodes that a policy offers; each plays its commands whatever the robot does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from gsl.core.interfaces import Policy
from gsl.core.layout import Layout


class Piece(NamedTuple):
    """One episode of a programme: its label, the policy's parameters for it, and what else a log should say of it."""

    label: str
    parameters: np.ndarray
    about: Mapping[str, Any]


@runtime_checkable
class Programmed(Policy, Protocol):
    """A policy that says which episodes it wants to play."""

    @property
    def programme(self) -> tuple[Piece, ...]:
        """The episodes, in order."""


class OpenLoopRun:
    """Commands being played, one a tick; the last one is held. It ends by itself, after `ticks`."""

    def __init__(self, commands: np.ndarray) -> None:
        self.ticks = len(commands)
        self._commands, self._next = commands, 0

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return desired joint positions [rad], shape (n_joints,)."""
        row = self._commands[min(self._next, self.ticks - 1)]
        self._next += 1
        return row


@dataclass(frozen=True)
class Playback:
    """Plays given commands; its one parameter is the number of the episode.

    Attributes:
        episodes: Their names.
        commands: Desired joint positions of each episode in the order of the world's joints [rad], shape (T, n_joints).
    """

    episodes: tuple[str, ...]
    commands: tuple[np.ndarray, ...]

    names = ("episode",)
    initial = np.zeros(1)
    scale = np.zeros(1)

    @property
    def programme(self) -> tuple[Piece, ...]:
        """Every episode once."""
        return tuple(Piece(name, np.array([float(index)]), {}) for index, name in enumerate(self.episodes))

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return the first command [rad], shape (n_joints,)."""
        return self.commands[int(parameters[0])][0]

    def start(self, parameters: np.ndarray, layout: Layout) -> OpenLoopRun:
        """Return the episode at its beginning."""
        return OpenLoopRun(self.commands[int(parameters[0])])
