"""The paper's figure 11: Cliff Walking with GAT and SGAT against the real world's noise, exact bounds beside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

import numpy as np

from gsl.core.console import Console
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.core.statistics import Interval, mean_interval
from gsl.core.table import Table
from gsl.core.unit import Unit
from gsl.core.words import several
from gsl.grounding.states import TableTransformation
from gsl.models.counts import Counts
from gsl.report.markdown import table as markdown
from gsl.report.study_page import write_study_page
from gsl.report.style import save
from gsl.storage.documents import write_json
from gsl.worlds.gymnasium import GymnasiumWorld
from gsl_experiments.answer import answer_difference
from gsl_experiments.noise_curve import Curve, noise_curve_figure
from gsl_experiments.sizes import PresetName, check_rising, sizes_of
from gsl_experiments.table_episodes import play

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE, DATA, FIGURE = "table.md", "points.json", "figure_11.png"
DOWN = 2  # π0's action everywhere: of equally good paths in the simulator it leaves the one along the edge
METHODS = {"gat": False, "sgat": True}  # whether the next state is drawn


class Point(NamedTuple):
    """One method, once, at one noise.

    Attributes:
        value: Exact, of the policy it ends with, in the real world.
        estimate: The same from episodes there.
        rounds: Of grounding and policy improvement.
        converged: Whether the last one changed nothing.
        real_episodes: That the forward model learned from.
    """

    method: str
    noise: float
    trial: int
    value: float
    estimate: float
    rounds: int
    converged: bool
    real_episodes: int


@component
class Figure11:
    """Grounding and exact policy iteration in turn until the policy does not change; real data are kept."""

    kind: ClassVar[str] = "reproduce"

    world: Annotated[GymnasiumWorld, setting("the cliff; its noise is replaced")]
    noises: Annotated[
        tuple[Annotated[float, setting("", ge=0, le=1)], ...],
        setting("chances that the real world replaces an action", min_length=1),
    ]
    trials: Annotated[int, setting("trials of each method and noise", ge=1)]
    episodes: Annotated[int, setting("real episodes of each grounding step", ge=1)] = 200
    explore: Annotated[float, setting("chance of a random action in them", ge=0, le=1)] = 0.2
    sim_episodes: Annotated[
        int, setting("simulated episodes for the inverse model, nine in ten actions random", ge=1)
    ] = 5000
    rounds: Annotated[int, setting("most rounds", ge=1)] = 30
    evaluations: Annotated[int, setting("real episodes that estimate the return", ge=1)] = 10_000
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1
    preset_name: PresetName = ""

    def __post_init__(self) -> None:
        """Refuse a curve that goes back, or counts a noise twice."""
        check_rising("noises", self.noises)

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here."""
        return {}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Run all trials; write the points, the table and the figure."""
        simulator = self._real(0.0)
        start = simulator.solve(np.full(len(simulator.terminal), DOWN))
        points: list[Point] = []
        with console.progress(len(self.noises) * self.trials, "grounding at the cliff") as progress:
            for noise in self.noises:
                for trial in range(self.trials):
                    points += [self._trial(simulator, start, noise, method, trial) for method in METHODS]
                    progress.advance()
        write_json(folder / DATA, [point._asdict() for point in points])
        bounds = {noise: self._bounds(start, noise) for noise in self.noises}
        sizes = f"{sizes_of(self.preset_name)} {several(self.trials, 'trial')}."
        (folder / TABLE).write_text(f"{_table(points, bounds)}\n{sizes}\n", encoding="utf-8")
        picture = _draw(folder / FIGURE, points, bounds)
        noise = max(bounds, key=lambda level: bounds[level][1] - bounds[level][0])
        each = {method: [point.value for point in _of(points, method, noise)] for method in METHODS}
        apart = mean_interval(np.subtract(each["sgat"], each["gat"]))
        question = "Does a stochastic grounding return more than a deterministic one as the real world gets noisier?"
        what = f"At noise {noise:g}, where there is most to gain, sgat minus gat"
        answer = answer_difference(question, what, apart, Unit(name="of return"))
        write_study_page(folder, answer, [TABLE], [picture])
        return {"points": len(points), "noises": len(self.noises)}

    def _real(self, noise: float) -> Table:
        return replace(self.world, kwargs={**self.world.kwargs, "noise": noise}).table

    def _bounds(self, start: np.ndarray, noise: float) -> tuple[float, float]:
        """Return what the simulator's optimum and the real optimum are worth in the real world."""
        real = self._real(noise)
        return real.value(start), real.value(real.solve(start))

    def _trial(self, simulator: Table, start: np.ndarray, noise: float, method: str, trial: int) -> Point:
        real, policy = self._real(noise), start
        rng = np.random.default_rng(derive_seed(self.seed, self.kind, round(1e6 * noise), trial))
        inverse = Counts(play(simulator, start, self.sim_episodes, rng, explore=0.9).seen, "inverse_model")
        seen, rounds, converged = np.zeros(real.chances.shape), 0, False
        while rounds < self.rounds and not converged:
            rounds += 1
            seen += play(real, policy, self.episodes, rng, explore=self.explore).seen
            grounding = TableTransformation(Counts(seen), inverse, draws=METHODS[method])
            better = grounding.ground(simulator).solve(policy)
            converged = np.array_equal(better, policy)
            policy = better
        estimate = float(play(real, policy, self.evaluations, rng).returns.mean())
        return Point(method, noise, trial + 1, real.value(policy), estimate, rounds, converged, rounds * self.episodes)


def _of(points: Sequence[Point], method: str, noise: float) -> list[Point]:
    return [point for point in points if (point.method, point.noise) == (method, noise)]


def _table(points: Sequence[Point], bounds: Mapping[float, tuple[float, float]]) -> str:
    titles = (
        *("noise", "edge path, exact", "real optimum, exact", "gat", "sgat", "sgat - gat", "sgat of optimum"),
        *(f"real episodes of {method}" for method in METHODS),
    )
    rows = []
    for noise, (edge, best) in bounds.items():
        each = {method: [point.value for point in _of(points, method, noise)] for method in METHODS}
        apart = mean_interval(np.subtract(each["sgat"], each["gat"]))
        means = [_format(mean_interval(values)) for values in each.values()]
        share = f"{100 * np.mean(each['sgat']) / best:.1f} %" if best > 0.0 else "-"
        spent = (_episodes(_of(points, method, noise)) for method in METHODS)
        rows.append((f"{noise:g}", f"{edge:.2f}", f"{best:.2f}", *means, _format(apart), share, *spent))
    effort = []
    for method in METHODS:
        own = [point for point in points if point.method == method]
        open_ends = sum(not point.converged for point in own)
        rounds = f"{np.mean([point.rounds for point in own]):.1f}"
        effort.append((method, rounds, f"{open_ends} of {len(own)}", _episodes(own)))
    off = max(abs(point.estimate - point.value) for point in points)
    below = f"\nEstimates from real episodes are off the exact values by {off:.2f} at most.\n\n"
    return markdown(titles, rows) + below + markdown(("grounding", "rounds", "not converged", "real episodes"), effort)


def _episodes(points: Sequence[Point]) -> str:
    spent = [point.real_episodes for point in points]
    return f"{np.mean(spent):.0f} ({min(spent)} to {max(spent)})"


def _format(interval: Interval) -> str:
    return (
        f"{interval.mean:.2f} ({interval.lower:.2f} to {interval.upper:.2f})"
        if np.isfinite(interval.upper)
        else f"{interval.mean:.2f}"
    )


def _draw(path: Path, points: Sequence[Point], bounds: Mapping[float, tuple[float, float]]) -> Figure:
    noises = list(bounds)
    curves = {
        method: Curve(
            noises, [mean_interval([point.value for point in _of(points, method, noise)]) for noise in noises]
        )
        for method in METHODS
    }
    exact = {"real optimum": [best for _, best in bounds.values()], "edge path": [edge for edge, _ in bounds.values()]}
    return save(noise_curve_figure(curves, exact, "Cliff Walking: return in the real world"), path)
