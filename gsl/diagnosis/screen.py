"""A screening: what each candidate could explain, joint by joint, before any of them is fitted with care."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.candidates import Candidate
from gsl.diagnosis.fit import projected, proportional
from gsl.diagnosis.replay import Bench, Effects

INVISIBLE = 0.25  # rms in units of the floor below which the strongest setting of an effect leaves no trace


@dataclass(frozen=True)
class Lead:
    """A candidate that is worth a fit.

    Attributes:
        candidate: With its scope.
        parameters: Where the fit starts, shape (p,).
        nuisances: That go with them, shape (7, n_joints).
        cost: As the screening sees it.
    """

    candidate: Candidate
    parameters: np.ndarray
    nuisances: np.ndarray
    cost: float


@dataclass(frozen=True)
class Screening:
    """What was found.

    Attributes:
        leads: Best first.
        invisible: Effects that leave no trace in this log.
    """

    leads: tuple[Lead, ...]
    invisible: tuple[str, ...]


@dataclass(frozen=True)
class Ground:
    """Where a screening stands.

    Attributes:
        effects: That are switched on already.
        nuisances: Fitted with them, shape (7, n_joints).
        residual: There, shape (W, scored, n_joints).
        slopes: Sensitivities there.
        costs: Of each joint, nuisances free, shape (n_joints,).
        best: These nuisances, shape (7, n_joints).
    """

    effects: Effects
    nuisances: np.ndarray
    residual: np.ndarray
    slopes: np.ndarray
    costs: np.ndarray
    best: np.ndarray


def screened(
    bench: Bench,
    ground: Ground,
    candidates: Iterable[Candidate],
    scopes: Mapping[str, np.ndarray],
    tick: Callable[[str], None],
) -> Screening:
    """Try every candidate on top of what is switched on.

    Args:
        bench: Training windows.
        ground: Where to start.
        candidates: Those on joints may have any scope; `all` is read out for every scope in `scopes`.
        scopes: Names of scopes and their joints, each of shape (n_joints,).
        tick: Called with an empty word after each candidate.
    """
    leads: list[Lead] = []
    seen: dict[str, float] = {}
    for candidate in candidates:
        grid = candidate.grid if len(candidate.grid) else _answer(bench, ground, candidate)[None]
        costs, nuisances, trace = _costs(bench, ground, candidate, grid)
        seen[candidate.effect] = max(trace, seen.get(candidate.effect, 0.0))
        if trace > 0.0:
            leads += _leads(candidate, grid, (costs, nuisances), ground, scopes)
        tick("")
    leads.sort(key=lambda lead: lead.cost)
    return Screening(tuple(leads), tuple(sorted(name for name, trace in seen.items() if trace <= INVISIBLE)))


def _answer(bench: Bench, ground: Ground, candidate: Candidate) -> np.ndarray:
    """Return the best parameters of an effect in proportion to them, shape (p,)."""
    own = []
    for k, probe in enumerate(candidate.probes):
        moved = candidate.neutral.copy()
        moved[k] += probe
        z = bench.residual(merged(ground.effects, candidate, moved), ground.nuisances)
        own.append((z - ground.residual) / probe)
    change = proportional(ground.residual, np.array(own), ground.slopes, ground.nuisances, bench.simulator.spread)
    return np.clip(candidate.neutral + change, *candidate.bounds)


def _costs(
    bench: Bench, ground: Ground, candidate: Candidate, grid: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return costs, shape (g, n_joints), nuisances, shape (g, 7, n_joints), of each point; and the strongest trace."""
    costs, nuisances = np.full((len(grid), bench.joints), np.inf), np.zeros((len(grid), *ground.nuisances.shape))
    trace = 0.0
    for row in range(len(grid) - 1, -1, -1):  # the strongest first: it tells whether there is a trace at all
        z = bench.residual(merged(ground.effects, candidate, grid[row]), ground.nuisances)
        trace = max(trace, float(np.sqrt(np.mean((z - ground.residual) ** 2, axis=(0, 1)).max())))
        if trace == 0.0:
            break
        nuisances[row], costs[row] = projected(z, ground.slopes, ground.nuisances, bench.simulator.spread)
    return costs, nuisances, trace


def _leads(
    candidate: Candidate,
    grid: np.ndarray,
    found: tuple[np.ndarray, np.ndarray],
    ground: Ground,
    scopes: Mapping[str, np.ndarray],
) -> list[Lead]:
    costs, nuisances = found
    wide = candidate.on_joints and candidate.scope == "all"
    masks = scopes if wide else {candidate.scope: np.ones(costs.shape[1], dtype=bool)}
    leads = []
    for scope, mask in masks.items():
        totals = costs[:, mask].sum(axis=1) + ground.costs[~mask].sum()
        best = int(np.argmin(totals))
        chosen = candidate.on(scope) if wide else candidate
        start = np.where(mask, nuisances[best], ground.best)
        at = (
            grid[best]
            if grid[best, 0] == candidate.seen
            else _between(grid, totals, best, wide=bool(candidate.wide.all()))
        )
        leads.append(Lead(chosen, at, start, float(totals[best])))
    return leads


def _between(grid: np.ndarray, totals: np.ndarray, best: int, *, wide: bool) -> np.ndarray:
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


def merged(effects: Effects, candidate: Candidate, parameters: np.ndarray) -> Effects:
    """Return effects with one more."""
    return {**effects, candidate.effect: [*effects.get(candidate.effect, []), candidate.entry(parameters)]}


def best_of(leads: Sequence[Lead], count: int, per_effect: int = 2) -> list[Lead]:
    """Return the best leads, not too many of one effect."""
    taken: dict[str, int] = {}
    chosen: list[Lead] = []
    for lead in leads:
        if taken.get(lead.candidate.effect, 0) < per_effect and len(chosen) < count:
            taken[lead.candidate.effect] = taken.get(lead.candidate.effect, 0) + 1
            chosen.append(lead)
    return chosen
