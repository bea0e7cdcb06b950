"""Improve a policy in the simulator, grounded or not; the best candidate of every generation is kept."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.console import Console, Progress
from gsl.core.interfaces import SIM, Grounding, Learner, Policy, Search, Task, World
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.core.step_metrics import note_step
from gsl.core.unit import Unit
from gsl.grounding.effects import innermost
from gsl.grounding.gat import ActionTransformation, LoadedTransformation
from gsl.grounding.preparation import parents_of, without_margins
from gsl.optimizers.candidates import check_candidates
from gsl.optimizers.objective import CVAR, Objective, Quantile, check_objective, objective_values
from gsl.optimizers.race import Race, Racing
from gsl.optimizers.random_state import keep_apart
from gsl.policies.outside import warn_of_wiring
from gsl.policies.policy import size_to_search
from gsl.report.iteration_page import read_check
from gsl.report.run_page import Change
from gsl.report.search_page import Winner, write_search_page
from gsl.rollout.estimate import estimate
from gsl.rollout.parallel import Job, Workers, episodes
from gsl.rollout.rl_env import GroundedSimulator
from gsl.rollout.rollout import Scenario
from gsl.storage.generation_log import FILE as PROGRESS
from gsl.storage.generation_log import Generation, GenerationLog
from gsl.storage.models import model_file
from gsl.storage.policies import PolicyRecord, write_policies
from gsl.storage.policy_choice import FILE, PolicyChoice, policies, record, vector
from gsl.validation.check_grounding import check_grounding
from gsl.validation.compliance_transfer import report_compliance
from gsl.validation.drift import drifts, read_region
from gsl.validation.gate import REPORT, Gate
from gsl.validation.screening import Screening, foretells_falls, passing, screen
from gsl.worlds.ensemble import take_turns

BEST = "best_in_simulation.json"


@component
class Optimize:
    """Candidates are judged by the mean value of `rollouts` episodes each; a killed search goes on where it was.

    With optimizer.race a candidate plays fewer of them once others would change nothing, see gsl/optimizers/race.py.

    With objective=cvar they are judged by the mean of their worst episodes (`quantile`). What is reported as a value in
    simulation is the mean of all episodes in any case, so that searches can be compared.

    Where a servo or effects ground the simulator, winners walk `screening` more episodes in it, without noise on top.
    Those that fall are left out of the policies.

    Of equally good generations the last one's is the best: its distribution has left the edge of what does as well.
    """

    kind: ClassVar[str] = "optimize"
    progress: ClassVar[str] = PROGRESS

    world: Annotated[World, setting("the simulator")]
    task: Annotated[Task, setting("what is to be maximised")]
    policy: Annotated[Policy, setting("what is to be improved")]
    grounding: Annotated[Grounding, setting("what stands between action and simulator")]
    optimizer: Annotated[Search | Learner, setting("what improves the parameters")]
    rollouts: Annotated[int, setting("episodes of each candidate", ge=1)]
    screening: Screening = 0
    objective: Objective = "mean"
    quantile: Quantile = 0.25
    initial: Annotated[str | None, setting("policies file or artifact to start from; none for the start values")] = None
    accept: Annotated[bool, setting("go on with a grounding that fails its check")] = False
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def __post_init__(self) -> None:
        """Tell the policy its world; refuse an objective that the optimiser does not know."""
        check_objective(self.objective, self.optimizer)
        object.__setattr__(self, "policy", size_to_search(self.policy, self.world))

    def parents(self) -> Mapping[str, Path]:
        """Return the start policy and what the grounding is made of."""
        return {**PolicyChoice(self.policy, self.initial).parents("initial"), **parents_of(self.grounding)}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the policies: π0, then one of each generation; and which of these is worth most in simulation."""
        warn_of_wiring(self.policy, self.world.layout, console)
        first = PolicyChoice(self.policy, self.initial).parameters()
        bare = Scenario(self.world, self.task, self.policy, SIM, self.grounding)
        scenario, checked = check_grounding(bare, Gate(first, folder, console, self.accept, self.seed))
        yielding = report_compliance(
            bare.world, scenario.world, scenario.grounding, folder / REPORT, console, self.seed
        )
        thetas = [record(self.policy, "pi0" if self.initial is None else "start", first)]
        if isinstance(self.optimizer, Search):
            winners = [*self._search(self.optimizer, scenario, first, GenerationLog(folder, console.status), console)]
        else:
            winners = [*self._learn(self.optimizer, scenario, first, console)]
        kept, screened = self._screen(bare, checked, winners, console)
        thetas += [winner.policy for winner in kept]
        write_policies(folder / FILE, policies(self.policy, self.task, thetas))
        chosen = max(reversed(kept), key=lambda winner: winner.worth)
        best = chosen.policy
        write_policies(folder / BEST, policies(self.policy, self.task, [best]))
        metrics = {
            "generations": len(winners),
            "best_value_sim": best.value_sim,
            **({"best_cvar_sim": chosen.worth} if self.objective == CVAR else {}),
            **checked,
            **yielding,
            **screened,
            **self._drift(scenario, thetas, console),
        }
        change = Change(
            self.policy.names, first.tolist(), vector(self.policy, best).tolist(), self.policy.scale.tolist()
        )
        tried, check = [theta.name for theta in thetas], read_check(folder / REPORT)
        console.phase("drawing the page")
        write_search_page(
            folder,
            winners,
            tried,
            best,
            metrics,
            change,
            Unit.of(self.task),
            check=check,
            spent=self._count_episodes(winners),
        )
        return metrics

    def _search(
        self, optimizer: Search, scenario: Scenario, first: np.ndarray, log: GenerationLog, console: Console
    ) -> Iterator[Winner]:
        """Yield the best candidate of each generation of a search."""
        search = optimizer.start(first, self.policy.scale, derive_seed(self.seed, self.kind))
        total = optimizer.generations * optimizer.candidates * self.rollouts
        if log.read(0) is None and not console.has_plan and (line := estimate(scenario, first, total, self.workers)):
            console.status(line)
        error, highest = optimizer.race if isinstance(optimizer, Racing) else 0.0, -np.inf
        with console.progress(total, "optimising in simulation") as progress:
            for index in range(optimizer.generations):
                candidates = check_candidates(search.ask(), len(first), optimizer.candidates)
                generation = log.read(index)
                if generation is None:
                    generation = self._evaluate(scenario, candidates, index, progress, error)
                    log.append(generation)
                else:
                    progress.advance(len(candidates) * self.rollouts, worked=False)
                    progress.fell(sum(generation.falls))
                search.tell(generation.values)
                best = generation.winner
                means = generation.means or generation.values
                note_step(
                    "search",
                    index + 1,
                    best=generation.values[best],
                    mean=float(np.mean(generation.values)),
                    falls=sum(generation.falls),
                    falls_of_best=generation.falls[best],
                )
                highest = max(highest, generation.values[best])
                progress.best(f"best {Unit.of(self.task).format(highest)} in simulation")
                yield Winner(self._record(index, candidates[best], means[best]), generation)

    def _learn(self, optimizer: Learner, scenario: Scenario, first: np.ndarray, console: Console) -> Iterator[Winner]:
        """Yield what a learner has come to after each generation."""
        seed, simulator = derive_seed(self.seed, self.kind), GroundedSimulator(scenario, first)
        total = optimizer.steps_taken + optimizer.generations * self.rollouts
        with console.progress(total, "learning in simulation") as progress:
            bold = self.initial is None
            steps = optimizer.learn(simulator, self.policy, first, seed, bold=bold, advance=progress.advance)
            for index, parameters in enumerate(keep_apart(steps)):
                done = self._evaluate(scenario, [parameters], index, progress)
                value = done.values[0]
                note_step("learner", index + 1, value=value, falls=done.falls[0])
                yield Winner(self._record(index, parameters, value), done)

    def _count_episodes(self, winners: Sequence[Winner]) -> list[tuple[str, str]]:
        """Return what was played in simulation, in words."""
        done = [winner.generation for winner in winners]
        played = sum(sum(step.played) if step.played else len(step.values) * self.rollouts for step in done)
        taken = self.optimizer.steps_taken if isinstance(self.optimizer, Learner) else 0
        return [
            ("steps of learning in simulation", f"{taken:,}" if taken else ""),
            ("episodes in simulation", f"{played:,}, {self.rollouts} of a candidate at most"),
        ]

    def _screen(
        self, bare: Scenario, checked: Mapping[str, Any], winners: list[Winner], console: Console
    ) -> tuple[list[Winner], Mapping[str, Any]]:
        """Return the winners that do not fall in the grounded simulator, and what to report of all."""
        if not (self.screening and foretells_falls(self.grounding)):
            return winners, {}
        scenario = replace(bare, grounding=without_margins(self.grounding)).prepare(checked)
        parameters = {winner.policy.name: vector(self.policy, winner.policy) for winner in winners}
        seed = derive_seed(self.seed, self.kind)
        results = screen(scenario, parameters, self.screening, seed, workers=self.workers, console=console)
        kept = passing(results)
        if len(kept) < len(winners):
            dropped = f"{len(winners) - len(kept)} of {len(winners)} winners fall in the grounded simulator"
            console.status(f"{dropped} ({self.screening} episodes each): the robot does not try them")
        falls = {name: result._asdict() for name, result in results.items()}
        return [winner for winner in winners if winner.policy.name in kept], {"screened": falls}

    def _drift(self, scenario: Scenario, thetas: Iterable[PolicyRecord], console: Console) -> Mapping[str, Any]:
        """Return and tell how far the policies have moved from what a learned grounding has seen."""
        inner = innermost(self.grounding)
        if not (isinstance(inner, ActionTransformation) and isinstance(scenario.grounding, LoadedTransformation)):
            return {}
        region = read_region(model_file(inner.forward_model, "forward_model").parent)
        shares = drifts(scenario, region, {theta.name: vector(self.policy, theta) for theta in thetas}, self.seed)
        first, *_, last = shares.items()
        message = f"{last[0]} spends {100 * last[1]:.0f} % of its time where the grounding has seen nothing"
        console.status(f"{message} ({first[0]}: {100 * first[1]:.0f} %)")
        return {"drift": shares}

    def _evaluate(
        self,
        scenario: Scenario,
        candidates: Sequence[np.ndarray],
        index: int,
        progress: Progress,
        error: float = 0.0,
    ) -> Generation:
        rng = np.random.default_rng(derive_seed(self.seed, self.kind, "race", index))
        race = Race(len(candidates), self.rollouts, error, self._judge, rng)
        falls = np.zeros(len(candidates), dtype=int)
        while pairs := race.pairs():
            seeds = [
                take_turns(scenario.world, derive_seed(self.seed, self.kind, index, n, rollout), index + rollout)
                for n, rollout in pairs
            ]
            jobs = [Job(candidates[n], seed) for (n, _), seed in zip(pairs, seeds, strict=True)]
            done = episodes(scenario, jobs, workers=self.workers, progress=progress)
            np.add.at(falls, [n for n, _ in pairs], [episode.fell for episode in done])
            race.take([episode.value for episode in done])
        progress.advance(race.values.size - int(race.counts.sum()))
        rows = zip(race.values, race.counts, strict=True)
        means = [float(row[:count].mean()) for row, count in rows] if self.objective == CVAR else None
        played = race.counts.tolist() if error else None
        return Generation(index, race.worths.tolist(), falls.tolist(), means, played)

    def _judge(self, values: np.ndarray) -> np.ndarray:
        return objective_values(values, self.objective, self.quantile)

    def _record(self, index: int, parameters: np.ndarray, value: float) -> PolicyRecord:
        return record(self.policy, f"generation_{index + 1:02d}", parameters, generation=index + 1, value_sim=value)
