"""A screening: what each candidate could explain, joint by joint, before any of them is fitted with care."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gsl.diagnosis.hypothesis.candidates import Candidate
from gsl.diagnosis.hypothesis.common_mode import hand_over, shares
from gsl.diagnosis.hypothesis.fit import fit_proportional, fit_shifts, sensitivities
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis, by_cost
from gsl.diagnosis.hypothesis.problem import Ask, Problem
from gsl.diagnosis.settings import SearchSettings
from gsl.diagnosis.simulate.calibration import no_shifts, prior_cost
from gsl.diagnosis.simulate.in_the_air import Effects
from gsl.diagnosis.simulate.simulator import Bench, Simulator


@dataclass(frozen=True)
class Lead:
    """A candidate that is worth a fit.

    Attributes:
        candidate: With its scope.
        parameters: Where the fit starts, shape (p,).
        shifts: That go with them, shape (7, n_joints).
        cost: As the screening sees it.
    """

    candidate: Candidate
    parameters: np.ndarray
    shifts: np.ndarray
    cost: float


@dataclass(frozen=True)
class Screening:
    """What came of a screening.

    Attributes:
        leads: Best first.
        invisible: Effects that leave no trace in this log.
    """

    leads: tuple[Lead, ...]
    invisible: tuple[str, ...]


class Answer(NamedTuple):
    """What a candidate does to the residuals, at each point of its grid.

    Attributes:
        grid: Parameters, shape (g, p).
        costs: Of each joint, shifts free, shape (g, n_joints).
        shifts: These, shape (g, 7, n_joints).
        trace: The strongest root mean square change of a joint's residuals [floors].
    """

    grid: np.ndarray
    costs: np.ndarray
    shifts: np.ndarray
    trace: float


@dataclass(frozen=True)
class Ground:
    """Where a screening stands.

    Attributes:
        bench: The windows that it looks at.
        effects: That are switched on already.
        shifts: Where the calibration begins, shape (7, n_joints).
        residual: There, shape (W, scored, n_joints).
        slopes: Sensitivities there.
        costs: Of each joint, shifts free, shape (n_joints,).
        best: These shifts, shape (7, n_joints).
    """

    bench: Bench
    effects: Effects
    shifts: np.ndarray
    residual: np.ndarray
    slopes: np.ndarray
    costs: np.ndarray
    best: np.ndarray

    @classmethod
    def of(cls, bench: Bench, effects: Effects) -> Ground:
        """Return where a screening on top of effects starts: without shifts, which hide what is missing."""
        at = no_shifts(bench.joints)
        z = bench.residual(effects, at)
        slopes = sensitivities(bench, effects, at, z)
        best, costs = fit_shifts(z, slopes, at, bench.simulator.spread)
        return cls(bench, effects, at, z, slopes, costs, best)

    def on(self, simulator: Simulator) -> Ground:
        """Return it on another simulator of the same replays."""
        return replace(self, bench=replace(self.bench, simulator=simulator))

    def suspects(self, scopes: Mapping[str, np.ndarray], settings: SearchSettings) -> list[str]:
        """Return the joints in which most of what calibration leaves lies: there every effect is tried alone."""
        used = self.bench.comparison.count_residuals(self.residual.shape[1]) * len(self.residual)
        excess = np.maximum(0.0, self.costs - used)
        order = np.argsort(excess)[::-1][: settings.suspects]
        joints = {int(np.argmax(mask)): name for name, mask in scopes.items() if mask.sum() == 1}  # joints are last
        if len(joints) < len(excess):
            return []
        return [joints[k] for k in order if excess[k] > settings.dominant * excess.sum()]


def screen(problem: Problem, base: Hypothesis) -> Screening:
    """Return what each candidate could explain on top of a hypothesis."""
    ground = Ground.of(problem.glance, base.effects)
    suspects = ground.suspects(problem.scopes, problem.settings)
    local = [part.on(joint) for joint in suspects for part in problem.library if part.on_joints]
    seen = problem.memory.setdefault(("screening", repr(base.effects)), {})
    return screen_candidates(ground, (*problem.library, *local), problem.scopes, problem.tick, problem.settings, seen)


def extend(problem: Problem, base: Hypothesis, width: int) -> tuple[list[Hypothesis], Screening]:
    """Return hypotheses with one effect more than `base`, best first, and the screening that led to them."""
    screening = screen(problem, base)
    new = [lead for lead in screening.leads if (lead.candidate.effect, lead.candidate.scope) not in base.places]
    fits = _fit_leads(problem, base, _best_leads(new, width, problem.settings.again))
    fits += _free_shifts(problem, base, [fit.places for fit in fits])
    return sorted(fits, key=by_cost), screening


def _free_shifts(problem: Problem, base: Hypothesis, tried: Sequence[frozenset[tuple[str, str]]]) -> list[Hypothesis]:
    """Fit the cause that frees most of what shifts cost, if that is enough: a screening lets every joint hide its own.

    Args:
        problem: Where it competes.
        base: What stands.
        tried: Places of what has been fitted on top of it.
    """
    at, unit, spread = base.fit.shifts, problem.simulator.plant.robot.torque_unit, problem.simulator.spread
    best, most = None, problem.settings.hidden * problem.settings.gain
    for candidate in (part.on(scope) for part in problem.library if part.on_joints for scope in problem.scopes):
        common, place = shares([candidate], problem.scopes, unit), (candidate.effect, candidate.scope)
        if len(common) != 1 or place in base.places or {*base.places, place} in tried:
            continue
        theta, left = hand_over(candidate.neutral, at, candidate.bounds, common)
        if (freed := prior_cost(at, spread) - prior_cost(left, spread)) > most:
            best, most = (candidate, theta, left), freed
    if best is None:
        return []
    candidate, theta, left = best
    return [problem.fit((*base.candidates, candidate), np.r_[base.start, theta], left)]


def _fit_leads(problem: Problem, base: Hypothesis, leads: Sequence[Lead]) -> list[Hypothesis]:
    """Fit one effect more, each from where the screening saw it and from hardly any of it in what stands.

    The screening gives each joint the calibration that suits the effect alone. Beside other effects a descent from
    there can end in another valley, above what already stands.
    """
    asks = []
    for lead in leads:
        candidates, neutral = (*base.candidates, lead.candidate), lead.candidate.neutral
        hardly = neutral + problem.settings.hardly * (lead.parameters - neutral)
        starts = [(lead.parameters, lead.shifts), *([(hardly, base.fit.shifts)] if base.candidates else [])]
        asks += [Ask(candidates, np.r_[base.start, values], shifts) for values, shifts in starts]
    fits, each = problem.fit_all(asks), 2 if base.candidates else 1
    return [min(fits[k : k + each], key=lambda hypothesis: hypothesis.fit.cost) for k in range(0, len(fits), each)]


def screen_candidates(
    ground: Ground,
    candidates: Iterable[Candidate],
    scopes: Mapping[str, np.ndarray],
    tick: Callable[[str], None],
    settings: SearchSettings,
    seen: dict[Any, Answer] | None = None,
) -> Screening:
    """Try every candidate on top of what is switched on.

    Args:
        ground: Where to start.
        candidates: Those on joints may have any scope; `all` is read out for every scope in `scopes`.
        scopes: Names of scopes and their joints, each of shape (n_joints,).
        tick: Called with an empty word after each candidate that is new.
        settings: What counts as invisible.
        seen: Answers of candidates by their keys; new ones are put in.
    """
    seen, candidates = {} if seen is None else seen, list(candidates)
    new = [part for part in {part.key: part for part in candidates}.values() if part.key not in seen]
    answers = ground.bench.simulator.side_by_side(
        lambda simulator, part: _answer(ground.on(simulator), part), new, lambda _: tick("")
    )
    seen.update(zip([part.key for part in new], answers, strict=True))
    leads: list[Lead] = []
    traces: dict[str, float] = {}
    for candidate in candidates:
        grid, costs, shifts, trace = seen[candidate.key]
        traces[candidate.effect] = max(trace, traces.get(candidate.effect, 0.0))
        if trace > 0.0:
            leads += _leads(candidate, grid, costs, shifts, ground, scopes)
    leads.sort(key=lambda lead: lead.cost)
    invisible = sorted(name for name, trace in traces.items() if trace <= settings.invisible)
    return Screening(tuple(leads), tuple(invisible))


def _proportional(ground: Ground, candidate: Candidate) -> np.ndarray:
    """Return the best parameters of an effect in proportion to them, shape (p,)."""
    own, bench = [], ground.bench
    for k, probe in enumerate(candidate.probes):
        moved = candidate.neutral.copy()
        moved[k] += probe
        z = bench.residual(add_effect(ground.effects, candidate, moved), ground.shifts)
        own.append((z - ground.residual) / probe)
    spread = bench.simulator.spread
    change = fit_proportional(ground.residual, np.array(own), ground.slopes, ground.shifts, spread)
    return np.clip(candidate.neutral + change, *candidate.bounds)


def _answer(ground: Ground, candidate: Candidate) -> Answer:
    """Replay a candidate's grid."""
    grid, bench = candidate.grid if len(candidate.grid) else _proportional(ground, candidate)[None], ground.bench
    costs, shifts = np.full((len(grid), bench.joints), np.inf), np.zeros((len(grid), *ground.shifts.shape))
    trace = 0.0
    for row in range(len(grid) - 1, -1, -1):  # the strongest first: without a trace of it there is none
        z = bench.residual(add_effect(ground.effects, candidate, grid[row]), ground.shifts)
        trace = max(trace, float(np.sqrt(np.mean((z - ground.residual) ** 2, axis=(0, 1)).max())))
        if trace == 0.0:
            break
        shifts[row], costs[row] = fit_shifts(z, ground.slopes, ground.shifts, bench.simulator.spread)
    return Answer(grid, costs, shifts, trace)


def _leads(
    candidate: Candidate,
    grid: np.ndarray,
    costs: np.ndarray,
    shifts: np.ndarray,
    ground: Ground,
    scopes: Mapping[str, np.ndarray],
) -> list[Lead]:
    wide = candidate.on_joints and candidate.scope == "all"
    masks = scopes if wide else {candidate.scope: np.ones(costs.shape[1], dtype=bool)}
    leads = []
    for scope, mask in masks.items():
        totals = costs[:, mask].sum(axis=1) + ground.costs[~mask].sum()
        best = int(np.argmin(totals))
        seen = grid[best, 0] == candidate.seen
        at = grid[best] if seen else interpolate(grid, totals, best, wide=bool(candidate.wide.all()))
        start = np.where(mask, shifts[best], ground.best)
        leads.append(Lead(candidate.on(scope) if wide else candidate, at, start, float(totals[best])))
    return leads


def interpolate(grid: np.ndarray, totals: np.ndarray, best: int, *, wide: bool) -> np.ndarray:
    """Return the lowest point of a parabola through the best grid value of one parameter and its neighbours.

    Of a wide range it is one over the logarithms.
    """
    if grid.shape[1] > 1 or len(grid) == 1:
        return grid[best]
    order = np.argsort(grid[:, 0])
    at = int(np.flatnonzero(order == best)[0])
    if at in (0, len(order) - 1):
        return grid[best]
    near = grid[order[at - 1 : at + 2], 0]
    x, y = np.log(near) if wide else near, totals[order[at - 1 : at + 2]]
    a, b, _ = np.polyfit(x, y, 2)
    if a <= 0.0:
        return grid[best]
    lowest = np.clip(np.array([-0.5 * b / a]), x[0], x[2])
    return np.exp(lowest) if wide else lowest


def add_effect(effects: Effects, candidate: Candidate, parameters: np.ndarray) -> Effects:
    """Return effects with one more."""
    return {**effects, candidate.effect: [*effects.get(candidate.effect, []), candidate.entry(parameters)]}


def _best_leads(leads: Sequence[Lead], count: int, again: int) -> list[Lead]:
    """Return the best lead of each effect, and some effects once more at other joints.

    A suspect joint was replayed alone and is read out of the replay of all joints besides: no lead is taken twice.

    Args:
        leads: Best first.
        count: How many.
        again: Of these, one in so many may be of an effect that has one already.
    """
    first, others = dict[str, Lead](), dict[str, Lead]()
    for lead in leads:
        if first.setdefault(lead.candidate.effect, lead).candidate.key != lead.candidate.key:
            others.setdefault(lead.candidate.effect, lead)
    more = list(others.values())[: count // again]
    return [*list(first.values())[: count - len(more)], *more]
