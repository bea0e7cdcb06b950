"""What an optimiser with `ask` and `tell` promises: candidates of the right shape, and the same ones after a kill."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gsl.core.interfaces import Search
from gsl.errors import ConfigError
from gsl.optimizers.candidates import check_candidates
from gsl.testing.components import check_component, require

PARAMETERS, SEED = 5, 3
Candidates = list[list[np.ndarray]]


def check_search(search: Search, *, parameters: int = PARAMETERS) -> None:
    """Check an optimiser.

    Args:
        search: Its settings.
        parameters: How many the policy has.
    """
    check_component(search)
    require(search, isinstance(search, Search), "needs `generations`, `candidates` and `start`")
    require(search, search.generations >= 1 and search.candidates >= 1, "asks for no candidate")
    first = _run(search, parameters, SEED, _value)
    again, other = _run(search, parameters, SEED, _value), _run(search, parameters, SEED + 1, _value)
    require(search, np.array_equal(first, again), "asks for other candidates for the same values again")
    require(search, not np.array_equal(first, other), "does not depend on its seed")
    if len(first) > 1:
        worst = _run(search, parameters, SEED, lambda candidate: -_value(candidate))
        require(search, not np.array_equal(first, worst), "does not depend on the values that it gets")


def _value(candidate: np.ndarray) -> float:
    return -float(((candidate - 1.0) ** 2).sum())


def _run(search: Search, parameters: int, seed: int, value: Callable[[np.ndarray], float]) -> Candidates:
    start = np.zeros(parameters)
    run, asked = search.start(start, np.ones(parameters), seed), []
    require(search, not start.any(), "changes the parameters that it is given")
    for _ in range(search.generations):
        try:
            candidates = [candidate.copy() for candidate in check_candidates(run.ask(), parameters, search.candidates)]
        except ConfigError as error:
            raise AssertionError(f"{type(search).__name__}: {error.problem}") from error
        asked.append(candidates)
        run.tell([value(candidate) for candidate in candidates])
    return asked
