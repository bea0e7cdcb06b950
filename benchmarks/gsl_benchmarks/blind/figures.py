"""Figures: what a benchmark counts over its marks, each with an interval and the threshold that it has to reach."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gsl.core.statistics import quantile_interval, wilson
from gsl_benchmarks.blind.label import ABSENT, FOREIGN, JOINT, KNOWN, NULL, SAME, SINGLE, TWO, WALK, WITHHELD
from gsl_benchmarks.blind.mark import LOOSE, Mark
from gsl_benchmarks.blind.mix import MEDIUM, STRONG, WEAK

BINS = 5  # of the reliability, equally full
COVERED = 0.92  # least share of the 95 % intervals that hold the truth; 0.98 would be the most

Rule = Callable[[Mark], bool]


@dataclass(frozen=True)
class Figure:
    """One figure of one generator.

    Attributes:
        name: What it is.
        generator: Whose cases were counted.
        value: The share or the median; None where there was nothing to count.
        low, high: 95 % interval: Wilson's for a share, of order statistics for a median.
        count: Cases, or numbers, that were counted.
        threshold: What it has to reach, if there is something.
        least: Whether it is to be at least the threshold; else at most.
    """

    name: str
    generator: str
    value: float | None
    low: float | None
    high: float | None
    count: int
    threshold: float | None
    least: bool = True

    @property
    def met(self) -> bool | None:
        """Whether the threshold is reached; None if there is none, or nothing was counted."""
        if self.threshold is None or self.value is None:
            return None
        return self.value >= self.threshold if self.least else self.value <= self.threshold


@dataclass(frozen=True)
class _Share:
    """How many of the cases that are asked for are a hit."""

    asked: Rule
    hit: Rule
    thresholds: tuple[float, float] | None = None
    least: bool = True


@dataclass(frozen=True)
class _Median:
    """The median of numbers that marks have."""

    numbers: Callable[[Mark], Iterable[float]]
    thresholds: tuple[float, float] | None = None
    least: bool = True


def _single(*strengths: str) -> Rule:
    return lambda mark: mark.label.kind == SINGLE and mark.label.strength in strengths


def _kind(*kinds: str) -> Rule:
    return lambda mark: mark.label.kind in kinds


def _errors(*, loose: bool) -> Callable[[Mark], Iterable[float]]:
    return lambda mark: (error for name, error in mark.errors.items() if (name in LOOSE) == loose)


_SHARES = {
    "top-1, medium and strong": _Share(_single(MEDIUM, STRONG), lambda m: m.first, (0.90, 0.75)),
    "top-2, medium and strong": _Share(_single(MEDIUM, STRONG), lambda m: m.second, (0.97, 0.90)),
    "top-1, twins taken as one": _Share(_single(MEDIUM, STRONG), lambda m: m.twin, (0.95, 0.90)),
    "top-1, weak": _Share(_single(WEAK), lambda m: m.first),
    "top-2, weak": _Share(_single(WEAK), lambda m: m.second),
    "top-1, medium": _Share(_single(MEDIUM), lambda m: m.first),
    "top-1, strong": _Share(_single(STRONG), lambda m: m.first),
    "wrong name, weak": _Share(_single(WEAK), lambda m: bool(m.named) and not m.second, None, False),
    "two effects: both named": _Share(_kind(TWO), lambda m: m.both, (0.80, 0.80)),
    "two effects: at least one": _Share(_kind(TWO), lambda m: m.some, (0.95, 0.90)),
    "fault of one joint: right joint": _Share(_kind(JOINT), lambda m: bool(m.joint), (0.95, 0.90)),
    "fault of one joint: joint on the map": _Share(lambda m: m.mapped is not None, lambda m: bool(m.mapped)),
    "fault of one joint: top-1": _Share(_kind(JOINT), lambda m: m.first),
    "false alarm without a cause": _Share(_kind(NULL), lambda m: m.alarmed, (0.05, 0.05), False),
    "abstains, effect withheld": _Share(_kind(WITHHELD), lambda m: m.abstained, (0.90, 0.90)),
    "abstains, effect never in the library": _Share(_kind(ABSENT), lambda m: m.abstained, (0.90, 0.90)),
    "abstains wrongly": _Share(_kind(*KNOWN), lambda m: m.abstained, (0.08, 0.10), False),
    "misses the gap": _Share(_kind(*KNOWN), lambda m: not m.alarmed, None, False),
    "names more than there is": _Share(lambda m: m.label.kind in KNOWN and m.some, lambda m: m.extra > 0, None, False),
}
_MEDIANS = {
    "error of parameters": _Median(_errors(loose=False), (0.10, 0.25), False),
    "error of compliance, sag, backlash": _Median(_errors(loose=True), (0.30, 0.30), False),
    "shrinkage over the ceiling": _Median(lambda m: () if m.shrinkage is None else (m.shrinkage,), (0.90, 0.75)),
    "wall time [s]": _Median(lambda m: (m.seconds,), None, False),
}
_WALK_SHARES = {
    "walk, strong: top-1": _Share(_kind(WALK), lambda m: m.first, (0.75, 0.75)),
    "walk, strong: top-2": _Share(_kind(WALK), lambda m: m.second),
    "walk, strong: abstains wrongly": _Share(_kind(WALK), lambda m: m.abstained, None, False),
    "walk, strong: misses the gap": _Share(_kind(WALK), lambda m: not m.alarmed, None, False),
}
_WALK_MEDIANS = {
    "walk, strong: error of parameters": _Median(lambda m: m.errors.values(), None, False),
    "walk: wall time [s]": _Median(lambda m: (m.seconds,), None, False),
}


def figures(marks: Sequence[Mark]) -> list[Figure]:
    """Return every figure of both generators, those of the cases in the air first: robots that walk count apart."""
    rows = []
    for place, generator in enumerate((SAME, FOREIGN)):
        own = [mark for mark in marks if mark.label.generator == generator and mark.label.kind != WALK]
        rows += [_share(name, generator, own, rule, place) for name, rule in _SHARES.items()]
        covers = [held for mark in own for held in mark.covered]
        rows.append(_of_hits("intervals that hold the parameters", generator, covers, COVERED))
        rows += [_median(name, generator, own, rule, place) for name, rule in _MEDIANS.items()]
        error, count = calibration_error(own)
        threshold = (0.05, 0.08)[place]
        rows.append(Figure("calibration error (ECE)", generator, error, None, None, count, threshold, least=False))
        on_foot = [mark for mark in marks if mark.label.generator == generator and mark.label.kind == WALK]
        rows += [_share(name, generator, on_foot, rule, place) for name, rule in _WALK_SHARES.items()]
        rows += [_median(name, generator, on_foot, rule, place) for name, rule in _WALK_MEDIANS.items()]
    return rows


def reliability(marks: Sequence[Mark]) -> list[tuple[float, float, int]]:
    """Return mean probability, share of right first causes and count of equally full bins, of cases in the air."""
    counted = [mark for mark in marks if mark.probability is not None and mark.label.kind != WALK]
    said = sorted((mark.probability, mark.right) for mark in counted)
    parts = [part for part in np.array_split(np.array(said, dtype=float).reshape(-1, 2), BINS) if len(part)]
    return [(float(part[:, 0].mean()), float(part[:, 1].mean()), len(part)) for part in parts]


def calibration_error(marks: Sequence[Mark]) -> tuple[float | None, int]:
    """Return the expected calibration error and how many causes were named."""
    bins = reliability(marks)
    count = sum(size for *_, size in bins)
    return (sum(abs(said - right) * size for said, right, size in bins) / count if count else None), count


def confusion(marks: Sequence[Mark]) -> dict[str, dict[str, int]]:
    """Return how often each truth was answered by each first cause or verdict, cases of two effects left out."""
    table: dict[str, dict[str, int]] = {}
    for mark in marks:
        if mark.label.kind != TWO:
            row = table.setdefault(truth_of(mark), {})
            row[mark.answer] = row.get(mark.answer, 0) + 1
    return {name: dict(sorted(row.items(), key=lambda cell: -cell[1])) for name, row in sorted(table.items())}


def truth_of(mark: Mark) -> str:
    """Return what is at work in a case, in words."""
    label = mark.label
    extra = [f"({label.extra['effect']})"] if label.extra else []
    named = [f"({name})" if label.kind == WITHHELD else name for name in label.effects]
    return ("walk: " if label.kind == WALK else "") + (" + ".join([*named, *extra]) or NULL)


def _share(name: str, generator: str, marks: Sequence[Mark], rule: _Share, place: int) -> Figure:
    hits = [rule.hit(mark) for mark in marks if rule.asked(mark)]
    threshold = rule.thresholds[place] if rule.thresholds else None
    return _of_hits(name, generator, hits, threshold, least=rule.least)


def _of_hits(
    name: str, generator: str, hits: Sequence[bool], threshold: float | None = None, *, least: bool = True
) -> Figure:
    if not hits:
        return Figure(name, generator, None, None, None, 0, threshold, least)
    return Figure(name, generator, *wilson(sum(hits), len(hits)), len(hits), threshold, least)


def _median(name: str, generator: str, marks: Sequence[Mark], rule: _Median, place: int) -> Figure:
    numbers = [number for mark in marks for number in rule.numbers(mark)]
    threshold = rule.thresholds[place] if rule.thresholds else None
    if not numbers:
        return Figure(name, generator, None, None, None, 0, threshold, rule.least)
    return Figure(name, generator, *quantile_interval(numbers), len(numbers), threshold, rule.least)
