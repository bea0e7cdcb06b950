"""The paper's figures 12 and 13, and GARAT's suite: real worlds that are noisy or heavier."""

from __future__ import annotations

import json
import pickle
from collections.abc import Mapping, Sequence
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
from gsl.stages.headline import several
from gsl.stages.iterate import Iterate
from gsl.stages.ledger import Known, Ledger, known_parent, recipe
from gsl.stages.optimize import BEST
from gsl.stages.population import Workers, arriving
from gsl.tasks.task import REAL, SIM
from gsl.worlds.gymnasium import GymnasiumWorld, try_out
from gsl.worlds.world import World

TABLE, DATA, FIGURE = "table.md", "points.json", "figure.png"
REFERENCE, BOTH = "trained on real", {"gat", "sgat"}


class Point(NamedTuple):
    """One method, once, in one real world.

    Attributes:
        value: Mean return of its policy in the real world.
        real_steps: In the real world, that it learned from; None of a search there, whose steps nobody counts.
        promised: Best mean return where its policy was learned; None of trials that were made before this was kept.
    """

    world: str
    noise: float
    method: str
    trial: int
    value: float
    real_steps: int | None
    promised: float | None


@component
class NoiseStudy:
    """Every trial begins with a policy from the plain simulator, and goes on from it with each method.

    The same effort for each; without grounding and with action noise it is the same search for all real worlds. The
    reference learns in the real world itself. Where the real world chooses, a further round goes on from its choice.
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
        """Refuse what only several iterations know, and those of what nothing real has chosen."""
        rounds = self.iterate.iterations
        if self.iterate.aggregate and rounds == 1:
            raise ConfigError("iterate.aggregate", "is for several iterations; a trial here has one", given="true")
        if rounds > 1 and self.choice == SIM:
            raise ConfigError("iterate.iterations", "several need choice=real, to go on from", given=str(rounds))

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
        environments = {world.env_id for world in self.worlds.values()}
        alike = len(environments) == 1
        of = f"{min(environments)}, " if alike else ""
        panels = {
            f"{of}{world.replace('_', ' ')}": Bars(
                self.noises, {name: self._means(points, world, method) for method, name in self._shown.items()}
            )
            for world in self.worlds
        }
        title = f"Return in real, mean ± standard error ({several(self.trials, 'trial')}); hatched: without real data"
        noise_bars(folder / FIGURE, panels, REFERENCE, title=title, alike=alike)
        return {"points": len(points)}

    @property
    def _shown(self) -> dict[str, str]:
        """Names of all methods for people."""
        told = {
            method: f"ane {grounding.sd:g}" if isinstance(grounding, ActionNoise) else method
            for method, grounding in self.methods.items()
        }
        return {**told, REFERENCE: REFERENCE}

    @property
    def _places(self) -> list[tuple[str, float]]:
        return list(product(self.worlds, self.noises))

    def trial(self, number: int, home: Path) -> list[Point]:
        """Return all points of a trial, built below `home`."""
        seed, console = self.iterate.seed + number - 1, Console(json=True)
        name, points = f"trial_{number:02d}", []
        for world, noise in self._places:
            real, sim = replace(self.worlds[world], action_noise=noise), self.sims.get(world)
            chain = self._chain(sim or self.iterate.sim)
            alone, below = home / (f"{world}_sim" if sim else "sim"), home / f"{world}_{noise:g}"
            start = chain.pretrained(alone / "pretrained" / name, seed, console)
            shared = {SIM: alone / "models" / name, REAL: below / "models" / name}
            at = replace(chain, real=real, optimizer=self.further, shared=shared)
            for method, grounding in self.methods.items():
                learned = isinstance(innermost(grounding), ActionTransformation)
                place = (below if learned else alone) / method / name
                one = self._rounds(at, place, below / method / name, grounding, start, seed, console)
                points.append(Point(world, noise, method, number, *one))
            place = below / "real" / name
            one = self._rounds(replace(at, sim=real), place, place, NoGrounding(), start, seed, console)
            points.append(Point(world, noise, REFERENCE, number, *one)._replace(real_steps=self._taken))
        return points

    def _rounds(
        self,
        chain: Chain,
        first: Path,
        place: Path,
        grounding: Grounding | ActionTransformation,
        start: str,
        seed: int,
        console: Any,
    ) -> tuple[float, int, float]:
        """Return the value of a method's policy, the real steps that it learned from, and what was promised.

        The first search is built below `first`, which may serve several real worlds; all else below `place`.
        """
        only, chosen = (BEST, "last") if self.choice == SIM else ("", "returned")
        learned, spent = isinstance(innermost(grounding), ActionTransformation), 0
        home, out = first, place
        for number in range(1, self.iterate.iterations + 1):
            if number > 1:
                home = out = place / f"iteration_{number:02d}"
            ready = chain.ready(home, grounding, start, seed, console)
            found = chain.search(home / "optimize", ready, start, seed, console)
            measured = chain.measure(out / "evaluate", found, seed, console, only=only)
            spent += _steps(chain.shared.get(REAL, home)) if learned else 0
            start, chain, seed = str(measured.folder), replace(chain.after(home), shared={}), seed + 1000
        value = measured.metrics[chosen]["value"]
        return float(value), spent, found.metrics["best_value_sim"]

    @property
    def _taken(self) -> int | None:
        """Real steps of the reference; None of a search there, whose steps nobody counts."""
        return self.iterate.iterations * self.further.taken if isinstance(self.further, Trpo) else None

    @property
    def _reference(self) -> str:
        """How much of the real world the reference learned from."""
        if isinstance(self.further, Trpo):
            return f"{self._taken:,} steps"
        each = self.further.generations * self.further.candidates * self.iterate.budget.rollouts
        return f"{self.iterate.iterations * each:,} episodes"

    @property
    def _chosen(self) -> list[str]:
        """What a choice in the real world took."""
        if self.choice == SIM:
            return []
        budget, rounds = self.iterate.budget, self.iterate.iterations
        each = several(budget.episodes, "real episode")
        return [
            f"{several(rounds, 'round')}; in each the best of {self.further.generations + 1} policies, the",
            f"generations and what they began with, was chosen on {each} each, the reference's too;",
            f"values are of {budget.confirmation} others.",
        ]

    def _chain(self, sim: World) -> Chain:
        """Return the links in a simulator, for whose sizes the policy is made anew."""
        policy = sized(self.iterate.policy, sim)
        return replace(self.iterate.chain, sim=sim, policy=policy, workers=1, accept=True)

    def _values(
        self, points: Sequence[Point], world: str, noise: float, method: str, figure: str = "value"
    ) -> list[float]:
        return [getattr(one, figure) for one in points if one[:3] == (world, noise, method)]

    def _means(self, points: Sequence[Point], world: str, method: str) -> list[tuple[float, float]]:
        """Return mean and standard error at each noise."""
        return [_mean(self._values(points, world, noise, method)) for noise in self.noises]

    def _table(self, points: Sequence[Point]) -> str:
        rows = []
        for world, noise in self._places:
            values = {method: self._values(points, world, noise, method) for method in self._shown}
            means = [_mean(found) for found in values.values()]
            known = values.keys() >= BOTH and self.trials > 1
            apart = mean_interval(np.subtract(values["sgat"], values["gat"])) if known else None
            between = f"{apart.mean:+.0f} ({apart.lower:+.0f} to {apart.upper:+.0f})" if apart else "-"
            spent = self._spent(points, world, noise)
            told = (f"{mean:.0f}" + f" ± {error:.0f}" * (self.trials > 1) for mean, error in means)
            rows.append((world, f"{noise:g}", *told, between, spent))
        below = [
            f"Mean ± standard error over {several(self.trials, 'trial')}; real steps are the median and range of",
            f"what learned groundings saw; the reference learned from {self._reference}.",
            *self._chosen,
        ]
        titles = ("real world", "noise", *self._shown.values(), "sgat - gat (95 %)", "real steps")
        return "\n".join([markdown(titles, rows), *below, "", *self._differences(points), *self._promises(points)])

    def _promises(self, points: Sequence[Point]) -> list[str]:
        """Return the lines of a table of what policies were worth where they were learned, and in real."""
        if any(one.promised is None for one in points):
            return []
        rows = []
        for world, noise in self._places:
            each = [
                [np.mean(self._values(points, world, noise, method, figure)) for figure in ("promised", "value")]
                for method in self.methods
            ]
            rows.append((world, f"{noise:g}", *(f"{promised:.0f} -> {value:.0f}" for promised, value in each)))
        shown = [name for method, name in self._shown.items() if method != REFERENCE]
        best = "" if self.choice == SIM else "the best "
        below = f"Mean return {best}where a policy was learned, of a few episodes, and in real."
        return [markdown(("real world", "noise", *shown), rows), below, ""]

    def _differences(self, points: Sequence[Point]) -> list[str]:
        """Return the lines of a table of what learned groundings are above methods that know nothing, by trial."""
        learned = [name for name, one in self.methods.items() if isinstance(innermost(one), ActionTransformation)]
        noisy = [name for name, one in self.methods.items() if isinstance(one, ActionNoise)]
        if self.trials < 2 or not learned:
            return []
        rows = []
        for world, noise in self._places:
            values = {method: np.array(self._values(points, world, noise, method)) for method in self.methods}
            best = max(noisy, key=lambda name: values[name].mean(), default=None)
            others = [name for name in ("none", best) if name in values]
            found = (mean_interval(values[name] - values[other]) for other in others for name in learned)
            told = (f"{one.mean:+.0f} ({one.lower:+.0f} to {one.upper:+.0f})" for one in found)
            rows.append((world, f"{noise:g}", *told, *([self._shown[best]] if best else [])))
        others = [*(["none"] if "none" in self.methods else []), *(["best ane"] if noisy else [])]
        titles = [f"{name} - {other}" for other in others for name in learned]
        below = "Paired differences with 95 % intervals, which know nothing of the choice of the best width."
        return [markdown(("real world", "noise", *titles, *(["best ane"] if noisy else [])), rows), below, ""]

    def _spent(self, points: Sequence[Point], world: str, noise: float) -> str:
        steps = [one.real_steps for one in points if one[:2] == (world, noise) and one.method != REFERENCE]
        learned = [one for one in steps if one]
        return f"{np.median(learned):,.0f} ({min(learned):,} to {max(learned):,})" if learned else "-"


def _mean(values: Sequence[float]) -> tuple[float, float]:
    """Return mean and standard error, 0 of a single value."""
    error = np.std(values, ddof=1) / np.sqrt(len(values)) if len(values) > 1 else 0.0
    return float(np.mean(values)), float(error)


def _steps(place: Path) -> int:
    return int(json.loads((place / "collect_real" / "metrics.json").read_text(encoding="utf-8"))["steps"])


def _trial(frozen: bytes, job: tuple[int, Path]) -> list[Point]:
    study: NoiseStudy = pickle.loads(frozen)  # noqa: S301  our own bytes, from the parent process
    return study.trial(*job)
