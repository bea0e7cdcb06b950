"""Simulators around a diagnosis: each has what was diagnosed as it may be, within intervals and by probabilities.

A cause acts by its probability; its values are drawn within their intervals, what was calibrated stays. Draws are from
a normal distribution cut off at the interval's ends: a diagnosis tells 1.96 standard errors of a least-squares fit to
either side, and a uniform draw would be at the ends too often. They are spread evenly over each interval (Latin
hypercube; McKay, Beckman and Conover, 1979), so that few simulators show it whole, and independent of each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from gsl.effects.effect import together
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.ensemble import EnsembleWorld

DRAWS = 16  # simulators: of a cause of probability 0.9, one or two lack it; a search has some hundred episodes
SEED = 1  # of the draws: they are a function of the diagnosis
HALF = 1.96  # half width of an interval of 95 % [standard errors]


@dataclass(frozen=True)
class UncertainCause:
    """A cause that a diagnosis names, and how sure it is of it.

    Attributes:
        effect: Its name.
        entry: What a world's `effects:` has of it.
        probability: That it acts.
        intervals: Ends of the values that have an interval, by parameter.
    """

    effect: str
    entry: Mapping[str, Any]
    probability: float
    intervals: Mapping[str, tuple[float, float]]


def around(world: BulletWorld | EnsembleWorld, causes: Sequence[UncertainCause]) -> BulletWorld | EnsembleWorld:
    """Return simulators that are drawn around a diagnosed one; itself where nothing of it is uncertain.

    Args:
        world: With the causes switched on; the members of an ensemble are dealt to the draws in turn.
        causes: Of the diagnosis.
    """
    if not causes:
        return world
    centre, members = (world.world, world.members) if isinstance(world, EnsembleWorld) else (world, (world,))
    drawn = drawings(causes, DRAWS)
    made = tuple(_draw(members[k % len(members)], causes, entries) for k, entries in enumerate(drawn))
    if all(world == members[k % len(members)] for k, world in enumerate(made)):
        return world
    return EnsembleWorld(centre, made)


def drawings(causes: Sequence[UncertainCause], count: int) -> list[list[Mapping[str, Any] | None]]:
    """Return `count` draws of the causes' entries, None for a cause that does not act."""
    columns = [1 + len(cause.intervals) for cause in causes]
    rows = hypercube(count, sum(columns), np.random.default_rng(SEED))
    parts = [np.split(row, np.cumsum(columns)[:-1]) for row in rows]
    return [[_entry(cause, part) for cause, part in zip(causes, row, strict=True)] for row in parts]


def hypercube(count: int, columns: int, rng: np.random.Generator) -> np.ndarray:
    """Return numbers in [0, 1), shape (count, columns): of each column one in every `count`-th part of the interval."""
    strata = rng.permuted(np.tile(np.arange(count), (columns, 1)), axis=1).T
    return np.asarray((strata + rng.random((count, columns))) / count)


def within(share: float, centre: float, low: float, high: float) -> float:
    """Return the quantile of a normal distribution around `centre` that is cut off at `low` and `high`.

    Args:
        share: Of the draws that lie below, in [0, 1).
        centre: The fitted value, between low and high.
        low: Lower end of its 95 % interval.
        high: Upper end; the wider side tells the standard error, since bounds may cut the other.
    """
    if high <= low:
        return centre
    error = max(high - centre, centre - low) / HALF
    below, above = ndtr((low - centre) / error), ndtr((high - centre) / error)
    return float(np.clip(centre + error * ndtri(below + share * (above - below)), low, high))


def _entry(cause: UncertainCause, shares: np.ndarray) -> Mapping[str, Any] | None:
    if shares[0] >= cause.probability:
        return None
    values = {
        key: within(float(share), float(np.clip(cause.entry[key], low, high)), low, high)
        for share, (key, (low, high)) in zip(shares[1:], cause.intervals.items(), strict=True)
        if low < high
    }
    return {**cause.entry, **values}


def _draw(
    world: BulletWorld, causes: Sequence[UncertainCause], entries: Sequence[Mapping[str, Any] | None]
) -> BulletWorld:
    effects = {name: list(values) for name, values in together([world.effects]).items()}
    for cause, entry in zip(causes, entries, strict=True):
        here = effects[cause.effect]
        place = here.index(cause.entry)
        here[place : place + 1] = [] if entry is None else [entry]
    drawn: BulletWorld = replace(world, effects=together([effects]))
    return drawn
