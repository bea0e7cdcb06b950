"""Measure policies in the real world, choose the best stable one, and measure that one again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import scipy

from gsl.core.console import Console
from gsl.core.described import describe
from gsl.core.interfaces import REAL, Policy, Task, World
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.core.statistics import difference_interval
from gsl.core.trajectory import Trajectory
from gsl.core.trust import modules_in
from gsl.core.unit import Unit
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.policies.outside import warn_of_wiring
from gsl.policies.policy import size
from gsl.real_robot.errand import Errand, Order, answer_parents, ask
from gsl.report.evaluation_cells import name_policy
from gsl.report.evaluation_page import Look, write_evaluation_page
from gsl.report.run_page import Change
from gsl.rollout.parallel import Episode, Job, Workers, episodes
from gsl.rollout.promise import promise
from gsl.rollout.returns import falls, gain, mean, row, summary
from gsl.rollout.rollout import Scenario
from gsl.storage.documents import write_json
from gsl.storage.policies import PolicyRecord, write_policies
from gsl.storage.policy_choice import EVALUATION, FILE, policies, record, records, vector
from gsl.storage.references import resolve
from gsl.validation.evaluation_pictures import Walked, look_at
from gsl.validation.uncharged import warn_uncharged
from gsl.worlds.external import ExternalRobot

_CHOICE, _CHECK, _REPORT = "choice", "check", "report"  # their seeds never meet
CHALLENGERS = 2  # that are checked, at most, where falls are tolerated
SURE = 0.95  # that a policy is ahead, one-sided
_UNTIL_FALL = {
    _CHOICE: "To choose a policy: {} of them, {} episodes each, of one that falls none after its fall.",
    _CHECK: "To check the fastest policy that did not fall: {1} episodes more, until it falls.",
}
_TO_THE_END = {
    _CHOICE: "To choose a policy: {} of them, {} episodes each, falls and all.",
    _CHECK: "To check a policy: {1} episodes more, falls and all.",
    _REPORT: "To report: {1} fresh episodes of the chosen policy and of the one it is compared with, falls and all.",
}


@component
class Evaluate:
    """Choice, check, report: each in real episodes of its own, all of them counted.

    Choice: `episodes` of each policy; one that falls is unstable, and what would have followed is thrown away. Check:
    the fastest stable policy walks `check` episodes more; if it falls, the next best one does. Where falls are
    tolerated the baseline walks `check` episodes too, and a policy, one of two at most, has to be above it in these:
    surely, or with surely fewer falls. Report: the policy that is left, or the baseline (the first of the file) if none
    is, is measured on `confirmation` fresh episodes beside the baseline, and these figures, falls and all, are what is
    reported: they took no part in the choice.
    """

    kind: ClassVar[str] = "evaluate"

    world: Annotated[World, setting("the real world")]
    task: Annotated[Task, setting("what is measured")]
    policy: Annotated[Policy, setting("family of the policies")]
    policies: Annotated[str | None, setting("policies file or optimize artifact; null for π0 alone")]
    episodes: Annotated[int, setting("episodes of each policy for the choice", ge=1)]
    check: Annotated[int, setting("more episodes of the fastest stable policy, which has to stay so", ge=1)]
    confirmation: Annotated[int, setting("fresh episodes of the chosen policy and of the baseline", ge=2)]
    tolerated: Annotated[float, setting("share of falls up to which a policy counts as stable", ge=0, le=1)] = 0.0
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def __post_init__(self) -> None:
        """Tell the policy its world; refuse a single episode as the check of a policy that may fall."""
        check_tolerated(self.tolerated, self.check)
        object.__setattr__(self, "policy", size(self.policy, self.world))

    def parents(self) -> Mapping[str, Path]:
        """Return where the policies come from, and what a robot somewhere else has answered."""
        source = {"policies": resolve(self.policies)} if self.policies else {}
        return {**source, **answer_parents(self.world)}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the table of all policies and the chosen one."""
        warn_of_wiring(self.policy, self.world.layout, console)
        if getattr(self.world, "action_noise", 0.0):
            warn_uncharged(self.world, console, REAL, "the world's noise")
        thetas = records(self.policy, self.policies) if self.policies else [self._start]
        logs = dict[str, Trajectory]()
        measure = partial(self._measure, logs=logs, console=console)
        tried = measure(thetas, _CHOICE, self.episodes)
        checked = dict(self._check(thetas, tried, measure))
        best = self._pick_passing(checked)
        reported = sorted({0, best})
        fresh = dict(zip(reported, measure([thetas[i] for i in reported], _REPORT, self.confirmation), strict=True))
        rows = [row(theta, done) for theta, done in zip(thetas, tried, strict=True)]
        again = [[row(thetas[index], done) for index, done in phase.items()] for phase in (checked, fresh)]
        document = {"policies": rows, "check": again[0], "confirmation": again[1]}
        write_json(folder / EVALUATION, document)
        write_policies(folder / FILE, policies(self.policy, self.task, [thetas[best]]))
        stable = [done for done in tried[1:] if self._stable(done)]
        promised = promise(thetas, best, summary(fresh[best]), Unit.of(self.task))
        if promised and promised["warning"]:
            console.status(f"warning: {promised['warning']}")
        metrics = {
            "best": thetas[best].name,
            "best_generation": thetas[best].generation or 0,
            "returned_value_sim": thetas[best].value_sim,
            "promise": promised,
            "baseline": summary(fresh[0]),
            "returned": summary(fresh[best]),
            "last": summary(tried[-1]),
            "gain": gain(fresh[best], fresh[0]),
            "failed_check": [thetas[index].name for index in checked if index not in (0, best)],
            "stable_policies": len(stable),
            "improving_policies": sum(mean(done) > mean(fresh[0]) for done in stable),
            "policies": len(thetas) - 1,
            "real_episodes": sum(map(len, [*tried, *checked.values(), *fresh.values()])),
        }
        first, chosen = (vector(self.policy, thetas[index]).tolist() for index in (0, best))
        change = Change(self.policy.names, first, chosen, self.policy.scale.tolist())
        console.phase("drawing the page")
        look = self._look_at([(thetas[index], fresh[index]) for index in dict.fromkeys((best, 0))], logs, console)
        write_evaluation_page(folder, metrics, document, change, Unit.of(self.task), look)
        return metrics

    def _look_at(
        self,
        reported: Sequence[tuple[PolicyRecord, Sequence[Episode]]],
        logs: Mapping[str, Trajectory],
        console: Console,
    ) -> Look:
        """Return what there is to see of the reported policies: an episode of each is played once more, or logged."""
        walks = {}
        for theta, done in reported:
            shown = next((n for n, episode in enumerate(done) if episode.fell), 0)
            seed = derive_seed(self.seed, self.kind, _REPORT, theta.name, shown)
            played = Walked(vector(self.policy, theta), seed, logs.get(theta.name))
            walks[name_policy(theta.name)] = played
        source = resolve(self.policies) if self.policies else None
        return look_at(self._scenario, walks, source, modules_in(describe(self)), console)

    @property
    def _scenario(self) -> Scenario:
        return Scenario(self.world, self.task, self.policy, REAL, NoGrounding())

    @property
    def _start(self) -> PolicyRecord:
        return record(self.policy, "pi0", self.policy.initial)

    def _check(
        self,
        thetas: Sequence[PolicyRecord],
        tried: Sequence[list[Episode]],
        measure: Callable[..., list[list[Episode]]],
    ) -> Iterator[tuple[int, list[Episode]]]:
        """Yield the checks of stable policies that beat the baseline, up to the first that passes.

        The fastest comes first; where falls are tolerated, of those that fell least, and before all the baseline.
        """
        better = [index for index, done in enumerate(tried) if self._stable(done) and mean(done) > mean(tried[0])]
        order = sorted(better, key=lambda index: (falls(tried[index]), -mean(tried[index])))
        if self.tolerated and order:
            order = [0, *order[:CHALLENGERS]]
        checked: dict[int, list[Episode]] = {}
        for index in order:
            (checked[index],) = measure([thetas[index]], _CHECK, self.check)
            yield index, checked[index]
            if self._pick_passing(checked):
                return

    def _pick_passing(self, checked: Mapping[int, list[Episode]]) -> int:
        """Return the index of the policy that has passed its check, the baseline's if none has."""
        passed = (
            index
            for index, done in checked.items()
            if index and self._stable(done) and (not self.tolerated or _ahead(done, checked[0]))
        )
        return next(passed, 0)

    def _stable(self, done: Sequence[Episode]) -> bool:
        return falls(done) <= self.tolerated * len(done)

    def _measure(
        self,
        thetas: Sequence[PolicyRecord],
        purpose: str,
        count: int,
        *,
        logs: dict[str, Trajectory],
        console: Console,
    ) -> list[list[Episode]]:
        """Return the episodes of some policies; but for a report, none after a fall that is not tolerated.

        Into `logs` goes what a robot that is elsewhere has logged of each policy for the report.
        """
        scenario = self._scenario
        jobs = [
            Job(vector(self.policy, theta), derive_seed(self.seed, self.kind, purpose, theta.name, n))
            for theta in thetas
            for n in range(count)
        ]
        to_the_end = purpose == _REPORT or self.tolerated > 0.0
        done: Sequence[Episode | None]
        if isinstance(self.world, ExternalRobot):
            orders = [Order(thetas[index // count].name, job) for index, job in enumerate(jobs)]
            name = f"{purpose}_{thetas[0].name}" if purpose == _CHECK else purpose
            words = (_TO_THE_END if to_the_end else _UNTIL_FALL)[purpose].format(len(thetas), count)
            errand = Errand(name, words, not to_the_end, logs=False)
            verdicts = ask(scenario, orders, errand, workers=self.workers, console=console)
            done = [None if verdict is None else verdict.episode for verdict in verdicts]
            pairs = [(order.policy, verdict) for order, verdict in zip(orders, verdicts, strict=True) if verdict]
            for name, verdict in sorted(pairs, key=lambda pair: not pair[1].episode.fell)[::-1]:  # the first fall last
                if verdict.trajectory and purpose == _REPORT:
                    logs[name] = verdict.trajectory
        else:
            with console.progress(len(jobs), f"{purpose} in the real world") as progress:
                done = episodes(scenario, jobs, workers=self.workers, progress=progress)
        groups = [list(done[first : first + count]) for first in range(0, len(done), count)]
        return [_until_fall(group, to_the_end=to_the_end) for group in groups]


def check_tolerated(tolerated: float, check: int) -> None:
    """Refuse a single episode as the check of a policy that may fall.

    Raises:
        ConfigError: It is one.
    """
    if tolerated and check < 2:
        raise ConfigError("check", "needs two episodes at least where falls are tolerated", given=str(check))


def _ahead(done: Sequence[Episode], other: Sequence[Episode]) -> bool:
    """Whether some episodes have a higher mean than others, and surely so or with surely fewer falls; two of each."""
    values = (np.array([episode.value for episode in episodes]) for episodes in (done, other))
    difference = difference_interval(*values, confidence=2.0 * SURE - 1.0)
    fallen = [(falls(episodes), len(episodes) - falls(episodes)) for episodes in (done, other)]
    fewer = scipy.stats.fisher_exact(fallen, alternative="less").pvalue < 1.0 - SURE
    return bool(difference.lower > 0.0 or (difference.mean > 0.0 and fewer))


def _until_fall(done: Sequence[Episode | None], *, to_the_end: bool) -> list[Episode]:
    """Return the episodes that count: where a fall ends a policy's chances, those up to its first one."""
    kept: list[Episode] = []
    for episode in done:
        if episode is None or (kept and kept[-1].fell and not to_the_end):
            break
        kept.append(episode)
    return kept
