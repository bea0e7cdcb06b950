"""Further members of a learned servo: numbers and networks fitted to other draws of the motions, from other weights.

Weights that begin elsewhere disagree where data say nothing (Lakshminarayanan et al., 1612.01474), and windows drawn
with replacement disagree by as much as the log is short (Breiman's bagging, 1996).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gsl.core.plant import Plant
from gsl.core.seeds import derive_seed
from gsl.models.servo import ServoModel, neutral, without_group

ITERATIONS = 60  # of a fit: in 140 more the judged gap would fall by 5 % (nao_worn, 70 s in the air)


class Member(NamedTuple):
    """A further member, and how far it is from held-out motions [noise floors]."""

    model: ServoModel
    floors: float


def further(
    count: int,
    numbers: Callable[[np.random.Generator], ServoModel],
    dropped: tuple[str, ...],
    fit: Callable[[ServoModel, np.ndarray], ServoModel],
    floors: Callable[[ServoModel], float],
    *,
    plant: Plant,
    samples: np.ndarray,
    seed: int,
) -> Iterator[Member]:
    """Yield further members.

    Args:
        count: How many.
        numbers: Returns a servo with numbers fitted to motions that it draws.
        dropped: Groups that keep their old servo.
        fit: Returns a model fitted to some windows, from where to begin.
        floors: Of a model on held-out motions.
        plant: The servo that the model stands on.
        samples: What a bootstrap draws, by window, shape (W,).
        seed: Of the first member's first weights.
    """
    for k in range(count):
        rng = np.random.default_rng(derive_seed(seed, "member", k + 1))
        begun = replace(numbers(rng), network=neutral(plant, rng).network)
        model = fit(begun, bootstrap(samples, rng))
        for name in dropped:
            model = without_group(model, name)
        yield Member(model, floors(model))


def bootstrap(samples: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return windows of samples drawn with replacement, a sample that is drawn twice twice.

    Args:
        samples: Which one each window is of, shape (W,).
        rng: Of the draw.
    """
    every = np.unique(samples)
    return np.concatenate([np.flatnonzero(samples == sample) for sample in rng.choice(every, len(every))])
