"""A study of racing: what it saves of a search in which every candidate plays all rollouts, and who wins.

`python -m gsl_benchmarks.race` plays the search once. Each generation is then raced on the values that were played, so
that both have the same seeds. docs/results/speed.md has the mean of what it
prints (hours; `--candidates`, `--generations`).
What was played goes to `--played`, from where a study that was stopped goes on.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gsl.core.console import Progress
from gsl.core.interfaces import SIM
from gsl.core.seeds import derive_seed
from gsl.grounding.torque_noise import TorqueNoise
from gsl.optimizers.cma_es import CmaEs
from gsl.optimizers.race import Race, weigh
from gsl.policies.walk_engine import WalkEngine
from gsl.report.console import Console
from gsl.rollout.parallel import Job, episodes
from gsl.rollout.rollout import Scenario, rollout
from gsl.tasks.walk import Walk
from gsl.worlds.bullet import BulletWorld

RACES = 10  # of each generation, with other draws
FINE, COARSE, PAIRS = 0.002, 0.004, 9  # [s] of two physics periods, and walks of which both costs are compared
COLUMNS = (
    "generation",
    "best [cm/s]",
    "falls",
    "races with another winner",
    "rollouts played",
    "physics steps played",
    "change of the step",
)


class Played(NamedTuple):
    """A generation that played all rollouts: values, falls and control steps, shape (n, k)."""

    values: np.ndarray
    fell: np.ndarray
    steps: np.ndarray


class Raced(NamedTuple):
    """What races on it come to: shares of races, rollouts, physics steps, and of the search's step, squared."""

    another: float
    rollouts: float
    steps: float
    change: float


def play(scenario: Scenario, candidates: Sequence[np.ndarray], seeds: np.ndarray, progress: Progress) -> Played:
    """Play all rollouts of a generation; seeds have the shape (n, k)."""
    jobs = [Job(theta, int(seed)) for theta, row in zip(candidates, seeds, strict=True) for seed in row]
    done = episodes(scenario, jobs, workers=-1, progress=progress)
    columns = zip(*((episode.value, episode.fell, episode.steps) for episode in done), strict=True)
    return Played(*(np.array(column).reshape(seeds.shape) for column in columns))


def race_again(played: Played, error: float, races: int = RACES) -> Raced:
    """Race on a generation that has played everything."""
    whole, races_run, (candidates, rollouts) = played.values.mean(axis=1), [], played.values.shape
    for number in range(races):
        race = Race(candidates, rollouts, error, lambda rows: rows.mean(axis=1), np.random.default_rng(number))
        while pairs := race.pairs():
            race.take([played.values[pair] for pair in pairs])
        there = np.isfinite(race.values)
        winner = np.argmax(np.where(there.all(axis=1), whole, -np.inf))
        another = float(winner != np.argmax(whole))
        weights = weigh(whole)
        change = ((weigh(race.worths) - weights) ** 2).sum() / (weights**2).sum()
        races_run.append((another, there.mean(), played.steps[there].sum() / played.steps.sum(), change))
    return Raced(*(float(share) for share in np.mean(races_run, axis=0)))


def read_played(path: Path | None, shape: tuple[int, int]) -> list[Played]:
    """Return the generations that a file has; none if there is no file.

    Raises:
        SystemExit: They are of other sizes.
    """
    if path is None or not path.exists():
        return []
    with np.load(path) as file:
        generations = [Played(*rows) for rows in zip(*(file[name] for name in Played._fields), strict=True)]
    if any(played.values.shape != shape for played in generations):
        raise SystemExit(f"{path}: was played with other candidates or rollouts; name another file")
    return generations


def cost_of_coarse(world: BulletWorld, scenario: Scenario) -> float:
    """Return CPU time at the coarse physics period / at the fine one, median of pairs of walks."""
    fine, coarse = (replace(scenario, world=replace(world, step=step)).prepare({}) for step in (FINE, COARSE))
    envs, theta = [fine.make(), coarse.make()], fine.policy.initial
    taken = np.zeros((PAIRS + 1, 2))
    for seed in range(PAIRS + 1):  # the first one compiles
        for n, (variant, env) in enumerate(zip((fine, coarse), envs, strict=True)):
            begin = time.process_time()
            rollout(variant, env, theta, seed)
            taken[seed, n] = time.process_time() - begin
    return float(np.median(taken[1:, 1] / taken[1:, 0]))


def main() -> None:
    """Play, race again, and print."""
    parser = argparse.ArgumentParser(description="What racing saves of a search in which all rollouts are played.")
    for name, default in (("candidates", 150), ("generations", 10), ("rollouts", 20), ("seed", 1)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--error", type=float, default=0.05)
    parser.add_argument("--step", type=float, default=0.002, help="physics period [s]")
    parser.add_argument("--played", type=Path, help="npz file of what was played, of the same settings")
    options, console, rows, races = parser.parse_args(), Console(), [], []
    shape = (options.candidates, options.rollouts)
    world, policy = BulletWorld(robot="nao", effects={}, start_noise=0.02, step=options.step), WalkEngine()
    plain = Scenario(world, Walk(), policy, SIM, TorqueNoise())
    scenario = plain.prepare({})
    seed = derive_seed(options.seed, "optimize")
    search = CmaEs(options.candidates, options.generations).start(policy.initial, policy.scale, seed)
    generations = read_played(options.played, shape)
    with console.progress(options.generations * math.prod(shape), "playing all") as progress:
        for index in range(options.generations):
            candidates = search.ask()
            if index < len(generations):
                progress.advance(math.prod(shape), worked=False)
            else:
                seeds = [derive_seed(options.seed, "optimize", index, *place) for place in np.ndindex(shape)]
                generations.append(play(scenario, candidates, np.reshape(seeds, shape), progress))
                if options.played:
                    values, fell, steps = map(np.stack, zip(*generations, strict=True))
                    np.savez(options.played, values=values, fell=fell, steps=steps)
            played = generations[index]
            search.tell(played.values.mean(axis=1).tolist())
            raced = race_again(played, options.error)
            races.append(raced)
            best = f"{100.0 * played.values.mean(axis=1).max():.1f}"
            rows.append((index + 1, best, f"{played.fell.mean():.3f}", *(f"{share:.3f}" for share in raced)))
            console.status("\t".join(map(str, rows[-1])))
    rows.append(("mean", "", "", *(f"{share:.3f}" for share in np.mean(races, axis=0))))
    console.table(f"optimizer.race={options.error:g}", COLUMNS, rows)
    cost = cost_of_coarse(world, plain)
    console.status(f"a walk at {1000 * COARSE:g} ms costs {cost:.2f} of one at {1000 * FINE:g} ms")


if __name__ == "__main__":
    from gsl_benchmarks import race  # workers import what they run

    race.main()
