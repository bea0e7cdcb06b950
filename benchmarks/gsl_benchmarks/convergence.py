"""A study of the physics period and the solver's iterations: what a coarser engine changes of the walk and of the gap.

`python -m gsl_benchmarks.convergence` prints the table of which docs/reference/worlds.md has a part (minutes).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gsl.core.interfaces import REAL
from gsl.core.seeds import derive_seed
from gsl.core.statistics import rank_correlation
from gsl.core.trajectory import Trajectory
from gsl.grounding.none import NoGrounding
from gsl.policies.policy import neighbour
from gsl.policies.walk_engine import WalkEngine
from gsl.report.console import Console
from gsl.rollout.rollout import Scenario, rollout
from gsl.tasks.walk import Walk
from gsl.worlds.bullet import BulletWorld

REFERENCE = (0.001, 50)
SETTINGS = (REFERENCE, (0.0005, 50), (0.002, 50), (0.004, 50), (0.001, 20), (0.002, 20), (0.004, 20), (0.002, 10))
REPEATS, POLICIES, SPREAD = 10, 40, 0.12
COLUMNS = (
    "step [ms]",
    "iterations",
    "π0 [cm/s]",
    "sd",
    "falls",
    "random falls",
    "rank corr.",
    "tracking [deg]",
    "CPU [s]",
)


class Measured(NamedTuple):
    """What one setting gave: values [m/s] of π0's repeats and of the random policies, their falls, and the rest."""

    values: np.ndarray
    falls: np.ndarray
    random_values: np.ndarray
    random_falls: np.ndarray
    tracking: float
    cpu: float


def measure(step: float, iterations: int, first_seed: int = 0) -> Measured:
    """Measure one setting on the same policies.

    Args:
        step: Physics period [s].
        iterations: Of the solver.
        first_seed: Of the rollouts; another one shows what repeating alone changes.
    """
    world = BulletWorld(robot="nao", effects={}, step=step, iterations=iterations)
    scenario = Scenario(world, Walk(), WalkEngine(), REAL, NoGrounding())
    env, rng, policy = scenario.make(), np.random.default_rng(1), scenario.policy
    chosen = [policy.initial] * REPEATS + [neighbour(policy, policy.initial, SPREAD, rng) for _ in range(POLICIES)]
    rollout(scenario, env, policy.initial, 0)  # compiles
    begun = time.process_time()
    walks = [rollout(scenario, env, theta, derive_seed(first_seed, i)) for i, theta in enumerate(chosen)]
    cpu = (time.process_time() - begun) / sum(map(len, walks)) * scenario.task.duration / world.period
    env.close()
    values, falls = np.array([walk.value for walk in walks]), np.array([walk.ended_in_a_fall for walk in walks])
    tracking = float(np.mean([_tracking(walk) for walk in walks[:REPEATS]]))
    return Measured(values[:REPEATS], falls[:REPEATS], values[REPEATS:], falls[REPEATS:], tracking, cpu)


def table(results: Sequence[Measured], again: Measured) -> list[list[object]]:
    """Return the rows of the table; the last one is the reference with other seeds."""
    settings = [*SETTINGS, (*REFERENCE[:1], f"{REFERENCE[1]}, other seeds")]
    return [_row(*setting, result, results[0]) for setting, result in zip(settings, [*results, again], strict=True)]


def _row(step: float, iterations: object, result: Measured, reference: Measured) -> list[object]:
    correlation = 1.0 if result is reference else rank_correlation(result.random_values, reference.random_values)
    return [
        f"{1000.0 * step:g}",
        iterations,
        f"{100.0 * result.values.mean():.1f}",
        f"{100.0 * result.values.std(ddof=1):.2f}",
        f"{result.falls.sum()}/{len(result.falls)}",
        f"{result.random_falls.sum()}/{len(result.random_falls)}",
        f"{correlation:.2f}",
        f"{np.degrees(result.tracking):.2f}",
        f"{result.cpu:.2f}",
    ]


def _tracking(walk: Trajectory) -> float:
    """Root mean square of desired minus reached joint position one control period later [rad]."""
    return float(np.sqrt(np.mean((walk.position[1:] - walk.action) ** 2)))


def main() -> None:
    """Measure every setting in parallel and print the table."""
    import joblib

    jobs = [(*setting, 0) for setting in SETTINGS] + [(*REFERENCE, 1)]
    console, results = Console(), []
    with console.progress(len(jobs), "settings") as progress:
        for result in joblib.Parallel(n_jobs=-1, return_as="generator")(joblib.delayed(measure)(*job) for job in jobs):
            results.append(result)
            progress.advance()
    console.table("Physics period and solver", COLUMNS, table(results[:-1], results[-1]))


if __name__ == "__main__":
    from gsl_benchmarks import convergence  # workers import what they run

    convergence.main()
