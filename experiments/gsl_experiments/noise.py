"""The paper's figures 12 and 13, and GARAT's suite: real worlds that are noisy or heavier."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from gsl.core.console import Console
from gsl.core.interfaces import REAL, SIM, Grounding, Search, World
from gsl.core.layout import check_alike
from gsl.core.seeds import seed_of_round
from gsl.core.setting import component, setting
from gsl.core.words import several
from gsl.errors import ConfigError
from gsl.grounding.ane import ActionNoise
from gsl.grounding.effects import evidence_of, is_learned
from gsl.grounding.none import NoGrounding
from gsl.optimizers.trpo import Trpo
from gsl.policies.policy import size
from gsl.report.study_page import write_study_page
from gsl.report.style import save
from gsl.rollout.parallel import Workers
from gsl.stages.chain_rounds import Chain
from gsl.stages.iterate import Iterate, check_aggregate, check_trainable
from gsl.stages.optimize import BEST
from gsl.storage.policy_choice import EVALUATION
from gsl.worlds.gymnasium import GymnasiumWorld, try_out
from gsl_experiments.effort import seconds_of_rounds
from gsl_experiments.ledger import GOES_ON, Known, Ledger, list_earlier, recipe
from gsl_experiments.noise_bars import Bars, noise_bars_figure
from gsl_experiments.noise_table import REFERENCE, NoiseTable, Place, Point
from gsl_experiments.sizes import First, PresetName, check_rising, numbers, sizes_of, trials_of
from gsl_experiments.tasks import side_by_side

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE, DATA, FIGURE = "table.md", "points.json", "figure.png"


@component
class NoiseStudy:
    """Every trial begins with a policy from the plain simulator, and goes on from it with each method.

    The same effort for each; without grounding and with action noise the first search is the same for all real worlds.
    The reference learns in the real world itself. A further round goes on from the policy that the real world chose.
    """

    kind: ClassVar[str] = "reproduce"
    forced: ClassVar[str] = GOES_ON
    makes: ClassVar[tuple[str, ...]] = ("methods", "iterate.grounding")

    iterate: Annotated[Iterate, setting("what a trial is; its real world and grounding are replaced")]
    worlds: Annotated[
        Mapping[str, GymnasiumWorld], setting("the real worlds, by name; their noise is replaced", min_length=1)
    ]
    noises: Annotated[
        tuple[Annotated[float, setting("", ge=0)], ...],
        setting("standard deviations of the real worlds' noise", min_length=1),
    ]
    methods: Annotated[Mapping[str, Grounding], setting("the groundings, by name", min_length=1)]
    further: Annotated[Search | Trpo, setting("how it goes on from π0")]
    trials: Annotated[int, setting("trials of each method", ge=1)]
    sims: Annotated[Mapping[str, GymnasiumWorld], setting("simulators of worlds that have one of their own")] = field(
        default_factory=dict
    )
    choice: Annotated[Literal["sim", "real"], setting("where the best of a search's generations is chosen")] = "sim"
    workers: Workers = -1
    known: Known = None
    preset_name: PresetName = ""
    first: First = 1

    def __post_init__(self) -> None:
        """Refuse what only several rounds know, and rounds that go on from what nothing real has chosen."""
        check_rising("noises", self.noises)
        check_aggregate(self.iterate, self.methods.values(), "iterate.aggregate")
        if self.iterate.iterations > 1 and self.choice == SIM:
            rounds = str(self.iterate.iterations)
            raise ConfigError("iterate.iterations", "several need choice=real, to go on from", given=rounds)

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here, but for what is known."""
        return list_earlier(self.known, DATA)

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Run all trials; write the points, the table and the figure."""
        for name, world in self.worlds.items():
            check_alike(self.sims.get(name, self.iterate.sim).layout, world.layout)
        for name, grounding in self.methods.items():
            check_trainable(self.iterate, f"methods.{name}", grounding)
        named = {
            f"{group}.{name}": world for group in ("worlds", "sims") for name, world in getattr(self, group).items()
        }
        try_out({"iterate.sim": self.iterate.sim, **named})
        home = folder.parent
        ledger = Ledger(home / DATA, self.parents(), Point, console)
        keys = self.recipes
        names = {key: f"trial {number}" for number, key in keys.items()}
        duration = ledger.announce(names, lambda: seconds_of_rounds(self))
        ledger.judge({key: {"trial": number} for number, key in keys.items()})
        missing = {number: [number] for number, key in keys.items() if not ledger.take(key)}
        for number, points in side_by_side(self, folder, missing, self.workers, console, duration):
            ledger.add(keys[number], [point._asdict() for point in points])
        points = [Point(**row) for row in ledger.figures]
        self.tell(folder, points, ledger.close(folder / DATA))
        return {"points": len(points)}

    @property
    def recipes(self) -> dict[int, str]:
        """By number: a trial needs all settings but which trials there are."""
        what = (self.iterate, self.worlds, self.noises, self.methods, self.further, self.sims, self.choice)
        return {number: recipe(*what, number) for number in numbers(self.first, self.trials)}

    def tell(self, folder: Path, points: Sequence[Point], made: str) -> None:
        """Write the table and the figure of all points; `made` says who made them."""
        table = NoiseTable(
            points,
            places=[Place(*cell) for cell in product(self.worlds, self.noises, self._rounds)],
            shown=self._shown,
            learned=[name for name, grounding in self.methods.items() if is_learned(grounding)],
            noisy=[name for name, grounding in self.methods.items() if isinstance(grounding, ActionNoise)],
            trials=self.trials,
            chosen=self.choice == REAL,
        )
        (folder / TABLE).write_text(
            f"{table.render(*self._below)}\n{sizes_of(self.preset_name)} {made}\n", encoding="utf-8"
        )
        write_study_page(folder, table.answer, [TABLE], [self._draw(folder / FIGURE, table)])

    def _draw(self, path: Path, table: NoiseTable) -> Figure:
        """Draw the returns against the noise, or against the rounds if there are several of these and one noise."""
        environments = {world.env_id for world in self.worlds.values()}
        alike = len(environments) == 1
        of = f"{min(environments)}, " if alike else ""
        last = self._rounds[-1]
        if by_round := len(self.noises) == 1 and last > 1:
            ticks, along = [f"{number}" for number in self._rounds], "rounds"
        else:
            ticks = [f"{noise:g}" for noise in self.noises] if any(self.noises) else ["no noise"]
            along = "sd of action noise on the real side [half ranges]" if any(self.noises) else ""
        panels = {}
        for world in self.worlds:
            where = [Place(*cell) for cell in product([world], self.noises, self._rounds if by_round else [last])]
            panels[f"{of}{world.replace('_', ' ')}"] = Bars(ticks, table.means(where))
        hatched = "without real data" if self.choice == SIM else "no model of real"
        title = (
            f"Return on the real side, mean ± standard error ({trials_of(self.first, self.trials)}); hatched: {hatched}"
        )
        return save(noise_bars_figure(panels, REFERENCE, title=title, along=along, alike=alike), path)

    @property
    def _shown(self) -> dict[str, str]:
        """Names of all methods for people."""
        names = {
            method: f"ane {grounding.sd:g}" if isinstance(grounding, ActionNoise) else method
            for method, grounding in self.methods.items()
        }
        return {**names, REFERENCE: REFERENCE}

    @property
    def _rounds(self) -> range:
        return range(1, self.iterate.iterations + 1)

    def results(self, home: Path, number: int, console: Console) -> list[Point]:
        """Return all points of a trial."""
        seed = self.iterate.seed + number - 1
        name, points = f"trial_{number:02d}", list[Point]()
        for world, noise in product(self.worlds, self.noises):
            real, sim = replace(self.worlds[world], action_noise=noise), self.sims.get(world)
            chain = self._chain(sim or self.iterate.sim)
            alone, below = home / (f"{world}_sim" if sim else "sim"), home / f"{world}_{noise:g}"
            start = chain.pretrain(alone / "pretrained" / name, seed, console)
            shared = {SIM: alone / "models" / name, REAL: below / "models" / name}
            at = replace(chain, real=real, optimizer=self.further, shared=shared)
            for method, grounding in self.methods.items():
                place = below / method / name
                first = place if is_learned(grounding) else alone / method / name
                of = partial(Point, world, noise, method, number)
                points += self._play_rounds(of, at, grounding, first, place, start, seed, console)
            of, place = partial(Point, world, noise, REFERENCE, number), below / "real" / name
            for point in self._play_rounds(
                of, replace(at, sim=real), NoGrounding(), place, place, start, seed, console
            ):
                spent = point.round * self.further.steps_taken if isinstance(self.further, Trpo) else None
                points.append(point._replace(real_steps=spent))
        return points

    def _play_rounds(
        self,
        of: Callable[..., Point],
        chain: Chain,
        grounding: Grounding,
        first: Path,
        place: Path,
        start: str,
        seed: int,
        console: Console,
    ) -> Iterator[Point]:
        """Yield the rounds of a method, built at `place`, but the first search at `first`, which worlds may share."""
        home, spent, choice, promised = place, 0, 0, None
        for number in self._rounds:
            if number > 1:
                first = place = home / f"iteration_{number:02d}"
            at, only = seed_of_round(seed, number), BEST if self.choice == SIM else ""
            _, search, measured = chain.round(place, grounding, start, at, console, search=first, only=only)
            spent += _steps(chain.shared.get(REAL, place)) if REAL in evidence_of(grounding) else 0
            metrics = measured.metrics
            if self.choice == SIM:
                value, promised = metrics["last"]["value"], search.metrics["best_value_sim"]
            else:
                value, choice = metrics["returned"]["value"], choice + _choice_steps(measured.folder)
                promised = metrics["returned_value_sim"] if metrics["best_generation"] else promised
            yield of(number, float(value), spent, choice, promised)
            start, chain = str(measured.folder), replace(chain.after(place), shared={})

    @property
    def _reference(self) -> str:
        """How much of the real world the reference learned from, in a round."""
        if isinstance(self.further, Trpo):
            return f"{self.further.steps_taken:,} steps"
        return f"{self.further.generations * self.further.candidates * self.iterate.budget.rollouts:,} episodes"

    @property
    def _below(self) -> list[str]:
        """What the table says below."""
        each = " in each round" if len(self._rounds) > 1 else ""
        below = [
            f"Mean ± standard error over {trials_of(self.first, self.trials)}; real steps are the median and range of",
            f"what learned groundings saw; the reference learned from {self._reference}{each}.",
        ]
        if self.choice == SIM:
            return below
        policies, budget = self.further.generations + 1, self.iterate.budget
        chosen = several(budget.episodes, "real episode")
        return [
            *below,
            f"In each round the real world chose the best of {policies} policies, by {chosen} each.",
            "They are those of the generations and the one it began with.",
            f"Values are of {budget.confirmation} other episodes.",
        ]

    def _chain(self, sim: World) -> Chain:
        """Return the links in a simulator, for whose sizes the policy is made anew."""
        policy = size(self.iterate.policy, sim)
        return replace(self.iterate.chain, sim=sim, policy=policy, workers=1, accept=True)


def _steps(place: Path) -> int:
    return int(json.loads((place / "collect_real" / "metrics.json").read_text(encoding="utf-8"))["steps"])


def _choice_steps(evaluation: Path) -> int:
    document = json.loads((evaluation / EVALUATION).read_text(encoding="utf-8"))
    return round(
        sum(policy["episodes"] * policy["outcome"]["steps"] for policy in [*document["policies"], *document["check"]])
    )
