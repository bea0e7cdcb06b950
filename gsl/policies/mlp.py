"""A small network on the state of any world, with tanh between its layers; without a hidden layer it is linear."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Annotated

import numpy as np

from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.errors import ConfigError


@component
class Mlp:
    """a = W_k tanh(... tanh(W_1 s + b_1) ...) + b_k, clipped to [-1, 1]; of discrete actions the largest is taken.

    π0 has random hidden layers, of one size for all states, and a last layer of 0: it acts with 0.
    """

    hidden: Annotated[
        tuple[Annotated[int, setting("", ge=1)], ...], setting("units of the hidden layers; none for a linear policy")
    ] = (64, 64)
    seed: Annotated[int, setting("of the first weights", ge=0)] = 0
    sizes: Annotated[tuple[int, int, int], setting("states, actions, choices; by default the world's")] = (1, 1, 0)

    def size_for(self, layout: Layout) -> Mlp:
        """Return the policy for a world.

        Raises:
            ConfigError: The world is a robot, whose policies are others.
        """
        if not layout.states:
            raise ConfigError("policy", "acts on the state of a gymnasium environment; this world is a robot")
        return replace(self, sizes=(layout.states, layout.choices or len(layout.joints), layout.choices))

    @property
    def widths(self) -> tuple[int, ...]:
        """Number of values from the state to the action."""
        return (self.sizes[0], *self.hidden, self.sizes[1])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order: weights, row by row, then biases, layer by layer."""
        return tuple(
            name
            for layer, (wide, narrow) in enumerate(pairwise(self.widths))
            for name in (
                *(f"weight_{layer}.{row}.{column}" for row in range(narrow) for column in range(wide)),
                *(f"bias_{layer}.{row}" for row in range(narrow)),
            )
        )

    @property
    def initial(self) -> np.ndarray:
        """The parameters of π0."""
        rng, layers = np.random.default_rng(self.seed), list(pairwise(self.widths))
        first = [(rng.standard_normal((narrow, wide)) / np.sqrt(wide), np.zeros(narrow)) for wide, narrow in layers]
        weight, bias = first[-1]
        return vector_of([*first[:-1], (0.0 * weight, bias)])

    @property
    def scale(self) -> np.ndarray:
        """Size of a step in each parameter that is as bold as in any other: weights of wide layers are small."""
        sizes = [np.full((narrow, wide + 1), 1.0 / np.sqrt(wide)) for wide, narrow in pairwise(self.widths)]
        return vector_of([(size[:, 1:], size[:, 0]) for size in sizes])

    def layers(self, parameters: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return weights and biases, shapes (n_out, n_in) and (n_out,), of parameters."""
        layers, start = [], 0
        for wide, narrow in pairwise(self.widths):
            middle, end = start + wide * narrow, start + (wide + 1) * narrow
            layers.append((parameters[start:middle].reshape(narrow, wide), parameters[middle:end]))
            start = end
        return layers

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return nothing: the environment has its own start."""
        return np.zeros(0)

    def start(self, parameters: np.ndarray, layout: Layout) -> MlpRun:
        """Return the policy at the beginning of an episode."""
        return MlpRun(self.layers(np.asarray(parameters, dtype=float)), discrete=layout.choices > 0)


def vector_of(layers: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return weights and biases as parameters."""
    return np.concatenate([part.ravel() for layer in layers for part in layer])


class MlpRun:
    """The network in one episode; it remembers nothing."""

    def __init__(self, layers: list[tuple[np.ndarray, np.ndarray]], *, discrete: bool) -> None:
        self._hidden, (self._weight, self._bias) = layers[:-1], layers[-1]
        self._discrete = discrete

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return the action, shape (n_actions,), from -1 to 1 or the number of a choice."""
        values = observation
        for weight, bias in self._hidden:
            values = np.tanh(weight @ values + bias)
        values = self._weight @ values + self._bias
        if self._discrete:
            return np.array([float(np.argmax(values))])
        return np.minimum(np.maximum(values, -1.0), 1.0)
