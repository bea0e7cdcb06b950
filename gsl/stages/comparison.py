"""The figures of a comparison: what each trial came to, what each method came to, and the table of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from gsl.core.statistics import mean_interval

COLUMNS = (
    *("real world", "grounding", "improvement in real [%]", "95 % interval", "trials without", "stable winners"),
    *("improving winners", "best generation", "falls after the choice", "real episodes"),
)


class Trial(NamedTuple):
    """One method, once, in one real world.

    Attributes:
        improvement: Of the returned policy over π0 on fresh real episodes [%]; 0 where π0 itself was returned.
        returned: Name of the returned policy.
        generation: That found it, 0 for π0.
        stable: Winners of generations that fell in no episode of the choice.
        improving: Those of them that were faster than π0.
        winners: All winners of generations.
        unconfirmed: Stable winners that fell in the confirmation.
        real_episodes: Spent on measuring, without those that models were trained on.
    """

    world: str
    method: str
    number: int
    improvement: float
    returned: str
    generation: int
    stable: int
    improving: int
    winners: int
    unconfirmed: int
    real_episodes: int

    @classmethod
    def of(cls, world: str, method: str, number: int, metrics: Mapping[str, Any]) -> Trial:
        """Read an evaluation's metrics."""
        return cls(
            world,
            method,
            number,
            improvement=100.0 * metrics["gain"]["share"],
            returned=metrics["best"],
            generation=metrics["best_generation"],
            stable=metrics["stable_policies"],
            improving=metrics["improving_policies"],
            winners=metrics["policies"],
            unconfirmed=len(metrics["unconfirmed"]),
            real_episodes=metrics["real_episodes"],
        )

    @property
    def told(self) -> str:
        """The trial in a few words."""
        return f"{self.returned}, {self.improvement:+.1f} %, {self.stable} of {self.winners} winners stable"

    @property
    def without(self) -> bool:
        """Whether the trial found no stable improvement."""
        return self.generation == 0 or self.improvement <= 0.0


class Summary(NamedTuple):
    """All trials of a method in a world; the improvement is the mean over trials, failed ones counting 0 [%]."""

    world: str
    method: str
    trials: int
    improvement: float
    interval: tuple[float, float]
    without: int
    stable: int
    improving: int
    winners: int
    unconfirmed: int
    generation: float
    real_episodes: float


def summaries(trials: Sequence[Trial]) -> list[Summary]:
    """Return one summary for each world and method, in the order of their first trial."""
    keys = list(dict.fromkeys((trial.world, trial.method) for trial in trials))
    return [_summary([trial for trial in trials if (trial.world, trial.method) == key]) for key in keys]


def rows(found: Sequence[Summary]) -> list[tuple[str, ...]]:
    """Return the table's cells; its titles are `COLUMNS`."""
    return [
        (
            one.world,
            one.method,
            f"{one.improvement:.1f}",
            f"{one.interval[0]:.1f} to {one.interval[1]:.1f}",
            f"{one.without} of {one.trials}",
            f"{one.stable} of {one.winners}",
            f"{one.improving}",
            f"{one.generation:.1f}",
            f"{one.unconfirmed}",
            f"{one.real_episodes:.0f}",
        )
        for one in sorted(found, key=lambda one: one.world)
    ]


def markdown(found: Sequence[Summary], trials: Sequence[Trial]) -> str:
    """Return the table with, below it, the improvement of every single trial."""
    lines = [_line(COLUMNS), _line(["---"] * len(COLUMNS)), *map(_line, rows(found)), ""]
    lines += ["Improvement of each trial [%], in the order of the trials:", ""]
    lines += [_line(("real world", "grounding", "trials")), _line(["---"] * 3)]
    for one in sorted(found, key=lambda one: one.world):
        values = [f"{trial.improvement:.1f}" for trial in trials if (trial.world, trial.method) == one[:2]]
        lines.append(_line((one.world, one.method, ", ".join(values))))
    return "\n".join(lines) + "\n"


def _summary(trials: list[Trial]) -> Summary:
    gains = [0.0 if trial.without else trial.improvement for trial in trials]
    interval = mean_interval(gains)
    found = [trial.generation for trial in trials if not trial.without]
    return Summary(
        trials[0].world,
        trials[0].method,
        len(trials),
        interval.mean,
        (interval.lower, interval.upper),
        without=sum(trial.without for trial in trials),
        stable=sum(trial.stable for trial in trials),
        improving=sum(trial.improving for trial in trials),
        winners=sum(trial.winners for trial in trials),
        unconfirmed=sum(trial.unconfirmed for trial in trials),
        generation=sum(found) / len(found) if found else float("nan"),
        real_episodes=sum(trial.real_episodes for trial in trials) / len(trials),
    )


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"
