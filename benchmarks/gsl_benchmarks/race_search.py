"""A study of what a raced search ends with: CMA-ES on a function that is as noisy as a walk and has a cliff.

`python -m gsl_benchmarks.race_search` searches with all rollouts and with a race, from the same seeds, and prints the
paired differences of docs/results/speed.md.
"""

from __future__ import annotations

import argparse
from typing import NamedTuple

import numpy as np

from gsl.core.statistics import mean_interval
from gsl.optimizers.cma_es import CmaEs
from gsl.optimizers.race import Race
from gsl.report.console import Console

PARAMETERS, CANDIDATES, GENERATIONS, ROLLOUTS = 12, 150, 10, 20
TOP, SLOPE, NOISE = 30.0, 8.0, 1.0  # [cm/s] the best speed, what a unit away from it costs, and sd of a rollout
CLIFF, WIDTH, OFTEN, RARELY = 0.15, 0.05, 0.5, 0.01  # where falls begin on the way to the best, and their chances
LEAST, MOST = -15.0, 10.0  # [cm/s] of a walk that ends in a fall
SIGMA = 0.15


class Outcome(NamedTuple):
    """What a search came to.

    Attributes:
        best: Expected value of the policy that it returns [cm/s].
        centre: The same of its last mean.
        played: Share of all rollouts.
        another: Share of generations that had another winner.
    """

    best: float
    centre: float
    played: float
    another: float


class Cliff:
    """Speed that rises towards a place beyond which walks fall; the place is drawn."""

    def __init__(self, rng: np.random.Generator) -> None:
        top = rng.normal(size=PARAMETERS)
        top /= np.linalg.norm(top)
        top[0] = abs(top[0]) + 0.3  # so that the way there leads over the cliff
        self.top = top

    def describe(self, theta: np.ndarray) -> tuple[float, float]:
        """Return speed [cm/s] and chance of a fall."""
        away = theta - self.top
        over = (theta[0] - 0.7 * self.top[0] - CLIFF) / WIDTH
        return TOP - SLOPE * float(away @ away), RARELY + OFTEN / (1.0 + float(np.exp(-over)))

    def expect(self, theta: np.ndarray) -> float:
        """Return the mean value of very many rollouts [cm/s]."""
        speed, chance = self.describe(theta)
        return (1.0 - chance) * speed + chance * (LEAST + MOST) / 2.0

    def play(self, theta: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the values of a candidate's rollouts, shape (ROLLOUTS,)."""
        speed, chance = self.describe(theta)
        walked = speed + NOISE * rng.standard_normal(ROLLOUTS)
        return np.where(rng.random(ROLLOUTS) < chance, rng.uniform(LEAST, MOST, size=ROLLOUTS), walked)


def search(seed: int, error: float) -> Outcome:
    """Search once; all rollouts of a candidate are drawn beforehand, so that the same seeds are the same walks."""
    cliff = Cliff(np.random.default_rng(seed))
    run = CmaEs(CANDIDATES, GENERATIONS, SIGMA).start(np.zeros(PARAMETERS), np.ones(PARAMETERS), seed)
    best, played, another = (-np.inf, np.zeros(PARAMETERS)), 0, 0
    for generation in range(GENERATIONS):
        candidates, rng = run.ask(), np.random.default_rng((seed, generation))
        values = np.array([cliff.play(theta, rng) for theta in candidates])
        draws = np.random.default_rng((seed, generation, 1))
        race = Race(CANDIDATES, ROLLOUTS, error, lambda rows: rows.mean(axis=1), draws)
        while pairs := race.pairs():
            race.take([values[pair] for pair in pairs])
        winner = int(np.argmax(np.where(race.counts == ROLLOUTS, race.worths, -np.inf)))
        played, another = played + int(race.counts.sum()), another + (winner != values.mean(axis=1).argmax())
        best = max(best, (race.worths[winner], candidates[winner]), key=lambda pair: pair[0])
        run.tell(race.worths.tolist())
    whole = GENERATIONS * CANDIDATES * ROLLOUTS
    return Outcome(cliff.expect(best[1]), cliff.expect(run.mean), played / whole, another / GENERATIONS)


def main() -> None:
    """Search and print."""
    parser = argparse.ArgumentParser(description="What a raced search ends with.")
    for name, default in (("searches", 20), ("seed", 201)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--error", type=float, default=0.05)
    options, console = parser.parse_args(), Console()
    pairs = list[tuple[Outcome, Outcome]]()
    with console.progress(options.searches, "searching twice") as progress:
        for seed in range(options.seed, options.seed + options.searches):
            pairs.append((search(seed, 0.0), search(seed, options.error)))
            progress.advance()
    whole, raced = np.array(pairs).transpose(1, 2, 0)
    rows = list[tuple[str, ...]]()
    for name, before, after in zip(Outcome._fields, whole, raced, strict=True):
        apart = mean_interval(after - before)
        difference = f"{apart.mean:+.3f} ({apart.lower:+.3f} to {apart.upper:+.3f})"
        rows.append((name, f"{before.mean():.3f}", f"{after.mean():.3f}", difference))
    console.table(f"optimizer.race={options.error:g}", ("", "all rollouts", "raced", "difference (95 %)"), rows)


if __name__ == "__main__":
    main()
