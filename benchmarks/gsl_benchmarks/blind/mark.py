"""Marks: what an answer is worth, set against the label of its case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gsl.effects.effect import TWINS
from gsl_benchmarks.blind.label import JOINT, KNOWN, TWO, WALK, Label

NO_GAP, UNKNOWN = "no_gap", "unknown"
LOOSE = ("joint_compliance", "supply_sag", "backlash")  # whose parameters logs at 50 Hz hardly show


@dataclass(frozen=True)
class Mark:
    """What is counted of one case.

    Attributes:
        label: The truth.
        answer: The first cause that is named, or the verdict's word.
        named: All causes and members of inseparable groups.
        first: A cause of the truth comes first, and it is not said to be inseparable from another.
        twin: The same, with effects that are alike by nature taken as one.
        second: It is among the first two of the causes and, after them, the ranking, or in an inseparable group.
        both, some: Of several causes, all are named; at least one is.
        joint: Of a fault of one joint, the first cause is put there; None elsewhere.
        mapped: Of such a fault, that joint has most of the gap on the map.
        probability: Of the first cause; None if none is named.
        right: The first cause is one of the truth.
        extra: Causes that are named beyond those of the truth.
        errors: Relative errors of the parameters, by effect, where the name is right; of what the effect does.
        covered: Whether each one's interval holds the truth.
        shrinkage: Share of the gap that is gone, over the ceiling's; None where there is none.
        seconds: That the answer took.
    """

    label: Label
    answer: str
    named: tuple[str, ...]
    first: bool
    twin: bool
    second: bool
    both: bool
    some: bool
    joint: bool | None
    mapped: bool | None
    probability: float | None
    right: bool
    extra: int
    errors: Mapping[str, float]
    covered: tuple[bool, ...]
    shrinkage: float | None
    seconds: float

    @property
    def abstained(self) -> bool:
        """Whether it says that nothing of the library is the cause."""
        return self.answer == UNKNOWN

    @property
    def alarmed(self) -> bool:
        """Whether it sees a gap, explained or not."""
        return self.answer != NO_GAP


def mark_answer(label: Label, answer: Mapping[str, Any]) -> Mark:
    """Mark an answer: the document of a diagnosis, of which only `verdict` and `causes` have to be there."""
    causes = list(answer["causes"]) if answer["verdict"] not in (NO_GAP, UNKNOWN) else []
    twins = {} if label.kind == WALK else TWINS
    names = [twins.get(cause["effect"], cause["effect"]) for cause in causes]
    truth = {twins.get(name, name) for name in label.truth}
    groups = [{twins.get(name, name) for name in group} for group in answer.get("inseparable") or []]
    alike = set().union(*(group for group in groups if len(group) > 1)) if causes else set()
    hits = truth & {*names, *alike}
    first = bool(names) and names[0] in truth
    fits = [_fit(label, cause, twins) for cause in causes if twins.get(cause["effect"], cause["effect"]) in truth]
    measured = [fit for fit in fits if fit is not None]
    return Mark(
        label=label,
        answer=names[0] if names else str(answer["verdict"]) if answer["verdict"] in (NO_GAP, UNKNOWN) else UNKNOWN,
        named=tuple(dict.fromkeys([*names, *sorted(alike)])),
        first=first and not truth & set().union(*groups),
        twin=first and not truth & alike,
        second=bool(names) and bool(truth & {*list(dict.fromkeys([*names, *_list_ranked(answer, twins)]))[:2], *alike}),
        both=bool(truth) and truth <= set(names),
        some=bool(hits),
        joint=_on_joint(label, causes[:1]) if label.kind == JOINT else None,
        mapped=_on_map(label, answer) if label.kind == JOINT and answer.get("where") else None,
        probability=causes[0].get("probability") if causes else None,
        right=first,
        extra=len(set(names) - truth),
        errors={name: error for name, error, _ in measured},
        covered=tuple(covers for _, _, covers in measured if covers is not None),
        shrinkage=_shrunk(answer.get("shrinkage") or {}) if truth else None,
        seconds=float(answer.get("seconds") or 0.0),
    )


def right(mark: Mark) -> bool:
    """Whether an answer is right as a whole: what a list of wrong answers leaves out."""
    kind = mark.label.kind
    if kind == TWO:
        return mark.both
    if kind in (*KNOWN, WALK):
        return mark.twin and mark.joint is not False
    return not mark.alarmed if kind == "null" else mark.abstained


def _list_ranked(answer: Mapping[str, Any], twins: Mapping[str, str]) -> list[str]:
    """Return the effects of the ranking, each once, the best hypothesis' first."""
    return list(
        dict.fromkeys(
            twins.get(name, name) for hypothesis in answer.get("ranking") or [] for name in hypothesis["effects"]
        )
    )


def _joint_of(label: Label) -> str:
    return str(next(iter(label.effects.values()))["joints"])


def _on_joint(label: Label, causes: Sequence[Mapping[str, Any]]) -> bool:
    return any(list(cause.get("joints") or []) == [_joint_of(label)] for cause in causes)


def _on_map(label: Label, answer: Mapping[str, Any]) -> bool:
    cells = [cell for cell in answer["where"] if cell["regime"] == "all"]
    return bool(cells) and max(cells, key=lambda cell: cell["share"])["joint"] == _joint_of(label)


def _shrunk(shrinkage: Mapping[str, Any]) -> float | None:
    share, ceiling = shrinkage.get("fraction"), shrinkage.get("ceiling_fraction")
    return None if share is None or not ceiling or ceiling <= 0.0 else float(share / ceiling)


def _fit(label: Label, cause: Mapping[str, Any], twins: Mapping[str, str]) -> tuple[str, float, bool | None] | None:
    """Return effect, relative error and whether the intervals hold; None where another link or side was named.

    The error is that of the way from doing nothing: of a gain of 0.7 that is told as 0.75 it is 17 %.
    """
    called = twins.get(cause["effect"], cause["effect"])
    name = next(effect for effect in label.effects if twins.get(effect, effect) == called)
    entry, neutral = label.effects[name], label.neutral.get(name, {})
    fixed = cause.get("fixed") or {}
    if any(entry.get(key) != value for key, value in fixed.items() if key in ("link", "side")):
        return None
    values = {key: estimate["value"] for key, estimate in cause["parameters"].items()}
    if name != cause["effect"]:
        values = dict(zip(neutral, values.values(), strict=False))
    way = np.array([entry[key] - start for key, start in neutral.items()])
    off = np.array([values.get(key, fixed.get(key, start)) - entry[key] for key, start in neutral.items()])
    if not way.any():
        return None
    return called, float(np.linalg.norm(off) / np.linalg.norm(way)), _covers(cause, list(neutral), entry)


def _covers(cause: Mapping[str, Any], keys: Sequence[str], entry: Mapping[str, Any]) -> bool | None:
    """Return whether the intervals of the dialled parameters hold the truth; None where one has no interval."""
    bounds = list(cause["parameters"].values()) if len(keys) == 1 and len(cause["parameters"]) == 1 else None
    pairs = zip(keys, bounds, strict=True) if bounds else ((key, cause["parameters"].get(key, {})) for key in keys)
    held = [(entry[key], estimate.get("low"), estimate.get("high")) for key, estimate in pairs]
    if any(low is None or high is None for _, low, high in held):
        return None
    return all(low <= value <= high for value, low, high in held)
