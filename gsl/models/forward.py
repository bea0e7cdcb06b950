"""A forward model: the change of the joint positions that an action brings about in a state, f(s, a)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gsl.core.angles import Encoding, decode
from gsl.core.history import History
from gsl.models.network import Network


@dataclass(frozen=True)
class ForwardModel:
    """A network with what it was told and what it answers.

    Attributes:
        network: Window to encoded change.
        history: What its windows hold.
        joints: Names of the joints, in order.
        encoding: Of its outputs.
        horizon: Ticks ahead.
    """

    kind: ClassVar[str] = "forward_model"

    network: Network
    history: History
    joints: tuple[str, ...]
    encoding: Encoding = "plain"
    horizon: int = 1

    def __post_init__(self) -> None:
        """Hold network and windows together."""
        check_sizes(self.network, self.history, self.joints, self.encoding)

    def effect(self, window: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the change [rad], shape (n_joints,); a model that knows its uncertainty draws it with `rng`."""
        return decode(self.network.predict(window), self.encoding)

    def effects(self, windows: np.ndarray) -> np.ndarray:
        """Return the expected changes [rad], shape (N, n_joints), for many windows."""
        return decode(self.network.predict_many(windows), self.encoding)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint stores."""
        return self.network.arrays()

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says of the arrays."""
        return {
            "kind": self.kind,
            "joints": list(self.joints),
            "history": vars(self.history),
            "encoding": self.encoding,
            "horizon": self.horizon,
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> ForwardModel:
        """Return the model that a checkpoint holds."""
        network, history = Network.from_arrays(arrays), history_from(about["history"])
        return cls(network, history, tuple(about["joints"]), about["encoding"], about["horizon"])


def history_from(stored: Mapping[str, Any]) -> History:
    """Return a history as a checkpoint describes it."""
    return History(**{**stored, "sensors": tuple(stored["sensors"])})


def check_sizes(network: Network, history: History, joints: tuple[str, ...], encoding: Encoding) -> None:
    """Assert that a network takes windows and answers for every joint."""
    n = len(joints)
    outputs = n if encoding == "plain" else 2 * n
    assert network.inputs == history.size(n), f"{network.inputs} inputs but windows of {history.size(n)}"
    assert network.outputs == outputs, f"{network.outputs} outputs but {outputs} are due"
