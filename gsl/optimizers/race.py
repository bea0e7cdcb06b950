"""A race: a candidate plays no more rollouts once they would change neither the winner nor the search's next step.

The idea is Heidrich-Meisner's and Igel's (Hoeffding and Bernstein races in CMA-ES, ICML 2009). Their bounds hold for
any returns within a range. Twenty walks settle nothing by them: a fall costs fifty times the noise of a walk.
Their races settle who is among the better half. A candidate near its border counts almost nothing for CMA-ES, whose
mean moves by weights that fall with the rank. So what is bounded here is the change of those weights.
The chance is computed, too. The rollouts that a candidate has not played are drawn from Pólya's urn (Blackwell
and MacQueen 1973): each is one that it has played, or by a chance of c / (played + c) one of any candidate. So a
candidate that has not fallen yet may still fall, as often as others did. Bühlmann's credibility (1967) gives c: the
variance of a candidate's values over that between candidates; the urn's own ball, which stands for the unseen, adds 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Protocol, runtime_checkable

import numpy as np

from gsl.core.setting import setting

FIRST = 2  # rollouts before the first look: the fewest that show how much a candidate varies
MOST = 1e6  # share of noise that stands for noise alone
DRAWS = 1000  # ways in which a generation may end; a chance below their inverse counts as none

Error = Annotated[
    float,
    setting("chance of another winner, and change of the step, as candidates stop early; 0: none stops", ge=0, lt=1),
]


@runtime_checkable
class Racing(Protocol):
    """A search that weighs candidates by rank, as CMA-ES does: those whose weight is settled need no more episodes."""

    @property
    def race(self) -> float:
        """Chance of another winner of a generation than all episodes would have; 0 for all episodes."""


class Race:
    """The rollouts of a generation, in rounds that double what each candidate has played.

    After a round candidates stop, first those whose weight is surest, as long as both hold for all that have stopped:
    their chances to be the winner add up to at most this round's share of `error`, and so do the expected squares of
    what their weights would still change, as a share of the sum of all squared weights. Where candidates are drawn
    independently, the latter is the squared distance between this step of the search and that by all rollouts, over
    the square of its length.

    Args:
        candidates: How many there are, n.
        rollouts: How many each plays that does not stop, k.
        error: Chance of another winner than all rollouts would have, and share of the step; 0 plays all in one round.
        judge: Returns what the search maximises, shape (m,), of episodes' values, shape (m, k).
        rng: Draws how a generation may end.

    Attributes:
        values: Of the rollouts, NaN where none was played, shape (n, k).
        counts: Rollouts that each candidate has played, shape (n,).
    """

    def __init__(
        self,
        candidates: int,
        rollouts: int,
        error: float,
        judge: Callable[[np.ndarray], np.ndarray],
        rng: np.random.Generator,
    ) -> None:
        self.values = np.full((candidates, rollouts), np.nan)
        self.counts = np.zeros(candidates, dtype=int)
        self._error, self._judge, self._rng = error, judge, rng
        self._ends = _double(rollouts) if error and candidates > 1 else [rollouts]
        self._round, self._chance = 0, 0.0
        self._racing = np.ones(candidates, dtype=bool)

    @property
    def worths(self) -> np.ndarray:
        """What the search maximises, by the rollouts that each candidate has played, shape (n,)."""
        pairs = zip(self.values, self.counts, strict=True)
        return np.array([float(self._judge(row[None, :count])[0]) for row, count in pairs])

    def pairs(self) -> list[tuple[int, int]]:
        """Return (candidate, rollout) of the next round; none where the race is over."""
        if self._round == len(self._ends):
            return []
        begin = self._ends[self._round - 1] if self._round else 0
        numbers = range(begin, self._ends[self._round])
        return [(int(candidate), number) for candidate in np.flatnonzero(self._racing) for number in numbers]

    def take(self, values: Sequence[float]) -> None:
        """Take the values of the round, in the order of `pairs`."""
        rows, columns = zip(*self.pairs(), strict=True)
        self.values[rows, columns] = values
        self.counts[self._racing] = self._ends[self._round]
        self._round += 1
        so_far = self.values[np.arange(self.values.shape[1]) < self.counts[:, None]]
        if self._round < len(self._ends) and np.isfinite(so_far).all():  # with other values nothing can be foretold
            self._stop()

    def _stop(self) -> None:
        ends = draw_ends(self.values, DRAWS, self._rng)
        worths = self._judge(ends.reshape(-1, ends.shape[2])).reshape(ends.shape[:2])
        wins = np.bincount(worths.argmax(axis=1), minlength=len(self.values)) / DRAWS
        now = weigh(self.worths)
        lost = ((weigh(worths) - now) ** 2).mean(axis=0) / (now**2).sum()
        changed, allowed = float(lost[~self._racing].sum()), self._error * self._round / (len(self._ends) - 1)
        for candidate in np.argsort(lost, kind="stable"):
            chance, change = self._chance + wins[candidate], changed + lost[candidate]
            if self._racing[candidate] and max(chance, change) <= allowed:
                self._racing[candidate] = False
                self._chance, changed = chance, change


def weigh(worths: np.ndarray) -> np.ndarray:
    """Return by how much each candidate moves CMA-ES's mean, shape (..., n) as the worths.

    Hansen 2016, equations 49 and 53: the logarithm of the rank decides, and the worse half does not count.
    """
    ranks = 1.0 + np.argsort(np.argsort(-worths, axis=-1, kind="stable"), axis=-1)
    weights = np.maximum(0.0, np.log(0.5 * (worths.shape[-1] + 1)) - np.log(ranks))
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True))


def draw_ends(values: np.ndarray, draws: int, rng: np.random.Generator) -> np.ndarray:
    """Return ways in which rollouts may go on, by Pólya's urn, shape (draws, n, k).

    Args:
        values: Of what was played, NaN for the rest of a row, shape (n, k).
        draws: How many ways.
        rng: Draws them.
    """
    played = np.isfinite(values).sum(axis=1)
    every, strange = values[np.isfinite(values)], 1.0 + noise_share(values)
    ends = np.repeat(values[None], draws, axis=0)
    for column in range(values.shape[1]):
        rows = np.flatnonzero(played <= column)
        shape = (draws, len(rows))
        others = every[rng.integers(len(every), size=shape)]
        own = ends[np.arange(draws)[:, None], rows, rng.integers(column, size=shape)]
        ends[:, rows, column] = np.where(rng.random(shape) * (column + strange) < strange, others, own)
    return ends


def noise_share(values: np.ndarray) -> float:
    """Return the variance of a candidate's values over that of candidates' means without noise; large if there is none.

    Args:
        values: NaN where nothing was played, two in a row at least, shape (n, k).
    """
    played = np.isfinite(values).sum(axis=1)
    means = np.nanmean(values, axis=1)
    within = float(np.nansum((values - means[:, None]) ** 2) / (played - 1).sum())
    between = float(means.var(ddof=1) - within * np.mean(1.0 / played)) if len(means) > 1 else 0.0
    return min(within / between, MOST) if between > 0.0 else MOST if within else 0.0


def _double(rollouts: int) -> list[int]:
    """Return after how many rollouts a round ends."""
    ends = [FIRST]
    while ends[-1] < rollouts:
        ends.append(2 * ends[-1])
    return [*ends[:-1], rollouts]
