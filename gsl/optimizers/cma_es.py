"""CMA-ES (Hansen 2016) through the library `cma`, as ask and tell on a policy's parameters."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from gsl.core.setting import component, setting
from gsl.optimizers.race import Error

Bounds = tuple[np.ndarray, np.ndarray] | None


@component
class CmaEs:
    """Covariance matrix adaptation: maximises, in units of each parameter's scale."""

    candidates: Annotated[int, setting("candidates of a generation", ge=4)]
    generations: Annotated[int, setting("generations", ge=1)]
    sigma: Annotated[float, setting("first step size, in units of a parameter's scale", gt=0)] = 0.08
    race: Error = 0.0

    def start(self, parameters: np.ndarray, scale: np.ndarray, seed: int, bounds: Bounds = None) -> CmaEsRun:
        """Return the search at its beginning; bounds, if there are some, are the least and the greatest parameters."""
        return CmaEsRun(self, np.asarray(parameters, dtype=float), np.asarray(scale, dtype=float), seed, bounds)


class CmaEsRun:
    """A search in progress; it is the same again when the same values are told."""

    def __init__(
        self, settings: CmaEs, parameters: np.ndarray, scale: np.ndarray, seed: int, bounds: Bounds = None
    ) -> None:
        import cma  # takes 0.7 s

        self._origin, self._scale = parameters, scale
        rng = np.random.default_rng(seed)
        options = {
            "popsize": settings.candidates,
            "randn": lambda *shape: rng.standard_normal(shape),  # cma would draw from numpy's global generator
            "seed": np.nan,  # leaves that generator alone
            "verbose": -9,
            "maxiter": settings.generations,
            "tolfun": 0.0,
            "tolx": 0.0,
            "tolflatfitness": settings.generations + 1,
            "bounds": bounds and [(bound - parameters) / scale for bound in bounds],
        }
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._search = cma.CMAEvolutionStrategy(np.zeros(len(parameters)), settings.sigma, options)
        self._asked: list[np.ndarray] = []

    @property
    def mean(self) -> np.ndarray:
        """The middle of what it asks for next, shape (n_parameters,)."""
        return np.asarray(self._origin + self._scale * self._search.mean)

    def ask(self) -> list[np.ndarray]:
        """Return the candidates of the next generation, each of shape (n_parameters,)."""
        self._asked = self._search.ask()
        return [self._origin + self._scale * candidate for candidate in self._asked]

    def tell(self, values: Sequence[float]) -> None:
        """Take the candidates' values, larger is better, in the order of `ask`."""
        if len(values) != len(self._asked):
            raise ValueError(f"{len(values)=} but {len(self._asked)=}")
        self._search.tell(self._asked, [-value for value in values])
