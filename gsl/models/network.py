"""A network's weights as they act: affine layers with tanh between them; with one layer it is a linear model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from gsl.core.scaling import Scaling

Samples = tuple[np.ndarray, np.ndarray]
"""Inputs, shape (N, n), and what they should give, shape (N, m)."""


class Network:
    """y = W_k tanh(... tanh(W_1 x + b_1) ...) + b_k, in single precision, for one sample at a time.

    Acting multiplies matrices with vectors, so that its time is that of reading the weights.
    """

    def __init__(self, layers: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        self.layers = tuple(tuple(np.ascontiguousarray(part, dtype=np.float32) for part in layer) for layer in layers)
        for (_, before), (weight, _) in pairwise(self.layers):
            assert weight.shape[1] == len(before), f"{weight.shape=} but {before.shape=}"
        self._prepare()

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return int(self.layers[0][0].shape[1])

    def same(self, other: Network) -> bool:
        """Whether another network has the same weights."""
        ours, theirs = self.arrays(), other.arrays()
        return ours.keys() == theirs.keys() and all(np.array_equal(ours[name], theirs[name]) for name in ours)

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        return len(self.layers[-1][1])

    def predict(self, features: np.ndarray) -> np.ndarray:
        """Return the outputs for one sample, shape (inputs,)."""
        self._inputs[:] = features
        values = self._first
        for weight, output, with_one in self._hidden:
            np.tanh(np.dot(weight, values, out=output), out=output)
            values = with_one
        outputs: np.ndarray = np.dot(self._last, values)
        return outputs

    def predict_many(self, features: np.ndarray) -> np.ndarray:
        """Return the outputs for many samples, (N, inputs) -> (N, outputs)."""
        values = features
        for weight, bias in self.layers[:-1]:
            values = np.tanh(values @ weight.T + bias)
        weight, bias = self.layers[-1]
        outputs: np.ndarray = values @ weight.T + bias
        return outputs

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights by name."""
        named = [(f"layer_{k}.weight", f"layer_{k}.bias") for k in range(len(self.layers))]
        pairs = zip(named, self.layers, strict=True)
        return {name: array for names, layer in pairs for name, array in zip(names, layer, strict=True)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> Network:
        """Return the network that `arrays` describes."""
        count = sum(name.startswith("layer_") and name.endswith(".weight") for name in arrays)
        return cls([(arrays[f"layer_{k}.weight"], arrays[f"layer_{k}.bias"]) for k in range(count)])

    def _prepare(self) -> None:
        """Allocate what `predict` works in; each bias becomes a column that meets a one at the end of the input."""
        whole = [np.ascontiguousarray(np.column_stack(layer)) for layer in self.layers]
        self._last = whole[-1]
        self._first = np.ones(self.inputs + 1, dtype=np.float32)
        self._inputs = self._first[:-1]
        outputs = [np.ones(len(weight) + 1, dtype=np.float32) for weight in whole[:-1]]
        self._hidden = [(weight, output[:-1], output) for weight, output in zip(whole[:-1], outputs, strict=True)]

    def __getstate__(self) -> dict[str, Any]:
        return {"layers": self.layers}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.layers = state["layers"]
        self._prepare()


def unscale(layers: Sequence[tuple[np.ndarray, np.ndarray]], inputs: Scaling, outputs: Scaling) -> Network:
    """Return the network that takes and gives plain values, given one that was fitted to scaled ones."""
    first, bias = layers[0]
    folded = [(first / inputs.sd, bias - first @ (inputs.mean / inputs.sd)), *layers[1:]]
    last, bias = folded[-1]
    return Network([*folded[:-1], (last * outputs.sd[:, None], bias * outputs.sd + outputs.mean)])
