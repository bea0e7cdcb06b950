"""The multi-step loss: how far a network is off after each of several ticks in which it is fed with its own answers.

A grounded simulator asks f about states to which f itself has led. Least errors of one tick are not least errors there:
Venkatraman, Hebert, Bagnell: Improving multi-step prediction of learned time series models (2015).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from gsl.core.history import window_parts
from gsl.core.scaling import Scaling
from gsl.models.free_run import Segments

STILL = 1e-12  # [rad²]; of a robot that does not move
Answer = Callable[[torch.Tensor], torch.Tensor]
"""From windows, shape (N, inputs), to changes of the joint positions [rad], shape (N, n_joints)."""


def answering(network: torch.nn.Module, input_scaling: Scaling, output_scaling: Scaling) -> Answer:
    """Return what a network that takes and gives scaled values answers in plain ones."""
    (mean, sd), (shift, scale) = (
        tuple(map(tensor, (scaling.mean, scaling.sd))) for scaling in (input_scaling, output_scaling)
    )
    return lambda windows: network((windows - mean) / sd) * scale + shift


def measure_travel(pieces: Segments) -> np.ndarray:
    """Return the mean square of how far joints move from the start of pieces up to each tick [rad²], shape (ticks,).

    All joints count alike, as in the check's errors: one that moves little has little to be wrong by.
    """
    starts = pieces.position[pieces.starts]
    moved = [np.mean((pieces.position[pieces.starts + k] - starts) ** 2) for k in range(1, pieces.ticks + 1)]
    return np.maximum(moved, STILL)


class MultiStep:
    """Pieces of trajectories, and the loss of a network on them: the mean over ticks of squared errors, each scaled."""

    def __init__(self, pieces: Segments, scale: np.ndarray) -> None:
        shape = len(pieces.starts), pieces.history.span + pieces.ticks + 1
        columns = pieces.position, pieces.action, pieces.sensed
        by_tick = [tensor(column.reshape(*shape, column.shape[1]).swapaxes(0, 1)) for column in columns]
        self._position, self._action, self._sensed = by_tick
        self._history, self._scale = pieces.history, tensor(scale)

    def __len__(self) -> int:
        return self._position.shape[1]

    def loss(self, answer: Answer, chosen: torch.Tensor | None = None) -> torch.Tensor:
        """Return the loss on some of the pieces, by index, or on all."""
        pieces = self._position, self._action, self._sensed
        position, action, sensed = pieces if chosen is None else (column[:, chosen] for column in pieces)
        now = self._history.span
        x = list(position[: now + 1])
        for tick in range(now, len(position) - 1):
            x.append(x[tick] + answer(torch.cat(window_parts(self._history, x, action, sensed, tick), dim=1)))
        errors = torch.stack(x[now + 1 :]) - position[now + 1 :]
        return (errors.square().mean(dim=(1, 2)) / self._scale).mean()


def tensor(values: np.ndarray) -> torch.Tensor:
    """Return numbers as torch computes with them."""
    return torch.as_tensor(values, dtype=torch.float32)
