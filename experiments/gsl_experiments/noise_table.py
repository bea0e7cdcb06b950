"""Tables of a study of environments: what methods came to, how they differ, what simulators promised."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gsl.core.statistics import mean_interval
from gsl.core.unit import Unit
from gsl.report.markdown import table as markdown
from gsl.report.run_page import Answer
from gsl_experiments.answer import CHOSEN, answer_difference

REFERENCE, BOTH = "trained on real", {"gat", "sgat"}


class Place(NamedTuple):
    """Where methods are compared: in a real world, at a noise of it, after a round of grounding."""

    world: str
    noise: float
    round: int


class Point(NamedTuple):
    """One method, once, in one real world, after one round.

    Attributes:
        value: Mean return of its policy in the real world.
        real_steps: In the real world, that it learned from so far; None of a search there, whose steps nobody counts.
        choice_steps: In the real world, that chose its policy so far.
        promised: Mean return of its policy where that was learned; None of the policy that all begin with.
    """

    world: str
    noise: float
    method: str
    trial: int
    round: int
    value: float
    real_steps: int | None
    choice_steps: int
    promised: float | None

    @property
    def contradiction(self) -> str:
        """What cannot be, of figures that a file told."""
        return "" if self.trial > 0 < self.round else f"trial {self.trial}, round {self.round}"

    @property
    def place(self) -> Place:
        """Where it was measured."""
        return Place(self.world, self.noise, self.round)


@dataclass(frozen=True)
class NoiseTable:
    """The points of a study and what it is to say of them.

    Attributes:
        points: Of all trials, in their order.
        places: A row of the tables each.
        shown: Names for people of all methods, the reference's too.
        learned: Methods that learn from the real world.
        noisy: Methods that put noise on actions.
        trials: How many there are.
        chosen: Whether the real world chose among generations.
    """

    points: Sequence[Point]
    places: Sequence[Place]
    shown: Mapping[str, str]
    learned: Sequence[str]
    noisy: Sequence[str]
    trials: int
    chosen: bool

    @property
    def methods(self) -> list[str]:
        """All methods but the reference."""
        return [method for method in self.shown if method != REFERENCE]

    def means(self, places: Sequence[Place]) -> dict[str, list[tuple[float, float]]]:
        """Return mean and standard error of each method, by its name for people, at some places."""
        return {
            name: [_mean(_values(self.points, place, method)) for place in places]
            for method, name in self.shown.items()
        }

    def render(self, *below: str) -> str:
        """Return what all methods came to, with lines below that, their differences, and what simulators promised."""
        rows = []
        for place in self.places:
            values = {method: _values(self.points, place, method) for method in self.shown}
            means = [_mean(returns) for returns in values.values()]
            paired = values.keys() >= BOTH and self.trials > 1
            apart = _difference(values["sgat"], values["gat"]) if paired else "-"
            cells = (f"{mean:.0f}" + f" ± {error:.0f}" * (self.trials > 1) for mean, error in means)
            here = [point for point in self.points if point.place == place]
            spent = [_sum_spent(point.real_steps for point in here if point.method != REFERENCE)]
            spent += [_sum_spent(point.choice_steps for point in here)] if self.chosen else []
            rows.append(self._row(place, *cells, apart, *spent))
        titles = self._list_titles(*self.shown.values(), "sgat - gat (95 %)", "real steps")
        titles += ["real steps of the choice"] if self.chosen else []
        return "\n".join([markdown(titles, rows), *below, "", *self._differences(), *self._promises()])

    @property
    def answer(self) -> Answer:
        """How much more the best learned grounding returns than none, where the noise is largest and the round last."""
        place = max(self.places, key=lambda cell: (cell.noise, cell.round))
        question = "Does a learned grounding return more on the real side than none?"
        values = {method: _values(self.points, place, method) for method in self.methods}
        best = max(self.learned, key=lambda name: np.mean(values[name]), default=None)
        where = f"In {place.world} at noise {place.noise:g}"
        if best is None or "none" not in values:
            phrases = (f"{self.shown[name]} {np.mean(returns):.0f}" for name, returns in values.items())
            return Answer(question, f"{where}, methods return {', '.join(phrases)}.", sure=False)
        apart = mean_interval(np.subtract(values[best], values["none"]))
        return answer_difference(
            question, f"{where}, {self.shown[best]} minus none", apart, Unit(name="of return"), CHOSEN
        )

    def _promises(self) -> list[str]:
        """Return the lines of a table of what policies were worth where they were learned, and in real."""
        rows = [
            self._row(place, *(_describe_promises(_at(self.points, place, method)) for method in self.methods))
            for place in self.places
        ]
        shown = [self.shown[method] for method in self.methods]
        start = " In brackets: trials that ended where they began. They do not count." if self.chosen else ""
        below = (
            "Mean return where a policy was learned -> in the real world. The first is of few episodes; those of a\n"
            f"search also chose the policy, which flatters it.{start}"
        )
        return [markdown(self._list_titles(*shown), rows), below, ""]

    def _differences(self) -> list[str]:
        """Return the lines of a table of what learned groundings are above methods that know nothing, by trial."""
        learned, noisy = self.learned, self.noisy
        if self.trials < 2 or not learned:
            return []
        rows = []
        for place in self.places:
            values = {method: _values(self.points, place, method) for method in self.methods}
            best = max(noisy, key=lambda name: np.mean(values[name]), default=None)
            others = [name for name in ("none", best) if name in values]
            cells = [_difference(values[name], values[other]) for other in others for name in learned]
            rows.append(self._row(place, *cells, *([self.shown[best]] if best else [])))
        others = [*(["none"] if "none" in self.methods else []), *(["best ane"] if noisy else [])]
        titles = [f"{name} - {other}" for other in others for name in learned]
        below = "Paired differences with 95 % intervals. These do not count that the best width was chosen."
        return [markdown(self._list_titles(*titles, *(["best ane"] if noisy else [])), rows), below, ""]

    @property
    def _several(self) -> bool:
        return any(place.round > 1 for place in self.places)

    def _list_titles(self, *titles: str) -> list[str]:
        return ["real world", "noise", *(["round"] if self._several else []), *titles]

    def _row(self, place: Place, *cells: str) -> list[str]:
        return [place.world, f"{place.noise:g}", *([str(place.round)] if self._several else []), *cells]


def _at(points: Sequence[Point], place: Place, method: str) -> list[Point]:
    return [point for point in points if (point.place, point.method) == (place, method)]


def _values(points: Sequence[Point], place: Place, method: str) -> list[float]:
    return [point.value for point in _at(points, place, method)]


def _difference(values: Sequence[float], others: Sequence[float]) -> str:
    """Return the mean of paired differences with its interval, of values that are all the same none."""
    differences = np.subtract(values, others)
    if not differences.any():
        return "-"
    interval = mean_interval(differences)
    return f"{interval.mean:+.0f} ({interval.lower:+.0f} to {interval.upper:+.0f})"


def _describe_promises(trials: Sequence[Point]) -> str:
    """Return what policies promised and what the real world gave them, and how many are what all began with."""
    new = [(trial.promised, trial.value) for trial in trials if trial.promised is not None]
    start = f" ({len(trials) - len(new)})" if len(new) < len(trials) else ""
    if not new:
        return f"{np.mean([trial.value for trial in trials]):.0f}{start}"
    promised, value = np.mean(new, axis=0)
    return f"{promised:.0f} -> {value:.0f}{start}"


def _sum_spent(steps: Iterable[int | None]) -> str:
    counted = [count for count in steps if count]
    return f"{np.median(counted):,.0f} ({min(counted):,} to {max(counted):,})" if counted else "-"


def _mean(values: Sequence[float]) -> tuple[float, float]:
    """Return mean and standard error, 0 of a single value."""
    error = np.std(values, ddof=1) / np.sqrt(len(values)) if len(values) > 1 else 0.0
    return float(np.mean(values)), float(error)
