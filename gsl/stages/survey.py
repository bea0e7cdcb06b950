"""How far real worlds are from the simulator: π0, sim-optimal policies and random policies in each of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.console import Console
from gsl.core.interfaces import REAL, Policy, Search, Task, World
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.core.statistics import rank_correlation
from gsl.grounding.none import NoGrounding
from gsl.policies.policy import neighbour
from gsl.report.markdown import table
from gsl.rollout.parallel import Episode, Job, Workers, episodes
from gsl.rollout.rollout import Scenario
from gsl.stages.optimize import Optimize
from gsl.storage.policies import read_policies
from gsl.storage.policy_choice import FILE, vector

TABLE = "table.md"
COLUMNS = (
    *("world", "π0", "sd", "falls of π0", "sim-optimal that fall", "random that fall", "best random"),
    *("rank correlation with the simulator", "with itself"),
)


@component
class Survey:
    """Sim-optimal: the best of each generation of `searches` searches in the simulator, the first generation left out.

    Random: the start parameters, each moved by a Gaussian of `spread`. A fall is worth 0. The last column repeats the
    random policies with other seeds: the most that any simulator could reach.
    """

    kind: ClassVar[str] = "survey"

    sim: Annotated[World, setting("the simulator")]
    worlds: Annotated[Mapping[str, World], setting("the worlds to survey, by name")]
    task: Annotated[Task, setting("what is measured")]
    policy: Annotated[Policy, setting("family of the policies")]
    optimizer: Annotated[Search, setting("what finds sim-optimal policies")]
    rollouts: Annotated[int, setting("simulated episodes of a candidate", ge=1)]
    searches: Annotated[int, setting("searches in the simulator", ge=1)] = 3
    repeats: Annotated[int, setting("episodes of π0", ge=2)] = 10
    random: Annotated[int, setting("random policies", ge=3)] = 40
    spread: Annotated[float, setting("of the random policies, in units of a parameter's scale", gt=0)] = 0.12
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here."""
        return {}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the table."""
        optimal = [theta for number in range(self.searches) for theta in self._search(number, folder, console)]
        rng = np.random.default_rng(self.seed)
        random = [neighbour(self.policy, self.policy.initial, self.spread, rng) for _ in range(self.random)]
        reference = _values(self._episodes(self.sim, random, "reference", console))
        rows, metrics = [], {}
        for name, world in self.worlds.items():
            start = self._episodes(world, [self.policy.initial] * self.repeats, "start", console)
            twice = self._episodes(world, [theta for theta in optimal for _ in range(2)], "optimal", console)
            once, again = (self._episodes(world, random, label, console) for label in ("random", "again"))
            falls = sum(first.fell or second.fell for first, second in zip(twice[::2], twice[1::2], strict=True))
            rank = rank_correlation(reference, _values(once)), rank_correlation(_values(once), _values(again))
            rows.append(self._row(name, start, f"{falls} of {len(optimal)}", once, rank))
            metrics[name] = {
                "pi0": float(_values(start).mean()),
                "sim_optimal_falls": falls,
                "rank": rank[0],
                "ceiling": rank[1],
            }
        (folder / TABLE).write_text(table(COLUMNS, rows), encoding="utf-8")
        return metrics

    def _search(self, number: int, folder: Path, console: Console) -> list[np.ndarray]:
        place = folder / f"search_{number + 1}"
        place.mkdir(exist_ok=True)
        search = Optimize(
            world=self.sim,
            task=self.task,
            policy=self.policy,
            grounding=NoGrounding(),
            optimizer=self.optimizer,
            rollouts=self.rollouts,
            workers=self.workers,
            seed=self.seed + number,
        )
        search.run(place, console)
        return [vector(self.policy, theta) for theta in read_policies(place / FILE).records[2:]]

    def _episodes(self, world: World, thetas: Sequence[np.ndarray], label: str, console: Console) -> list[Episode]:
        scenario = Scenario(world, self.task, self.policy, REAL, NoGrounding())
        jobs = [Job(theta, derive_seed(self.seed, self.kind, label, index)) for index, theta in enumerate(thetas)]
        with console.progress(len(jobs), label) as progress:
            return episodes(scenario, jobs, workers=self.workers, progress=progress)

    def _row(
        self, name: str, start: list[Episode], optimal: str, random: list[Episode], rank: tuple[float, float]
    ) -> tuple[str, ...]:
        values = self.task.shown * _values(start)
        best = self.task.shown * _values(random).max()
        spread = f"{values.std(ddof=1):.2f}"
        return (
            *(name, f"{values.mean():.1f}", spread, _fell(start), optimal, _fell(random), f"{best:.1f}"),
            *(f"{correlation:.2f}" for correlation in rank),
        )


def _values(done: Sequence[Episode]) -> np.ndarray:
    return np.array([episode.value for episode in done])


def _fell(done: Sequence[Episode]) -> str:
    return f"{sum(episode.fell for episode in done)} of {len(done)}"
