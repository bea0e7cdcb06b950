"""How much real data a grounding needs: return and grounding error against the number of real trajectories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from gsl.core.console import Console
from gsl.core.interfaces import REAL, SIM, Grounding
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.core.statistics import Interval, mean_interval
from gsl.core.unit import Unit
from gsl.errors import ConfigError
from gsl.grounding.gat import ActionTransformation, LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.models.free_run import TICKS
from gsl.report.markdown import table
from gsl.report.study_page import write_study_page
from gsl.report.style import save
from gsl.rollout.rollout import Scenario
from gsl.stages.iterate import Iterate, check_trainable
from gsl.training.data import FEWEST, degrees
from gsl.validation.replay import replay_starts
from gsl_experiments.answer import answer_difference
from gsl_experiments.budget_curve import Line, budget_curve_figure
from gsl_experiments.compare import Compare
from gsl_experiments.comparison_table import bounds, finely, format_difference
from gsl_experiments.effort import check_search, seconds
from gsl_experiments.held_out import MEASURED, check_first_iteration, check_robot, collect_held_out, starts
from gsl_experiments.ledger import GOES_ON, Known, Ledger, list_earlier, recipe
from gsl_experiments.sizes import First, PresetName, check_rising, numbers, sizes_of, trials_of
from gsl_experiments.tasks import in_order

TABLE, DATA, FIGURE = "table.md", "points.json", "budget.png"
NONE = "none"
OWN = 3  # one of so many trajectories is of π0, the others of its neighbours
PAIRED = "Differences are paired by trial, their 95 % intervals each for itself."


class Point(NamedTuple):
    """One method, once, with one budget.

    Attributes:
        trajectories: Real ones that were collected for the models; 0 without grounding.
        value: Of the returned policy, in the unit of the task.
        error, bare: Of the grounded and of the plain simulator after 0.2 s, off π0, on trajectories of its own that are
            the same for all methods and budgets of a trial [deg].
    """

    method: str
    trajectories: int
    trial: int
    value: float
    error: float | None
    bare: float | None

    @property
    def contradiction(self) -> str:
        """What cannot be, of figures that a file told."""
        return "" if self.trial > 0 <= self.trajectories else f"trial {self.trial}, trajectories {self.trajectories}"


@component
class Budget:
    """Trial k of every method and budget has the same seed; without grounding there is one search a trial."""

    kind: ClassVar[str] = "reproduce"
    forced: ClassVar[str] = GOES_ON
    makes: ClassVar[tuple[str, ...]] = ("methods", "iterate.grounding")

    iterate: Annotated[Iterate, setting("what a trial is; its grounding and real budget are replaced")]
    methods: Annotated[Mapping[str, Grounding], setting("transformations of actions, by name", min_length=1)]
    budgets: Annotated[
        tuple[Annotated[int, setting("", ge=FEWEST)], ...],
        setting("real trajectories to learn from, the fewest first", min_length=1),
    ]
    trials: Annotated[int, setting("trials of each", ge=1)]
    known: Known = None
    preset_name: PresetName = ""
    first: First = 1

    def __post_init__(self) -> None:
        """Refuse a curve that goes back, or counts a budget twice."""
        check_rising("budgets", self.budgets)

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here, but for what is known."""
        return list_earlier(self.known, DATA)

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Run all trials, write the points, the table and the figure.

        Raises:
            ConfigError: A grounding does not learn from trajectories alone, or the optimizer is no search.
        """
        if NONE in self.methods:
            raise ConfigError(f"methods.{NONE}", "is what all others are set against; take another name")
        for name, grounding in self.methods.items():
            if not isinstance(grounding, ActionTransformation):
                raise ConfigError(f"methods.{name}", "learns from real trajectories alone; take gat or sgat")
            check_trainable(self.iterate, f"methods.{name}", grounding)
        check_first_iteration(self.iterate)
        check_robot(self.iterate.real, "iterate.real")
        check_search(self.iterate, "iterate")
        home = folder.parent
        ledger = Ledger(home / DATA, self.parents(), Point, console)
        keys = self.recipes
        duration = ledger.announce({key: method for (_, method, _), key in keys.items()}, self._seconds)
        ledger.judge({key: {"trial": k, "method": name, "trajectories": n} for (k, name, n), key in keys.items()})
        missing: dict[int, list[tuple[int, str, int]]] = {}
        for item, key in keys.items():
            if not ledger.take(key):
                missing.setdefault(item[0], []).append(item)
        for item, points in in_order(self, folder, missing, console, duration):
            ledger.add(keys[item], [point._asdict() for point in points])
        points = [Point(**row) for row in ledger.figures]
        self.tell(folder, points, ledger.close(folder / DATA))
        return {"points": len(points)}

    @property
    def recipes(self) -> dict[tuple[int, str, int], str]:
        """By trial, method and budget, in the order in which they are run."""
        cells = [(NONE, 0), *((method, count) for count, method in product(self.budgets, self.methods))]
        return {
            (k, method, count): recipe(self._with(count), k, method, count, self.methods.get(method))
            for k, (method, count) in product(numbers(self.first, self.trials), cells)
        }

    def _seconds(self) -> float:
        """Return an estimate of the study's duration [s]."""
        study = Compare(self.iterate, {"real": self.iterate.real}, {NONE: NoGrounding()}, self.trials)
        usual = self._with(sum(self.budgets) // len(self.budgets))
        learning = replace(study, methods=self.methods, iterate=usual)
        return seconds(study) + len(self.budgets) * seconds(learning)

    def _with(self, count: int) -> Iterate:
        """Return the iteration with so many real trajectories to learn from; with none it is as it was."""
        if not count:
            return self.iterate
        own = max(1, count // OWN)
        return replace(
            self.iterate, budget=replace(self.iterate.budget, real_episodes=own, real_neighbours=count - own)
        )

    def results(self, home: Path, item: tuple[int, str, int], console: Console) -> list[Point]:
        """Return the point of a method and budget in a trial."""
        number, method, count = item
        with console.part(f"{method}, {count} trajectories, trial {number}"):
            return [self._point(home, method, count, number, console)]

    def _point(self, home: Path, method: str, count: int, number: int, console: Console) -> Point:
        name, seed = f"trial_{number:02d}", self.iterate.seed + number - 1
        if method == NONE:
            return self._play_ungrounded(home / NONE / name, number, console)
        place, real = home / method / f"real_{count:03d}" / name, home / "data" / f"real_{count:03d}" / name
        shared = {REAL: real, SIM: home / "data" / "sim" / name}
        chain = replace(self._with(count).chain, accept=True, shared=shared)
        begins = starts(collect_held_out(chain, home / "held_out" / name, seed, console), chain)
        ready = chain.ready(place, self.methods[method], None, seed, console)
        search = chain.search(place / "optimize", ready, None, seed, console)
        measured = chain.measure(place / "evaluate", search, seed, console)
        acting = Scenario(chain.sim, chain.task, chain.policy, SIM, ready).prepare(search.metrics).grounding
        assert isinstance(acting, LoadedTransformation), "its world is a robot"
        env: Any = chain.sim.make()
        drawn = derive_seed(seed, "replays")
        grounded, bare = (
            replay_starts(env, way, begins, drawn)[TICKS] for way in (acting.deterministic, NoGrounding())
        )
        env.close()
        errors = degrees(grounded.joints), degrees(bare.joints)
        return Point(method, count, number, measured.metrics["returned"]["value"], *errors)

    def _play_ungrounded(self, place: Path, number: int, console: Console) -> Point:
        chain, seed = self.iterate.chain, self.iterate.seed + number - 1
        search = chain.search(place / "optimize", NoGrounding(), None, seed, console)
        measured = chain.measure(place / "evaluate", search, seed, console)
        return Point(NONE, 0, number, measured.metrics["returned"]["value"], None, None)

    def tell(self, folder: Path, points: Sequence[Point], made: str) -> None:
        """Write the table and the figure of all points; `made` says who made them."""
        shown, unit = self.iterate.task.shown, self.iterate.task.unit
        rows, values, errors, fewest = [], {}, {}, self.budgets[0]
        none = [shown * point.value for point in points if point.method == NONE]
        plain = mean_interval(list({point.trial: point.bare for point in points if point.bare is not None}.values()))
        for method in self.methods:
            cells = [
                [point for point in points if point.method == method and point.trajectories == n] for n in self.budgets
            ]
            returns = [[shown * point.value for point in cell] for cell in cells]
            wrong = [[point.error for point in cell if point.error is not None] for cell in cells]
            values[method] = Line(self.budgets, list(map(mean_interval, returns)))
            errors[method] = Line(self.budgets, list(map(mean_interval, wrong)))
            for n, value, error in zip(self.budgets, returns, wrong, strict=True):
                more, farther = (mean_interval(np.subtract(*pair)) for pair in ((value, none), (error, wrong[0])))
                than = "" if n == fewest else format_difference(farther, fine=True)
                cells_of_error = (*_cells(mean_interval(error), fine=True), than)
                rows.append((method, str(n), *_cells(mean_interval(value)), format_difference(more), *cells_of_error))
        without = mean_interval(none)
        rows.append((NONE, "0", *_cells(without), "", *_cells(plain, fine=True), ""))
        titles = (
            *(
                "grounding",
                "real trajectories collected",
                f"on the real side [{unit}]",
                "95 % interval",
                f"minus {NONE}",
            ),
            *("joints after 0.2 s, off π0 [°]", "95 % interval", f"minus those of {fewest}"),
        )
        below = f"{MEASURED}\n\n{sizes_of(self.preset_name)} {trials_of(self.first, self.trials)}. {made}\n"
        (folder / TABLE).write_text(f"{table(titles, rows)}\n{PAIRED}\n\n{below}", encoding="utf-8")
        panels = {f"on the real side [{unit}]": values, "joints after 0.2 s [°]": errors}
        bases = dict(zip(panels, (without.mean, plain.mean), strict=True))
        title = "What a grounding makes of more real data, with 95 % intervals"
        picture = save(budget_curve_figure(panels, bases, title), folder / FIGURE)
        last = [point.value for point in points if (point.method, point.trajectories) == (method, self.budgets[-1])]
        apart = mean_interval(np.subtract(last, [point.value for point in points if point.method == NONE]))
        what = f"With {self.budgets[-1]} real trajectories, {method} minus none"
        answer = answer_difference("How much real data does a grounding need?", what, apart, Unit.of(self.iterate.task))
        write_study_page(folder, answer, [TABLE], [picture])


def _cells(interval: Interval, *, fine: bool = False) -> tuple[str, str]:
    """Return a mean and its interval; `fine` of degrees."""
    return (f"{interval.mean:.2f}", finely(interval)) if fine else (f"{interval.mean:.1f}", bounds(interval))
