"""What a network says of the next state: a point, a Gaussian, or a mixture of Gaussians (the paper's section 7).

Raw outputs of a Gaussian are m means and m logarithms of standard deviations; of a mixture of K Gaussians, K logits,
then K times m means, then K times m logarithms. A component of a mixture is one of all m outputs together, so that
joints that give way together are drawn together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gsl.core.draws import Draws
from gsl.core.scaling import Scaling

Likelihood = Literal["point", "gaussian", "mixture"]


@dataclass(frozen=True)
class Head:
    """How raw outputs are read.

    Attributes:
        likelihood: What they stand for.
        components: Of a mixture; 1 otherwise.
    """

    likelihood: Likelihood = "point"
    components: int = 1

    @property
    def draws(self) -> bool:
        """Whether there is something to draw."""
        return self.likelihood != "point"

    @property
    def logits(self) -> int:
        """Number of raw outputs that weigh components."""
        return self.components if self.likelihood == "mixture" else 0

    def width(self, m: int) -> int:
        """Return the number of raw outputs for m outputs."""
        if self.likelihood == "point":
            return m
        return 2 * m if self.likelihood == "gaussian" else self.components * (1 + 2 * m)

    def size(self, width: int) -> int:
        """Return m, given the number of raw outputs."""
        if self.likelihood == "point":
            return width
        return width // 2 if self.likelihood == "gaussian" else (width // self.components - 1) // 2

    def scaling(self, outputs: Scaling) -> Scaling:
        """Return the scaling of raw outputs whose outputs, shape (m,), are scaled."""
        if self.likelihood == "point":
            return outputs
        k, ones, zeros = self.components, np.ones(len(outputs.sd)), np.zeros(self.components)
        logits = self.logits
        mean = np.concatenate([zeros[:logits], np.tile(outputs.mean, k), np.tile(np.log(outputs.sd), k)])
        return Scaling(mean, np.concatenate([np.ones(logits), np.tile(outputs.sd, k), np.tile(ones, k)]))

    def parts(self, raw: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return weights, shape (..., K), means and standard deviations, shape (..., K, m), of a distribution."""
        k, logits = self.components, self.logits
        rest = raw[..., logits:].reshape(*raw.shape[:-1], 2, k, -1)
        grown = np.exp(raw[..., :logits] - raw[..., :logits].max(axis=-1, keepdims=True, initial=-np.inf))
        weights = grown / grown.sum(axis=-1, keepdims=True) if logits else np.ones((*raw.shape[:-1], 1))
        return weights, rest[..., 0, :, :], np.exp(rest[..., 1, :, :])

    def expect(self, raw: np.ndarray) -> np.ndarray:
        """Return the outputs to expect, shape (..., m); of a Gaussian they are its mode too."""
        if self.likelihood == "point":
            return raw
        if self.likelihood == "gaussian":
            return raw[..., : raw.shape[-1] // 2]
        weights, means, _ = self.parts(raw)
        mean: np.ndarray = (weights[..., None] * means).sum(axis=-2)
        return mean

    def surprise(self, raw: np.ndarray, outputs: np.ndarray) -> np.ndarray:
        """Return the negative log likelihood of outputs, shape (N, m), under raw outputs (N, width), in nats, (N,)."""
        weights, means, sds = self.parts(raw)
        squares = ((outputs[:, None] - means) / sds) ** 2
        each = np.log(weights) - 0.5 * (squares + np.log(2.0 * np.pi * sds**2)).sum(axis=-1)
        highest = each.max(axis=-1)
        surprise: np.ndarray = -highest - np.log(np.exp(each - highest[:, None]).sum(axis=-1))
        return surprise

    def draw(self, raw: np.ndarray, draws: Draws, mixing: np.ndarray | None = None) -> np.ndarray:
        """Return one draw, shape (m,).

        Args:
            raw: Outputs, shape (width,).
            draws: Where it comes from.
            mixing: What standard normal draws are multiplied by, shape (m, m), so that outputs err together.
        """
        if self.likelihood == "point":
            return raw
        weights, means, sds = self.parts(raw)
        chosen = int(np.searchsorted(np.cumsum(weights)[:-1], draws.uniform())) if self.components > 1 else 0
        normal = draws.normal(means.shape[1])
        drawn: np.ndarray = means[chosen] + sds[chosen] * (normal if mixing is None else mixing @ normal)
        return drawn.astype(raw.dtype)


POINT = Head()
