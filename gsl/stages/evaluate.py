"""Measure policies in the real world, choose the best stable one, and measure that one again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.seeds import derived_seed
from gsl.core.setting import component, setting
from gsl.core.statistics import Interval, difference_interval, mean_interval
from gsl.grounding.none import NoGrounding
from gsl.policies.policy import Policy
from gsl.stages.choices import FILE, policies, records, vector
from gsl.stages.population import Episode, Job, episodes
from gsl.stages.rollout import Scenario
from gsl.storage.documents import write_json
from gsl.storage.policies import PolicyRecord, write_policies
from gsl.storage.references import resolve
from gsl.tasks.task import REAL, Task
from gsl.worlds.world import World

TABLE = "evaluation.json"
_CHOICE, _CONFIRMATION = "choice", "confirmation"  # their seeds never meet


@component
class Evaluate:
    """A policy that falls once is unstable and costs no further episode; the first policy of the file is the baseline.

    The best stable policy is measured again on fresh episodes, and so is the baseline: the speeds that are reported
    did not take part in the choice. If it falls there, it is unstable after all and the next best one is tried; every
    episode counts.
    """

    kind: ClassVar[str] = "evaluate"

    world: Annotated[World, setting("the real world")]
    task: Annotated[Task, setting("what is measured")]
    policy: Annotated[Policy, setting("family of the policies")]
    policies: Annotated[str, setting("policies file or optimize artifact")]
    episodes: Annotated[int, setting("episodes of each policy for the choice", ge=1)]
    confirmation: Annotated[int, setting("fresh episodes of the chosen policy and of the baseline", ge=2)]
    workers: Annotated[int, setting("processes; -1 for one a core")] = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def parents(self) -> Mapping[str, Path]:
        """Return where the policies come from."""
        return {"policies": resolve(self.policies)}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        """Write the table of all policies and the chosen one."""
        found = records(self.policy, self.policies)
        scenario = Scenario(self.world, self.task, self.policy, REAL, NoGrounding())
        total = self.episodes * len(found) + 2 * self.confirmation
        with console.progress(total, "measuring in the real world") as progress:
            tried = [self._measured(scenario, theta, index, _CHOICE, progress) for index, theta in enumerate(found)]
            fresh = {0: self._measured(scenario, found[0], 0, _CONFIRMATION, progress)}
            best = self._confirmed(scenario, found, tried, fresh, progress)
        rows = [_row(theta, done) for theta, done in zip(found, tried, strict=True)]
        confirmed = [_row(found[index], done) for index, done in fresh.items()]
        write_json(folder / TABLE, {"unit": "value of the task", "policies": rows, "confirmation": confirmed})
        write_policies(folder / FILE, policies(self.policy, self.task, [found[best]]))
        return {
            "best": found[best].name,
            "best_generation": found[best].generation or 0,
            "returned_value_sim": found[best].value_sim,
            "baseline": _summary(fresh[0]),
            "returned": _summary(fresh[best]),
            "gain": _gain(fresh[best], fresh[0]),
            "unconfirmed": [found[index].name for index, done in fresh.items() if index and _falls(done)],
            "stable_policies": sum(1 for done in tried[1:] if not _falls(done)),
            "improving_policies": sum(1 for done in tried[1:] if not _falls(done) and _mean(done) > _mean(tried[0])),
            "policies": len(found) - 1,
            "real_episodes": sum(map(len, tried)) + sum(map(len, fresh.values())),
        }

    def _confirmed(
        self,
        scenario: Scenario,
        found: tuple[PolicyRecord, ...],
        tried: list[list[Episode]],
        fresh: dict[int, list[Episode]],
        progress: Any,
    ) -> int:
        """Return the fastest policy that is stable in the choice and in fresh episodes, which go into `fresh`."""
        better = [
            index
            for index in range(1, len(tried))
            if not _falls(tried[index]) and _mean(tried[index]) > _mean(tried[0])
        ]
        for index in sorted(better, key=lambda index: -_mean(tried[index])):
            fresh[index] = self._measured(scenario, found[index], index, _CONFIRMATION, progress)
            if not _falls(fresh[index]):
                return index
        return 0

    def _measured(
        self, scenario: Scenario, theta: PolicyRecord, index: int, purpose: str, progress: Any
    ) -> list[Episode]:
        """Run the episodes of one purpose; for the choice only up to and with the first fall."""
        count = self.episodes if purpose == _CHOICE else self.confirmation
        parameters = vector(self.policy, theta)
        jobs = [Job(parameters, derived_seed(self.seed, self.kind, purpose, index, number)) for number in range(count)]
        done = episodes(scenario, jobs, workers=self.workers, progress=progress)
        first_fall = next((number for number, episode in enumerate(done) if episode.fell), count)
        return done[: first_fall + 1] if purpose == _CHOICE else done


def _falls(done: list[Episode]) -> int:
    return sum(episode.fell for episode in done)


def _mean(done: list[Episode]) -> float:
    return float(np.mean([episode.value for episode in done]))


def _summary(done: list[Episode]) -> dict[str, Any]:
    interval = mean_interval([episode.value for episode in done])
    return {
        "value": interval.mean,
        "interval": [interval.lower, interval.upper],
        "falls": _falls(done),
        "episodes": len(done),
    }


def _row(theta: PolicyRecord, done: list[Episode]) -> dict[str, Any]:
    values = [episode.value for episode in done]
    return {
        "name": theta.name,
        "generation": theta.generation,
        "value_sim": theta.value_sim,
        **_summary(done),
        "values": values,
    }


def _gain(after: list[Episode], before: list[Episode]) -> dict[str, Any]:
    values = [[episode.value for episode in done] for done in (after, before)]
    difference: Interval = difference_interval(np.array(values[0]), np.array(values[1]))
    return {
        "value": difference.mean,
        "interval": [difference.lower, difference.upper],
        "share": difference.mean / _mean(before),
    }
