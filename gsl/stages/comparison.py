"""The figures of a comparison: what each trial came to, what each method came to, and the tables of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from gsl.core.statistics import Interval, mean_interval
from gsl.report.markdown import table

COLUMNS = (
    *("real world", "grounding", "improvement in real [%]", "95 % interval", "trials without"),
    *("stable winners", "improving winners", "best generation", "falls in fresh episodes", "refused by the check"),
    "real episodes",
)


class Trial(NamedTuple):
    """One method, once, in one real world.

    Attributes:
        improvement: Of the returned policy over π0 on fresh real episodes [%], falls counting as they do in the task;
            0 where π0 itself was returned.
        surely: Lower end of its 95 % interval [%].
        returned: Name of the returned policy.
        generation: That found it, 0 for π0.
        falls: Of the returned policy in fresh episodes.
        stable: Winners of generations that fell in no episode of the choice.
        improving: Those of them that were faster than π0.
        winners: All winners of generations.
        alpha: How far the grounding went, None where there is none.
        refused: Whether the grounding's check would have refused it.
        real_episodes: Of models, choice, check and report.
    """

    world: str
    method: str
    number: int
    improvement: float
    surely: float
    returned: str
    generation: int
    falls: int
    stable: int
    improving: int
    winners: int
    alpha: float | None
    refused: bool
    real_episodes: int

    @classmethod
    def of(
        cls, world: str, method: str, number: int, found: Mapping[str, Any], measured: Mapping[str, Any], collected: int
    ) -> Trial:
        """Read the metrics of a search and of its evaluation; `collected` real episodes went into models."""
        start = measured["baseline"]["value"]
        return cls(
            world,
            method,
            number,
            improvement=100.0 * measured["gain"]["value"] / start,
            surely=100.0 * measured["gain"]["interval"][0] / start,
            returned=measured["best"],
            generation=measured["best_generation"],
            falls=measured["returned"]["falls"],
            stable=measured["stable_policies"],
            improving=measured["improving_policies"],
            winners=measured["policies"],
            alpha=found.get("alpha"),
            refused=not found.get("grounding_acceptable", True),
            real_episodes=collected + measured["real_episodes"],
        )

    @property
    def told(self) -> str:
        """The trial in a few words."""
        return f"{self.returned}, {self.improvement:+.1f} %, {self.stable} of {self.winners} winners stable"

    @property
    def without(self) -> bool:
        """Whether the trial found no stable improvement: a fall in fresh episodes, or a gain that may be none."""
        return self.falls > 0 or self.surely <= 0.0


class Summary(NamedTuple):
    """All trials of a method in a world; the improvement is the mean over trials [%]."""

    world: str
    method: str
    trials: int
    improvement: Interval
    without: int
    stable: int
    improving: int
    winners: int
    generation: float
    falls: int
    refused: int
    real_episodes: float


def summaries(trials: Sequence[Trial]) -> list[Summary]:
    """Return one summary for each world and method, by world, methods in the order of their first trial."""
    keys = sorted(dict.fromkeys((trial.world, trial.method) for trial in trials), key=lambda key: key[0])
    return [_summary([trial for trial in trials if (trial.world, trial.method) == key]) for key in keys]


def differences(trials: Sequence[Trial], world: str, method: str, other: str) -> Interval:
    """Return the mean improvement of a method over another, paired by trial, with its 95 % interval [%]."""
    gains = {(trial.method, trial.number): trial.improvement for trial in trials if trial.world == world}
    numbers = [number for name, number in gains if name == method]
    return mean_interval([gains[method, number] - gains[other, number] for number in numbers])


def rows(found: Sequence[Summary]) -> list[tuple[str, ...]]:
    """Return the table's cells; its titles are `COLUMNS`."""
    return [
        (
            one.world,
            one.method,
            f"{one.improvement.mean:.1f}",
            _told(one.improvement),
            f"{one.without} of {one.trials}",
            f"{one.stable} of {one.winners}",
            f"{one.improving} of {one.winners}",
            f"{one.generation:.1f}",
            f"{one.falls}",
            f"{one.refused} of {one.trials}",
            f"{one.real_episodes:.0f}",
        )
        for one in found
    ]


def markdown(found: Sequence[Summary], trials: Sequence[Trial]) -> str:
    """Return the table, the paired differences to the first method, and the improvement of every single trial."""
    first, single, paired = found[0].method, [], []
    for one in found:
        values = [f"{trial.improvement:.1f}{'*' if trial.without else ''}" for trial in trials if _of(trial, one)]
        single.append((one.world, one.method, ", ".join(values)))
        if one.method != first:
            difference = differences(trials, one.world, one.method, first)
            paired.append((one.world, f"{one.method} - {first}", f"{difference.mean:+.1f}", _told(difference)))
    return "\n".join(
        [
            table(COLUMNS, rows(found)),
            "Differences of the improvement, paired by trial [percentage points]:\n",
            table(("real world", "difference", "mean", "95 % interval"), paired),
            "Improvement of each trial [%], in the order of the trials; * without a stable improvement:\n",
            table(("real world", "grounding", "trials"), single),
        ]
    )


def _of(trial: Trial, one: Summary) -> bool:
    return (trial.world, trial.method) == (one.world, one.method)


def _told(interval: Interval) -> str:
    return f"{interval.lower:.1f} to {interval.upper:.1f}"


def _summary(trials: list[Trial]) -> Summary:
    generations = [trial.generation for trial in trials if trial.generation]
    return Summary(
        trials[0].world,
        trials[0].method,
        len(trials),
        mean_interval([trial.improvement for trial in trials]),
        without=sum(trial.without for trial in trials),
        stable=sum(trial.stable for trial in trials),
        improving=sum(trial.improving for trial in trials),
        winners=sum(trial.winners for trial in trials),
        generation=sum(generations) / len(generations) if generations else float("nan"),
        falls=sum(trial.falls for trial in trials),
        refused=sum(trial.refused for trial in trials),
        real_episodes=sum(trial.real_episodes for trial in trials) / len(trials),
    )
