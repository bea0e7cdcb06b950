"""The paper's figures 12 and 13, and GARAT's suite: real worlds that are noisy or heavier."""

from __future__ import annotations

import json
import pickle
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np

from gsl.console import Console
from gsl.core.layout import check_alike
from gsl.core.setting import component, setting
from gsl.core.statistics import mean_interval
from gsl.errors import ConfigError
from gsl.grounding.ane import ActionNoise
from gsl.grounding.effects import innermost
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.grounding import Grounding
from gsl.grounding.none import NoGrounding
from gsl.optimizers.cma_es import CmaEs
from gsl.optimizers.trpo import Trpo
from gsl.policies.policy import sized
from gsl.report.markdown import table as markdown
from gsl.report.noise_bars import Bars, noise_bars
from gsl.stages.chain import Chain
from gsl.stages.evaluate import TABLE as EVALUATION
from gsl.stages.headline import several
from gsl.stages.iterate import Iterate, check_aggregate
from gsl.stages.ledger import Known, Ledger, known_parent, recipe
from gsl.stages.optimize import BEST
from gsl.stages.population import Workers, arriving
from gsl.tasks.task import REAL, SIM
from gsl.worlds.gymnasium import GymnasiumWorld, try_out
from gsl.worlds.world import World

TABLE, DATA, FIGURE = "table.md", "points.json", "figure.png"
REFERENCE, BOTH = "trained on real", {"gat", "sgat"}


class Round(NamedTuple):
    """What a round of a method came to; attributes as those of `Point`."""

    round: int
    value: float
    real_steps: int | None
    choice_steps: int
    promised: float | None


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
    def place(self) -> Place:
        """Where it was measured."""
        return Place(self.world, self.noise, self.round)


@component
class NoiseStudy:
    """Every trial begins with a policy from the plain simulator, and goes on from it with each method.

    The same effort for each; without grounding and with action noise the first search is the same for all real worlds.
    The reference learns in the real world itself. A further round goes on from the policy that the real world chose.
    """

    kind: ClassVar[str] = "reproduce"

    iterate: Annotated[Iterate, setting("what a trial is; its real world and grounding are replaced")]
    worlds: Annotated[Mapping[str, GymnasiumWorld], setting("the real worlds, by name; their noise is replaced")]
    noises: Annotated[tuple[float, ...], setting("standard deviations of the real worlds' noise", min_length=1)]
    methods: Annotated[Mapping[str, Grounding | ActionTransformation], setting("the groundings, by name")]
    further: Annotated[CmaEs | Trpo, setting("how it goes on from π0")]
    trials: Annotated[int, setting("trials of each method", ge=1)]
    sims: Annotated[Mapping[str, GymnasiumWorld], setting("simulators of worlds that have one of their own")] = field(
        default_factory=dict
    )
    choice: Annotated[Literal["sim", "real"], setting("where the best of a search's generations is chosen")] = "sim"
    workers: Workers = -1
    known: Known = None

    def __post_init__(self) -> None:
        """Refuse what only several rounds know, and rounds that go on from what nothing real has chosen."""
        check_aggregate(self.iterate, self.methods.values(), "iterate.aggregate")
        if self.iterate.iterations > 1 and self.choice == SIM:
            given = str(self.iterate.iterations)
            raise ConfigError("iterate.iterations", "several need choice=real, to go on from", given=given)

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here, but for what is known."""
        return known_parent("known", self.known, DATA)

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        """Run all trials; write the points, the table and the figure."""
        for name, world in self.worlds.items():
            check_alike(self.sims.get(name, self.iterate.sim).layout, world.layout)
        for grounding in self.methods.values():
            self.iterate.chain.check(grounding)
        named = {f"{group}.{name}": one for group in ("worlds", "sims") for name, one in getattr(self, group).items()}
        try_out({"iterate.sim": self.iterate.sim, **named})
        home = folder.parent
        ledger = Ledger(home / DATA, self.parents(), Point._fields, console)
        keys = {number: recipe(replace(self, trials=1, known=None), number) for number in range(1, self.trials + 1)}
        known = {number for number, key in keys.items() if ledger.take(key)}
        jobs = [(number, home) for number in keys if number not in known]
        with console.progress(len(jobs), "trials") as progress:
            for index, found in arriving(_trial, self, jobs, self.workers, progress):
                ledger.add(keys[jobs[index][0]], [one._asdict() for one in found])
        made = ledger.close(folder / DATA)
        points = [Point(**row) for row in ledger.figures]
        (folder / TABLE).write_text(f"{self._table(points)}\n{made}\n", encoding="utf-8")
        self._draw(folder / FIGURE, points)
        return {"points": len(points)}

    def _draw(self, path: Path, points: Sequence[Point]) -> None:
        """Draw the returns against the noise, or against the rounds if there are several of these and one noise."""
        environments = {world.env_id for world in self.worlds.values()}
        alike = len(environments) == 1
        of = f"{min(environments)}, " if alike else ""
        last = self._rounds[-1]
        if by_round := len(self.noises) == 1 and last > 1:
            ticks, along = [f"{one}" for one in self._rounds], "rounds"
        else:
            ticks = [f"{noise:g}" for noise in self.noises] if any(self.noises) else ["no noise"]
            along = "sd of action noise in real [half ranges]" if any(self.noises) else ""
        panels = {}
        for world in self.worlds:
            where = [Place(*one) for one in product([world], self.noises, self._rounds if by_round else [last])]
            means = {name: [_mean(_values(points, at, method)) for at in where] for method, name in self._shown.items()}
            panels[f"{of}{world.replace('_', ' ')}"] = Bars(ticks, means)
        hatched = "without real data" if self.choice == SIM else "no model of real"
        title = f"Return in real, mean ± standard error ({several(self.trials, 'trial')}); hatched: {hatched}"
        noise_bars(path, panels, REFERENCE, title=title, along=along, alike=alike)

    @property
    def _shown(self) -> dict[str, str]:
        """Names of all methods for people."""
        told = {
            method: f"ane {grounding.sd:g}" if isinstance(grounding, ActionNoise) else method
            for method, grounding in self.methods.items()
        }
        return {**told, REFERENCE: REFERENCE}

    @property
    def _rounds(self) -> range:
        return range(1, self.iterate.iterations + 1)

    @property
    def _places(self) -> list[Place]:
        return [Place(*one) for one in product(self.worlds, self.noises, self._rounds)]

    def trial(self, number: int, home: Path) -> list[Point]:
        """Return all points of a trial, built below `home`."""
        seed, console = self.iterate.seed + number - 1, Console(json=True)
        name, points = f"trial_{number:02d}", []
        for world, noise in product(self.worlds, self.noises):
            real, sim = replace(self.worlds[world], action_noise=noise), self.sims.get(world)
            chain = self._chain(sim or self.iterate.sim)
            alone, below = home / (f"{world}_sim" if sim else "sim"), home / f"{world}_{noise:g}"
            start = chain.pretrained(alone / "pretrained" / name, seed, console)
            shared = {SIM: alone / "models" / name, REAL: below / "models" / name}
            at = replace(chain, real=real, optimizer=self.further, shared=shared)
            for method, grounding in self.methods.items():
                place = below / method / name
                first = place if _learned(grounding) else alone / method / name
                for one in self._carried_out(at, grounding, first, place, start, seed):
                    points.append(Point(world, noise, method, number, *one))
            place = below / "real" / name
            for one in self._carried_out(replace(at, sim=real), NoGrounding(), place, place, start, seed):
                spent = one.round * self.further.taken if isinstance(self.further, Trpo) else None
                points.append(Point(world, noise, REFERENCE, number, *one._replace(real_steps=spent)))
        return points

    def _carried_out(
        self,
        chain: Chain,
        grounding: Grounding | ActionTransformation,
        first: Path,
        place: Path,
        start: str,
        seed: int,
    ) -> Iterator[Round]:
        """Yield the rounds of a method, built at `place`, but the first search at `first`, which worlds may share."""
        home, console, spent, choice, promised = place, Console(json=True), 0, 0, None
        for number in self._rounds:
            if number > 1:
                first = place = home / f"iteration_{number:02d}"
            ready = chain.ready(first, grounding, start, seed, console)
            found = chain.search(first / "optimize", ready, start, seed, console)
            spent += _steps(chain.shared.get(REAL, first)) if _learned(grounding) else 0
            if self.choice == SIM:
                measured = chain.measure(place / "evaluate", found, seed, console, only=BEST)
                value, promised = measured.metrics["last"]["value"], found.metrics["best_value_sim"]
            else:
                measured = chain.measure(place / "evaluate", found, seed, console)
                value, choice = measured.metrics["returned"]["value"], choice + _choice_steps(measured.folder)
                promised = measured.metrics["returned_value_sim"] if measured.metrics["best_generation"] else promised
            yield Round(number, float(value), spent, choice, promised)
            start, chain, seed = str(measured.folder), replace(chain.after(first), shared={}), seed + 1000

    @property
    def _reference(self) -> str:
        """How much of the real world the reference learned from, in a round."""
        if isinstance(self.further, Trpo):
            return f"{self.further.taken:,} steps"
        return f"{self.further.generations * self.further.candidates * self.iterate.budget.rollouts:,} episodes"

    @property
    def _chosen(self) -> list[str]:
        """What a choice in the real world took."""
        if self.choice == SIM:
            return []
        budget = self.iterate.budget
        each = several(budget.episodes, "real episode")
        return [
            f"In each round the real world chose the best of {self.further.generations + 1} policies, those of the",
            f"generations and the one it began with, by {each} each; values are of {budget.confirmation} others.",
        ]

    def _chain(self, sim: World) -> Chain:
        """Return the links in a simulator, for whose sizes the policy is made anew."""
        policy = sized(self.iterate.policy, sim)
        return replace(self.iterate.chain, sim=sim, policy=policy, workers=1, accept=True)

    def _titled(self, *titles: str) -> list[str]:
        return ["real world", "noise", *(["round"] if len(self._rounds) > 1 else []), *titles]

    def _row(self, place: Place, *cells: str) -> list[str]:
        return [place.world, f"{place.noise:g}", *([str(place.round)] if len(self._rounds) > 1 else []), *cells]

    def _table(self, points: Sequence[Point]) -> str:
        rows = []
        for place in self._places:
            values = {method: _values(points, place, method) for method in self._shown}
            means = [_mean(found) for found in values.values()]
            known = values.keys() >= BOTH and self.trials > 1
            apart = _difference(values["sgat"], values["gat"]) if known else "-"
            told = (f"{mean:.0f}" + f" ± {error:.0f}" * (self.trials > 1) for mean, error in means)
            here = [one for one in points if one.place == place]
            spent = [_spent(one.real_steps for one in here if one.method != REFERENCE)]
            spent += [_spent(one.choice_steps for one in here)] if self.choice == REAL else []
            rows.append(self._row(place, *told, apart, *spent))
        each = " in each round" if len(self._rounds) > 1 else ""
        below = [
            f"Mean ± standard error over {several(self.trials, 'trial')}; real steps are the median and range of",
            f"what learned groundings saw; the reference learned from {self._reference}{each}.",
            *self._chosen,
        ]
        titles = self._titled(*self._shown.values(), "sgat - gat (95 %)", "real steps")
        titles += ["real steps of the choice"] if self.choice == REAL else []
        return "\n".join([markdown(titles, rows), *below, "", *self._differences(points), *self._promises(points)])

    def _promises(self, points: Sequence[Point]) -> list[str]:
        """Return the lines of a table of what policies were worth where they were learned, and in real."""
        rows = [
            self._row(place, *(_kept(_at(points, place, method)) for method in self.methods)) for place in self._places
        ]
        shown = [name for method, name in self._shown.items() if method != REFERENCE]
        start = "" if self.choice == SIM else " In brackets trials that are where they began."
        below = f"Mean return where a policy was learned, of a few episodes, and in real.{start}"
        return [markdown(self._titled(*shown), rows), below, ""]

    def _differences(self, points: Sequence[Point]) -> list[str]:
        """Return the lines of a table of what learned groundings are above methods that know nothing, by trial."""
        learned = [name for name, one in self.methods.items() if _learned(one)]
        noisy = [name for name, one in self.methods.items() if isinstance(one, ActionNoise)]
        if self.trials < 2 or not learned:
            return []
        rows = []
        for place in self._places:
            values = {method: _values(points, place, method) for method in self.methods}
            best = max(noisy, key=lambda name: np.mean(values[name]), default=None)
            others = [name for name in ("none", best) if name in values]
            told = [_difference(values[name], values[other]) for other in others for name in learned]
            rows.append(self._row(place, *told, *([self._shown[best]] if best else [])))
        others = [*(["none"] if "none" in self.methods else []), *(["best ane"] if noisy else [])]
        titles = [f"{name} - {other}" for other in others for name in learned]
        below = "Paired differences with 95 % intervals, which know nothing of the choice of the best width."
        return [markdown(self._titled(*titles, *(["best ane"] if noisy else [])), rows), below, ""]


def _learned(grounding: Grounding | ActionTransformation) -> bool:
    return isinstance(innermost(grounding), ActionTransformation)


def _at(points: Sequence[Point], place: Place, method: str) -> list[Point]:
    return [one for one in points if (one.place, one.method) == (place, method)]


def _values(points: Sequence[Point], place: Place, method: str) -> list[float]:
    return [one.value for one in _at(points, place, method)]


def _difference(values: Sequence[float], others: Sequence[float]) -> str:
    """Return the mean of paired differences with its interval, of values that are all the same none."""
    differences = np.subtract(values, others)
    if not differences.any():
        return "-"
    found = mean_interval(differences)
    return f"{found.mean:+.0f} ({found.lower:+.0f} to {found.upper:+.0f})"


def _kept(trials: Sequence[Point]) -> str:
    """Return what policies promised and what the real world gave, and how many were what all began with."""
    promised = [one.promised for one in trials if one.promised is not None]
    value, start = np.mean([one.value for one in trials]), len(trials) - len(promised)
    return (f"{np.mean(promised):.0f} -> " if promised else "") + f"{value:.0f}" + (f" ({start})" if start else "")


def _spent(steps: Iterable[int | None]) -> str:
    counted = [one for one in steps if one]
    return f"{np.median(counted):,.0f} ({min(counted):,} to {max(counted):,})" if counted else "-"


def _mean(values: Sequence[float]) -> tuple[float, float]:
    """Return mean and standard error, 0 of a single value."""
    error = np.std(values, ddof=1) / np.sqrt(len(values)) if len(values) > 1 else 0.0
    return float(np.mean(values)), float(error)


def _steps(place: Path) -> int:
    return int(json.loads((place / "collect_real" / "metrics.json").read_text(encoding="utf-8"))["steps"])


def _choice_steps(evaluation: Path) -> int:
    told = json.loads((evaluation / EVALUATION).read_text(encoding="utf-8"))
    return round(sum(one["episodes"] * one["outcome"]["steps"] for one in [*told["policies"], *told["check"]]))


def _trial(frozen: bytes, job: tuple[int, Path]) -> list[Point]:
    study: NoiseStudy = pickle.loads(frozen)  # noqa: S301  our own bytes, from the parent process
    return study.trial(*job)
