"""The policy-level gap: what policies return in real, in the simulator as it is, and in the diagnosed one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gsl.core.console import Console, Progress
from gsl.core.interfaces import REAL
from gsl.core.seeds import derive_seed
from gsl.core.statistics import Interval, bootstrap_interval, mean_interval, rank_correlation
from gsl.grounding.none import NoGrounding
from gsl.rollout.parallel import Episode, Job, episodes
from gsl.rollout.rollout import Scenario
from gsl.validation.real_returns import RealReturns
from gsl.worlds.bullet import BulletWorld

RANKED = 3  # policies without which there is no order to speak of


class Effort(NamedTuple):
    """Simulated episodes of each policy in each simulator, the processes that run them, and the seed of all."""

    episodes: int
    workers: int
    seed: int


def policy_gap(
    measured: RealReturns, before: BulletWorld, after: BulletWorld, *, named: bool, effort: Effort, console: Console
) -> dict[str, Any]:
    """Return what policies are worth in three worlds, and how well either simulator predicts it.

    Both simulators play the same seeds, and returns are counted as in real, falls included.

    Args:
        measured: Policies with their real returns.
        before: The simulator as the user has it.
        after: The diagnosed one.
        named: Whether effects are switched on in it; else it is only calibrated.
        effort: How much is simulated.
        console: Shown the progress.
    """
    with console.progress(2 * effort.episodes * len(measured.policies), "policies in both simulators") as progress:
        sim, diagnosed = (_play(measured, measured.setup(world), effort, progress) for world in (before, after))
    seed = derive_seed(effort.seed, "policy_gap")
    rows = [
        {
            "name": policy.name,
            "sim": _simulate(simulated),
            "diagnosed": _simulate(corrected),
            "real": _side(policy.values, policy.falls, stopped=policy.stopped),
        }
        for policy, simulated, corrected in zip(measured.policies, sim, diagnosed, strict=True)
    ]
    gap = {
        "unit": measured.task.unit,
        "shown": measured.task.shown,
        "policies": len(rows),
        "measured": measured.total,
        "episodes": effort.episodes,
        "simulator": "diagnosed" if named else "calibrated",
        "rows": rows,
        **_agreement(rows, seed),
    }
    whole = [row for row, policy in zip(rows, measured.policies, strict=True) if not policy.stopped]
    rest = {"policies": len(whole), **_agreement(whole, seed)} if 0 < len(whole) < len(rows) else None
    return {**gap, "never_stopped": rest, "caveats": _caveats(gap, len(rows) - len(whole), rest)}


def _play(measured: RealReturns, world: BulletWorld, effort: Effort, progress: Progress) -> list[list[Episode]]:
    """Return the episodes of each policy."""
    scenario = Scenario(world, measured.task, measured.policy, REAL, NoGrounding())
    jobs = [
        Job(policy.parameters, derive_seed(effort.seed, "policy_gap", policy.name, number))
        for policy in measured.policies
        for number in range(effort.episodes)
    ]
    done = episodes(scenario, jobs, workers=effort.workers, progress=progress)
    return [done[first : first + effort.episodes] for first in range(0, len(done), effort.episodes)]


def _simulate(done: Sequence[Episode]) -> dict[str, Any]:
    return _side(np.array([episode.value for episode in done]), sum(episode.fell for episode in done), stopped=False)


def _side(values: np.ndarray, falls: int, *, stopped: bool) -> dict[str, Any]:
    """Return the mean with its interval; a policy that was stopped at its fall has none."""
    mean = _bound(mean_interval(values))
    bounds = {"low": None, "high": None} if stopped else {}
    return {**mean, **bounds, "falls": falls, "episodes": len(values)}


def _agreement(rows: Sequence[Mapping[str, Any]], seed: int) -> dict[str, Any]:
    """Return mean absolute gap and rank correlation of either simulator, with intervals by bootstrap over policies."""
    real, before, after = (np.array([row[key]["value"] for row in rows]) for key in ("real", "sim", "diagnosed"))
    simulators = {"before": before, "after": after}
    return {
        "gap": {when: _gap(simulated, real, seed) for when, simulated in simulators.items()},
        "correlation": {when: _correlation(simulated, real, seed) for when, simulated in simulators.items()},
    }


def _gap(simulated: np.ndarray, real: np.ndarray, seed: int) -> dict[str, float | None]:
    apart = np.abs(simulated - real)
    interval = bootstrap_interval(lambda chosen: float(apart[chosen].mean()), len(apart), np.random.default_rng(seed))
    return _bound(interval)


def _correlation(simulated: np.ndarray, real: np.ndarray, seed: int) -> dict[str, float | None] | None:
    if len(real) < RANKED or np.isnan(rank_correlation(simulated, real)):
        return None

    def resample(chosen: np.ndarray) -> float:
        return rank_correlation(simulated[chosen], real[chosen])

    return _bound(bootstrap_interval(resample, len(real), np.random.default_rng(seed)))


def _bound(interval: Interval) -> dict[str, float | None]:
    names = ("value", "low", "high")
    return {name: value if np.isfinite(value) else None for name, value in zip(names, interval, strict=True)}


def _caveats(gap: Mapping[str, Any], stopped: int, rest: Mapping[str, Any] | None) -> list[str]:
    said = []
    if gap["policies"] < gap["measured"]:
        said.append(f"{gap['measured']} policies were measured; these {gap['policies']} are spread over the list.")
    if gap["policies"] < RANKED:
        said.append(f"{RANKED} policies are the least for a rank correlation.")
    elif None in gap["correlation"].values():
        said.append("Where all policies return the same there is no rank correlation.")
    if gap["simulator"] == "calibrated":
        said.append("The verdict names no cause: the second simulator is the first one calibrated joint by joint.")
    if stopped:
        stops = "1 policy was" if stopped == 1 else f"{stopped} policies were"
        without = f" {_without(gap, rest)}" if rest else ""
        said.append(
            f"{stops} stopped at the first fall on the real side: "
            f"the real return is rough there, with no interval.{without}"
        )
    return said


def _without(gap: Mapping[str, Any], rest: Mapping[str, Any]) -> str:
    """Return the figures of the policies that did all their real episodes."""
    gaps = [f"{gap['shown'] * interval['value']:.3g}" for interval in rest["gap"].values()]
    orders = [interval and f"{interval['value']:.2f}" for interval in rest["correlation"].values()]
    ranks = f", rank correlations {' and '.join(orders)}" if all(orders) else ""
    return f"Without: {' and '.join(gaps)} {gap['unit']} from real{ranks}."
