"""A cross-validation as a table: errors of whole replays on what was held out, fold by fold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from gsl.core.statistics import Interval, bootstrap_interval
from gsl.report.markdown import table as markdown

AS_IT_WAS, CALIBRATED, DIAGNOSED = "as it was", "calibrated", "diagnosed"
SAID = {"unknown": " (suspected)", "inseparable": " (or another that the log cannot tell apart)"}
GAT, DIAGNOSED_GAT = "GAT", "diagnosed + GAT"
SERVO, DIAGNOSED_SERVO = "servo", "diagnosed + servo"


@dataclass(frozen=True)
class Fold:
    """What came of holding out one or more values of a label.

    Attributes:
        values: Of the label.
        verdict: Of the diagnosis of the rest.
        causes: Named, or suspected where nothing may be named.
        parameters: Of these, as a world's `effects:`.
        removed: Share of the held-out excess of windows that is gone, if there is any.
        ceiling: The same with a law of each servo on top of the effects.
        names: Of the held-out trajectories.
        errors: Mean absolute error of each of them in a whole replay [rad], by what replays it; NaN where it diverges
            or where the torque is never on.
        servos: What servos that were learned say of themselves, by what replays with them.
    """

    values: Sequence[Any]
    verdict: str
    causes: Sequence[str]
    parameters: Mapping[str, Any]
    removed: float | None
    ceiling: float | None
    names: Sequence[str]
    errors: Mapping[str, Sequence[float]]
    servos: Mapping[str, Any] = field(default_factory=dict)

    @property
    def held_out(self) -> str:
        """What was held out, in words."""
        return ", ".join(map(str, self.values))

    @property
    def replayed(self) -> Mapping[str, np.ndarray]:
        """Errors of the trajectories that all replays come through, so that means are of the same ones."""
        errors = {way: np.asarray(values, dtype=float) for way, values in self.errors.items()}
        through = np.all([np.isfinite(values) for values in errors.values()], axis=0)
        return {way: values[through] for way, values in errors.items()}

    def document(self) -> dict[str, Any]:
        """Return it as a JSON document."""
        return asdict(self)


def table(folds: Sequence[Fold], by: str, unit: str = "rad") -> str:
    """Return the table, and below it how the diagnosis compares with the best of the others; errors are in `unit`."""
    ways = list(folds[0].errors)
    columns = (f"{by} held out", *(f"{way} [m{unit}]" for way in ways), "excess removed", "with a servo law", "causes")
    rows = [
        (
            fold.held_out,
            *(_mean(fold.replayed[way]) for way in ways),
            _percent(fold.removed),
            _percent(fold.ceiling),
            f"{', '.join(fold.causes) or '-'}{SAID.get(fold.verdict, '')}",
        )
        for fold in folds
    ]
    every = {way: np.concatenate([fold.replayed[way] for fold in folds]) for way in ways}
    rows.append(("all", *(_mean(every[way]) for way in ways), "", "", ""))
    below = "Mean absolute error of the joints in open-loop replays of whole trajectories that no fit has seen."
    return "\n".join(
        [markdown(columns, rows), below, *_list_lost(folds), *_compare(folds, every), *_on_top(folds, every), ""]
    )


def _list_lost(folds: Sequence[Fold]) -> Iterator[str]:
    """Tell how many trajectories are in no mean, and why."""
    every = {way: np.concatenate([fold.errors[way] for fold in folds]) for way in folds[0].errors}
    lost = {way: ~np.isfinite(np.asarray(values, dtype=float)) for way, values in every.items()}
    some, whole = np.any(list(lost.values()), axis=0), np.all(list(lost.values()), axis=0)
    if some.any():
        counts = ", ".join(f"{way} {int(values.sum())}" for way, values in lost.items())
        yield (
            f"{int(some.sum())} of {len(some)} trajectories are in no mean: a replay diverged or the torque was never "
            f"on ({counts}; {int(whole.sum())} in every replay)."
        )


def _compare(folds: Sequence[Fold], every: Mapping[str, np.ndarray]) -> Iterator[str]:
    after = every[DIAGNOSED]
    if not len(after):
        return
    others = [way for way in every if way not in (DIAGNOSED, DIAGNOSED_GAT, DIAGNOSED_SERVO)]
    rival = min(others, key=lambda way: float(np.mean(every[way])))
    change = _change([fold for fold in folds if len(fold.replayed[rival])], DIAGNOSED, rival)
    yield (
        f"The diagnosed simulator's mean error against the best of the others ({rival}): {100.0 * change.mean:+.0f} % "
        f"({100.0 * change.lower:+.0f} to {100.0 * change.upper:+.0f} %, bootstrap over folds and "
        f"trajectories). It is smaller in {int((after < every[rival]).sum())} of {len(after)} trajectories."
    )


def _on_top(folds: Sequence[Fold], every: Mapping[str, np.ndarray]) -> Iterator[str]:
    """Tell what a learned servo does on top of the diagnosis."""
    if DIAGNOSED_SERVO not in every or not len(every[DIAGNOSED]):
        return
    some = [fold for fold in folds if len(fold.replayed[DIAGNOSED])]
    change = _change(some, DIAGNOSED_SERVO, DIAGNOSED)
    means = [[float(np.mean(fold.replayed[way])) for way in (DIAGNOSED_SERVO, DIAGNOSED)] for fold in some]
    worse = [fold.held_out for fold, (after, before) in zip(some, means, strict=True) if after > before]
    yield (
        f"A learned servo on top changes the diagnosed simulator's mean error by {100.0 * change.mean:+.0f} % "
        f"({100.0 * change.lower:+.0f} to {100.0 * change.upper:+.0f} %); folds that get worse: "
        f"{'; '.join(worse) or 'none'}."
    )


def _mean(errors: np.ndarray) -> str:
    return f"{1e3 * np.mean(errors):.1f}" if len(errors) else "-"


def _change(folds: Sequence[Fold], way: str, rival: str) -> Interval:
    """Return the relative change of the mean error, with an interval over folds and the trajectories in them."""
    rng = np.random.default_rng(0)

    def resample(index: np.ndarray) -> float:
        errors = {name: [np.asarray(folds[k].replayed[name]) for k in index] for name in (rival, way)}
        again = [rng.integers(len(fold), size=len(fold)) for fold in errors[rival]]
        after, before = (
            np.mean(np.concatenate([fold[chosen] for fold, chosen in zip(errors[name], again, strict=True)]))
            for name in (way, rival)
        )
        return float(after / before) - 1.0

    every = {name: np.mean(np.concatenate([fold.replayed[name] for fold in folds])) for name in (rival, way)}
    interval = bootstrap_interval(resample, len(folds), np.random.default_rng(0))
    return interval._replace(mean=float(every[way] / every[rival]) - 1.0)


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.0f} %"
