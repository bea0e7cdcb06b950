"""An ensemble of forward models: each is fitted to its own draw of the trajectories; where they disagree, none knows.

Lakshminarayanan, Pritzel, Blundell: Simple and scalable predictive uncertainty estimation using deep ensembles (2017).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gsl.core.draws import Draws
from gsl.core.history import History
from gsl.models.forward import ForwardModel
from gsl.models.head import Head

USUAL = 0.95  # quantile of the disagreement on trajectories that no member has seen, which counts as agreement


@dataclass(frozen=True)
class Ensemble:
    """A forward model that knows where it knows nothing.

    Attributes:
        members: Of the same windows, joints and outputs.
        usual: How much they disagree, at most, where there are data [rad], shape (n_joints,).
    """

    members: tuple[ForwardModel, ...]
    usual: np.ndarray

    @property
    def history(self) -> History:
        """What its windows hold."""
        return self.members[0].history

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in order."""
        return self.members[0].joints

    @property
    def base(self) -> ForwardModel | None:
        """What its members correct."""
        return self.members[0].base

    @property
    def horizon(self) -> int:
        """Ticks ahead."""
        return self.members[0].horizon

    @property
    def multi_step(self) -> int:
        """Ticks over which its members were fitted to their own answers."""
        return self.members[0].multi_step

    @property
    def head(self) -> Head:
        """How its members' outputs are read."""
        return self.members[0].head

    @property
    def memory(self) -> np.ndarray:
        """Of its members' errors, on average, see `ForwardModel`."""
        return np.mean([member.memory for member in self.members], axis=0)

    def effect(self, window: np.ndarray, draws: Draws | None = None) -> np.ndarray:
        """Return the expected change [rad], shape (n_joints,), or a draw of a member that is drawn too."""
        if draws is None:
            return np.mean([member.effect(window) for member in self.members], axis=0)
        return self.members[draws.index(len(self.members))].effect(window, draws)

    def effects(self, windows: np.ndarray) -> np.ndarray:
        """Return the expected changes [rad], shape (N, n_joints), for many windows."""
        return np.mean([member.effects(windows) for member in self.members], axis=0)

    def surprise(self, windows: np.ndarray, changes: np.ndarray) -> np.ndarray:
        """Return the negative log likelihood of changes as `ForwardModel.surprise` does; any member may have drawn."""
        width = changes.shape[1] if self.members[0].encoding == "plain" else 2 * changes.shape[1]
        each = -width * np.array([member.surprise(windows, changes) for member in self.members])
        surprise: np.ndarray = -(np.logaddexp.reduce(each, axis=0) - np.log(len(each))) / width
        return surprise

    def judge(self, window: np.ndarray, draws: Draws | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return what `effect` does, and the members' disagreement, 1 where it is as large as data explain."""
        each = [member.effect(window) for member in self.members]
        change = np.mean(each, axis=0) if draws is None else self.effect(window, draws)
        return change, np.std(each, axis=0) / self.usual

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint stores."""
        return {
            "usual": self.usual,
            **{
                f"member_{k}.{name}": array
                for k, member in enumerate(self.members)
                for name, array in member.arrays().items()
            },
        }

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says of the arrays."""
        return {**self.members[0].description(), "members": len(self.members)}


Forward = ForwardModel | Ensemble


def ensemble(members: tuple[ForwardModel, ...], windows: np.ndarray) -> Ensemble:
    """Return an ensemble whose usual disagreement is that on some windows, shape (N, size), no member has seen."""
    apart = np.std([member.effects(windows) for member in members], axis=0)
    return Ensemble(members, np.maximum(np.quantile(apart, USUAL, axis=0), 1e-9))


def forward_from(arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> Forward:
    """Return the forward model, one or several, that a checkpoint holds."""
    if "members" not in about:
        return ForwardModel.from_arrays(arrays, about)
    parts = [_of(arrays, f"member_{k}.") for k in range(about["members"])]
    return Ensemble(tuple(ForwardModel.from_arrays(part, about) for part in parts), arrays["usual"])


def _of(arrays: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
