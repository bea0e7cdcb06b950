"""Groundings against each other: paired trials of some iterations each, in several worlds (the paper's Table 2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar

from gsl.core.console import Console
from gsl.core.interfaces import REAL, SIM, Grounding, Search, World
from gsl.core.layout import check_alike
from gsl.core.seeds import seed_of_round
from gsl.core.setting import component, setting
from gsl.core.unit import Unit
from gsl.core.words import several
from gsl.core.workload import Part
from gsl.errors import ConfigError
from gsl.grounding.effects import DiagnosedEffects, evidence_of, is_learned
from gsl.report.run_page import Answer
from gsl.report.study_page import write_study_page
from gsl.stages.chain_rounds import Chain
from gsl.stages.diagnosis_plan import flown
from gsl.stages.effort import links
from gsl.stages.iterate import Iterate, check_aggregate, check_trainable
from gsl.stages.values import Values, rank
from gsl.storage.artifact import Artifact
from gsl.worlds.external import ExternalRobot
from gsl.worlds.gymnasium import try_out
from gsl_experiments import effort
from gsl_experiments.answer import answer_comparison
from gsl_experiments.comparison import Summary, summaries
from gsl_experiments.comparison_table import markdown
from gsl_experiments.ledger import GOES_ON, Known, Ledger, list_earlier, recipe
from gsl_experiments.paper_cells import worth
from gsl_experiments.sizes import First, PresetName, numbers, sizes_of, trials_of
from gsl_experiments.tasks import in_order
from gsl_experiments.trial import Cell, Trial
from gsl_experiments.trials_picture import trials_figure
from gsl_experiments.tried import foretelling, read_tried

TABLE, DATA = "table.md", "trials.json"


@component
class Compare:
    """Set groundings against each other over paired trials.

    Trial k of every method has the same seed; what is built is not built again, so a stopped study goes on.

    A grounding that its check would refuse is gone on with, and the table says how often that was.

    A search in a simulator that knows nothing of the real world (no grounding, noise, randomisation) is done once a
    trial and measured in every world: columns of such a method are not independent of each other. Methods with effects
    share the excitation of their trial and world, those that learn its first real episodes; each of them pays for it.

    A further iteration goes on from the policy that the one before returned, whether it gained or not.
    """

    kind: ClassVar[str] = "compare"
    forced: ClassVar[str] = GOES_ON
    makes: ClassVar[tuple[str, ...]] = ("methods", "iterate.grounding")

    iterate: Annotated[Iterate, setting("what a trial is; its worlds and grounding are replaced")]
    worlds: Annotated[Mapping[str, World], setting("the real worlds, by name", min_length=1)]
    methods: Annotated[Mapping[str, Grounding], setting("the groundings, by name", min_length=1)]
    trials: Annotated[int, setting("trials of each method", ge=1)]
    simulators: Annotated[
        Mapping[str, World] | None, setting("the simulators, by name; none for the one of iterate")
    ] = None
    rank: Annotated[bool, setting("set a fixed set of policies in simulation against real")] = False
    known: Known = None
    preset_name: PresetName = ""
    first: First = 1

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here, but for what is known."""
        return list_earlier(self.known, DATA)

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Run all trials; write every trial's figures and the tables."""
        searches = isinstance(self.iterate.optimizer, Search)
        trials, made = self.carry_out(folder, console, (lambda: effort.seconds(self)) if searches else None)
        summary = summaries(trials)
        text = "\n".join(filter(None, (markdown(summary, trials, Unit.of(self.iterate.task)), foretelling(trials))))
        sizes = f"{sizes_of(self.preset_name)} {trials_of(self.first, self.trials)}."
        (folder / TABLE).write_text(f"{text}\n{sizes} {made}\n", encoding="utf-8")
        task = self.iterate.task
        picture = trials_figure(trials, self.methods, worth(trials, task), tolerant=self.tolerant)
        answer = answer_comparison(summary, trials, Unit.of(task))
        write_study_page(folder, answer, [TABLE], [picture])
        return self.metrics(summary, answer)

    @property
    def tolerant(self) -> bool:
        """Whether a policy may fall and be stable."""
        return self.iterate.budget.tolerated > 0.0

    def metrics(self, summary: Sequence[Summary], answer: Answer) -> dict[str, Any]:
        """Return the summaries, what the page says first, and the line that `gsl runs` shows."""
        methods = ", ".join(dict.fromkeys(row.method for row in summary))
        headline = f"{several(self.trials, 'trial')} of {methods}"
        rows = [row._asdict() for row in summary]
        return {"headline": headline, "answer": answer.sentence, "trials": self.trials, "summaries": rows}

    def carry_out(
        self, folder: Path, console: Console, seconds: Callable[[], float] | None = None
    ) -> tuple[list[Trial], str]:
        """Return all trials, built beside `folder` and told as they end, and who made them; write them down.

        Args:
            folder: Of the study's artifact.
            console: Where it is told.
            seconds: Returns about how long all of it takes from nothing [s].
        """
        for name, grounding in self.methods.items():
            check_trainable(self.iterate, f"methods.{name}", grounding)
        check_aggregate(self.iterate, self.methods.values(), "iterate.aggregate")
        if self.rank and any(isinstance(world, ExternalRobot) for world in self.worlds.values()):
            raise ConfigError("rank", "needs worlds that are simulated: forty policies are tried in each", given="true")
        home, simulators = folder.parent, self._simulators
        for sim, real in product(simulators.values(), self.worlds.values()):
            check_alike(sim.layout, real.layout)
        named = {f"simulators.{name}" if name else "iterate.sim": world for name, world in simulators.items()}
        try_out({**named, **{f"worlds.{name}": world for name, world in self.worlds.items()}})
        ledger = Ledger(home / DATA, self.parents(), Trial, console)
        keys = self.recipes
        duration = ledger.announce({key: cell.method for (_, cell), key in keys.items()}, seconds)
        iterations = list(range(1, self.iterate.iterations + 1))
        ledger.judge({key: {"number": k, **cell._asdict(), "iteration": iterations} for (k, cell), key in keys.items()})
        missing: dict[int, list[tuple[int, Cell]]] = {}
        for (number, cell), key in keys.items():
            if not ledger.take(key):
                missing.setdefault(number, []).append((number, cell))
        for item, trials in in_order(self, folder, missing, console, duration, self._links):
            ledger.add(keys[item], [trial._asdict() for trial in trials])
        return [Trial.read(row) for row in ledger.figures], ledger.close(folder / DATA)

    @property
    def recipes(self) -> dict[tuple[int, Cell], str]:
        """By trial and cell, in the order in which they are run."""
        sims = self._simulators
        cells = [Cell(sim, world, method, 1) for method, sim, world in product(self.methods, sims, self.worlds)]
        return {
            (k, cell): recipe(
                self.iterate, k, cell, sims[cell[0]], self.worlds[cell[1]], self.methods[cell[2]], self.rank
            )
            for k, cell in product(numbers(self.first, self.trials), cells)
        }

    @property
    def _simulators(self) -> Mapping[str, World]:
        return self.simulators or {"": self.iterate.sim}

    def _links(self, item: tuple[int, Cell]) -> list[Part]:
        """Return the links of a trial of a cell, those that others share as well."""
        cell = item[1]
        sim, real, method = self._simulators[cell.simulator], self.worlds[cell.world], self.methods[cell.method]
        ranked = [Part(steps=Values.count)] * 2 if self.rank else []
        return [*links(replace(self.iterate, sim=sim, real=real, grounding=method, beside=False)), *ranked]

    def results(self, home: Path, item: tuple[int, Cell], console: Console) -> Iterator[Trial]:
        """Yield a trial of a cell, iteration by iteration."""
        number, cell = item
        part = f"{cell.worlds}, {cell.method}, trial {number}"
        with console.part(part):
            for trial in self._trial(home, self._simulators[cell.simulator], cell, number, console):
                console.status(f"{part}: {trial.describe(Unit.of(self.iterate.task))}")
                yield trial

    def _trial(self, home: Path, sim: World, cell: Cell, number: int, console: Console) -> Iterator[Trial]:
        """Yield a trial iteration by iteration."""
        seed, name, method = self.iterate.seed + number - 1, f"trial_{number:02d}", self.methods[cell.method]
        chain = replace(self.iterate.chain, sim=sim, real=self.worlds[cell.world], accept=True)
        below = home / cell.simulator
        grounding = chain.diagnose(below / cell.world / "diagnosis" / name, method, seed, console)
        flight = flown(below / cell.world / "diagnosis" / name, method, grounding)
        spent, first, previous = flight.episodes if flight else 0, None, None
        data = {REAL: below / cell.world / "data" / name, SIM: below / "sim" / "data" / name}
        chain = replace(chain, shared={REAL: data[REAL]} if isinstance(grounding, DiagnosedEffects) else data)
        if self.iterate.pretrained:
            previous = chain.pretrain(below / "sim" / "pretrained" / name, seed, console)
        for iteration in range(1, self.iterate.iterations + 1):
            place = below / cell.world / cell.method / name / (f"iteration_{iteration:02d}" if iteration > 1 else "")
            apart = is_learned(grounding) or flight is not None or iteration > 1
            spent += sum(self.iterate.budget.real) if REAL in evidence_of(grounding) else 0
            out = place if apart else below / "sim" / cell.method / name
            at = seed_of_round(seed, iteration)
            ready, search, measured = chain.round(place, grounding, previous, at, console, search=out)
            rank = self._rank(chain, below / cell.world, out, ready, search, console) if iteration == 1 else None
            trial = Trial.of(
                cell._replace(iteration=iteration),
                number,
                search.metrics,
                measured.metrics,
                spent=spent,
                first=first,
                rank=rank,
                tried=read_tried(search.metrics, measured),
            )
            yield trial
            spent, previous, first = trial.real_episodes, str(measured.folder), first or measured.metrics
            chain = replace(chain.after(place), shared={})

    def _rank(
        self, chain: Chain, world: Path, out: Path, ready: Grounding, search: Artifact, console: Console
    ) -> float | None:
        if not self.rank:
            return None
        simulated = chain.values(out / "values", ready, search.metrics, console)
        return rank(simulated, chain.values(world / "values", None, {}, console))
