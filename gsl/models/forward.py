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

BASE = "base."  # begins the names of the base's arrays in a checkpoint


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
        base: A model whose answer the network corrects, of the same joints, past and horizon; none if it needs none.
        multi_step: Ticks over which it was fitted to its own answers, 1 for none.
    """

    kind: ClassVar[str] = "forward_model"

    network: Network
    history: History
    joints: tuple[str, ...]
    encoding: Encoding = "plain"
    horizon: int = 1
    head: Head = Head()
    memory: np.ndarray = field(default_factory=lambda: np.zeros(1))
    base: ForwardModel | None = None
    multi_step: int = 1

    def __post_init__(self) -> None:
        """Hold network and windows together."""
        check_sizes(self.network, self.history, self.joints, self.encoding, self.head)
        if self.base is not None:
            assert (self.base.joints, self.base.horizon) == (self.joints, self.horizon), "a base of another robot"
            alike = self.base.history.ticks == self.history.ticks and not self.base.history.sensors
            assert alike, "a base with other windows"

    def effect(self, window: np.ndarray, draws: Draws | None = None) -> np.ndarray:
        """Return the expected change [rad], shape (n_joints,); with `draws`, one of what may happen."""
        raw = self.network.predict(window)
        change = decode(self.head.expect(raw) if draws is None else self.head.draw(raw, draws), self.encoding)
        return change if self.base is None else change + self.base.effect(window[: self.base.network.inputs])

    def effects(self, windows: np.ndarray) -> np.ndarray:
        """Return the expected changes [rad], shape (N, n_joints), for many windows."""
        return decode(self.head.expect(self.network.predict_many(windows)), self.encoding) + self.predict_base(windows)

    def predict_base(self, windows: np.ndarray) -> np.ndarray | float:
        """Return what the base says of many windows [rad], shape (N, n_joints), or 0."""
        return 0.0 if self.base is None else self.base.effects(windows[:, : self.base.network.inputs])

    def surprise(self, windows: np.ndarray, changes: np.ndarray) -> np.ndarray:
        """Return the negative log likelihood of changes, shape (N, n_joints), per output in nats, shape (N,).

        Only a model with a distribution has one.
        """
        outputs = encode(changes - self.predict_base(windows), self.encoding)
        return self.head.surprise(self.network.predict_many(windows), outputs) / outputs.shape[1]

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint stores."""
        base = {} if self.base is None else self.base.arrays()
        return {**self.network.arrays(), "memory": self.memory, **{BASE + name: value for name, value in base.items()}}

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says of the arrays."""
        return {
            "kind": self.kind,
            "joints": list(self.joints),
            "history": vars(self.history),
            "encoding": self.encoding,
            "horizon": self.horizon,
            "multi_step": self.multi_step,
            **vars(self.head),
            **({} if self.base is None else {"base": self.base.description()}),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> ForwardModel:
        """Return the model that a checkpoint holds."""
        network, history = Network.from_arrays(arrays), history_from(about["history"])
        head, base = Head(about["likelihood"], about["components"]), None
        if "base" in about:
            below = {name.removeprefix(BASE): array for name, array in arrays.items() if name.startswith(BASE)}
            base = cls.from_arrays(below, about["base"])
        joints, multi_step = tuple(about["joints"]), about.get("multi_step", 1)
        return cls(
            network, history, joints, about["encoding"], about["horizon"], head, arrays["memory"], base, multi_step
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
