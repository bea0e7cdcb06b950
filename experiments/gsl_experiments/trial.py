"""A trial: one method, once, in one pair of worlds, and what it came to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from gsl.core.unit import Unit, telling


class Cell(NamedTuple):
    """What is compared: a method in a pair of worlds, after some iterations."""

    simulator: str
    world: str
    method: str
    iteration: int

    @property
    def worlds(self) -> str:
        """Both worlds as people are told them; the simulator only if it has a name."""
        return f"{self.simulator} {self.world}".lstrip()


class Tried(NamedTuple):
    """A policy that a search found, or began with, in the real episodes of the choice.

    Attributes:
        generation: That found it, 0 for the one that the search began with.
        promised: Its value in simulation, in the unit of the task; None of the first.
        drift: Share of its time, 0 to 1, where the grounding has seen nothing; None where none is learned.
        falls, episodes: Of the choice; up to the first fall where none is tolerated.
        value: Mean of these in the unit of the task, falls counting as there.
    """

    generation: int
    promised: float | None
    drift: float | None
    falls: int
    episodes: int
    value: float


class Trial(NamedTuple):
    """One method, once, in one real world, after one iteration.

    Attributes:
        number: Trials of one number have the same seeds.
        start: Value of π0 in real, in the unit of the task.
        value: Of the policy that this iteration returned, on fresh real episodes, falls counting as in the task.
        improvement: The one over the other [%]; None where π0's own interval holds 0.
        surely: Lower end of the 95 % interval of what this iteration gained, in the unit of the task.
        returned: Name of the returned policy.
        generation: That found it, 0 for the policy that the iteration started from.
        falls, episodes: Of the returned policy in fresh episodes.
        stable: Winners of generations that fell in no episode of the choice, or not too often.
        improving: Those of them that were better than the policy that the iteration started from.
        winners: All winners of generations.
        alpha: How far the grounding went, None where there is none.
        refused: Whether the grounding's check would have refused it.
        rank: Correlation of the simulator with real over a fixed set of policies, None where nobody asked.
        real_episodes: Of models, diagnosis (motions in the air), choice, check and report, of this iteration and those
            before; not those of `rank`.
        outcome: What the task reports of the returned policy, by name with unit.
        last: The same of the last generation's winner, which nothing real has chosen, in the episodes of the choice: up
            to its first fall where none is tolerated.
        last_falls: Of these episodes; None of trials that were written down before it was.
        tried: The policies that were tried in real, that which the search began with first; None likewise.
    """

    simulator: str
    world: str
    method: str
    iteration: int
    number: int
    start: float
    value: float
    improvement: float | None
    surely: float
    returned: str
    generation: int
    falls: int
    episodes: int
    stable: int
    improving: int
    winners: int
    alpha: float | None
    refused: bool
    rank: float | None
    real_episodes: int
    outcome: Mapping[str, float]
    last: Mapping[str, float]
    last_falls: int | None = None
    tried: Sequence[Tried] | None = None

    @classmethod
    def read(cls, row: Mapping[str, Any]) -> Trial:
        """Return a trial as a file's row, which has been checked, tells it."""
        tried = row.get("tried")
        return cls(**{**row, "tried": None if tried is None else [Tried._make(policy) for policy in tried]})

    @classmethod
    def of(
        cls,
        cell: Cell,
        number: int,
        search: Mapping[str, Any],
        measured: Mapping[str, Any],
        *,
        spent: int,
        first: Mapping[str, Any] | None = None,
        rank: float | None = None,
        tried: Sequence[Tried] | None = None,
    ) -> Trial:
        """Read the metrics of a search and of its evaluation.

        Args:
            cell: What was tried.
            number: Of the trial.
            search: Metrics of the search.
            measured: Metrics of the evaluation.
            spent: Real episodes before this evaluation.
            first: Metrics of the first iteration's evaluation, which has measured π0; none if this is the first.
            rank: See the class.
            tried: See the class.
        """
        start, after = (first or measured)["baseline"], measured["returned"]
        return cls(
            *cell,
            number,
            start=start["value"],
            value=after["value"],
            improvement=_improvement(start["value"], after["value"]) if start["interval"][0] > 0.0 else None,
            surely=measured["gain"]["interval"][0],
            returned=measured["best"],
            generation=measured["best_generation"],
            falls=after["falls"],
            episodes=after["episodes"],
            stable=measured["stable_policies"],
            improving=measured["improving_policies"],
            winners=measured["policies"],
            alpha=search.get("alpha"),
            refused=not search.get("grounding_acceptable", True),
            rank=rank,
            real_episodes=spent + measured["real_episodes"],
            outcome=after["outcome"],
            last=measured["last"]["outcome"],
            last_falls=measured["last"]["falls"],
            tried=tried,
        )

    @property
    def cell(self) -> Cell:
        """What was tried."""
        return Cell(self.simulator, self.world, self.method, self.iteration)

    def describe(self, unit: Unit) -> str:
        """Return the trial in a few words."""
        winners = f", {self.stable} of {self.winners} winners stable" if unit.falls else ""
        more = "" if self.plausible_improvement is None else f" ({self.plausible_improvement:+.1f} %)"
        return f"{self.returned}, {unit.format(self.value)}{more}{winners}"

    @property
    def plausible_improvement(self) -> float | None:
        """The improvement that tables tell [%]: None also where it is of a π0 next to nothing, more than tenfold."""
        return self.improvement if self.improvement is not None and telling(self.improvement / 100.0) else None

    @property
    def contradiction(self) -> str:
        """What cannot be, of figures that a file told."""
        counts = ("improving", self.improving), ("stable", self.stable), ("winners", self.winners)
        for (few, less), (many, more) in pairwise([("nothing", 0), *counts]):
            if less > more:
                return f"{few} {less}, {many} {more}"
        if not 0 <= self.falls <= self.episodes:
            return f"falls {self.falls}, episodes {self.episodes}"
        if self.tried is not None and len(self.tried) != self.winners + 1:
            return f"winners {self.winners}, but tried holds {len(self.tried)} policies and not one more"
        right = _improvement(self.start, self.value) if self.start > 0.0 else math.nan
        if self.improvement is not None and not math.isclose(self.improvement, right, abs_tol=1e-6):
            return f"improvement {self.improvement}, but start {self.start} and value {self.value}"
        return "" if self.number > 0 else f"number {self.number}"

    @property
    def without(self) -> bool:
        """Whether the trial found no stable improvement: a fall in fresh episodes, or a gain that may be none."""
        return self.falls > 0 or self.surely <= 0.0


def _improvement(start: float, value: float) -> float:
    return 100.0 * (value / start - 1.0)
