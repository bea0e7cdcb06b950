"""A forward model: the change of the joint positions that an action brings about in a state, f(s, a)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from gsl.core.angles import Encoding, decode, encode
from gsl.core.draws import Draws
from gsl.core.history import History
from gsl.models.head import Head
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
        head: How its outputs are read.
        memory: Correlation of its errors from one tick to the next, which draws keep, shape (n_outputs,).
    """

    kind: ClassVar[str] = "forward_model"

    network: Network
    history: History
    joints: tuple[str, ...]
    encoding: Encoding = "plain"
    horizon: int = 1
    head: Head = Head()
    memory: np.ndarray = field(default_factory=lambda: np.zeros(1))

    def __post_init__(self) -> None:
        """Hold network and windows together."""
        check_sizes(self.network, self.history, self.joints, self.encoding, self.head)

    def effect(self, window: np.ndarray, draws: Draws | None = None) -> np.ndarray:
        """Return the expected change [rad], shape (n_joints,); with `draws`, one of what may happen."""
        raw = self.network.predict(window)
        return decode(self.head.expected(raw) if draws is None else self.head.drawn(raw, draws), self.encoding)

    def effects(self, windows: np.ndarray) -> np.ndarray:
        """Return the expected changes [rad], shape (N, n_joints), for many windows."""
        return decode(self.head.expected(self.network.predict_many(windows)), self.encoding)

    def surprise(self, windows: np.ndarray, changes: np.ndarray) -> np.ndarray:
        """Return the negative log likelihood of changes, shape (N, n_joints), per output in nats, shape (N,).

        Only a model with a distribution has one.
        """
        outputs = encode(changes, self.encoding)
        return self.head.surprise(self.network.predict_many(windows), outputs) / outputs.shape[1]

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint stores."""
        return {**self.network.arrays(), "memory": self.memory}

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says of the arrays."""
        return {
            "kind": self.kind,
            "joints": list(self.joints),
            "history": vars(self.history),
            "encoding": self.encoding,
            "horizon": self.horizon,
            **vars(self.head),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> ForwardModel:
        """Return the model that a checkpoint holds."""
        network, history = Network.from_arrays(arrays), history_from(about["history"])
        head = Head(about["likelihood"], about["components"])
        return cls(
            network, history, tuple(about["joints"]), about["encoding"], about["horizon"], head, arrays["memory"]
        )


def history_from(stored: Mapping[str, Any]) -> History:
    """Return a history as a checkpoint describes it."""
    return History(**{**stored, "sensors": tuple(stored["sensors"])})


def check_sizes(
    network: Network, history: History, joints: tuple[str, ...], encoding: Encoding, head: Head | None = None
) -> None:
    """Assert that a network takes windows and answers for every joint."""
    n = len(joints)
    outputs = (head or Head()).width(n if encoding == "plain" else 2 * n)
    assert network.inputs == history.size(n), f"{network.inputs} inputs but windows of {history.size(n)}"
    assert network.outputs == outputs, f"{network.outputs} outputs but {outputs} are due"
