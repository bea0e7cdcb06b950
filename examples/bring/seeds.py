"""The whole way for several seeds of the trainer, one diagnosis for all: a row of the page's table for each.

    python examples/bring/seeds.py 1 2 3

What is there is not trained again.
"""

import argparse
import sys
from pathlib import Path

sys.path.append(".")  # where examples.bring.follow is found

from train import CONF, train

import gsl

EVALUATED = {
    "config_dir": CONF, "trust": ["examples.bring.follow", "stable_baselines3"], "task": "follow", "policy": "mine",
    "policies": None,
}  # fmt: skip


def measure(file: str, world: str) -> float:
    """Return the mean of fresh episodes of a policy [steps at the mark]."""
    place = {"world": world, "policy.file": f"{file}.zip", "name": f"{file}_in_{world}"}
    return gsl.run("evaluate", **EVALUATED, **place).metrics["returned"]["value"]


def main(seeds: list[int], steps: int, diagnosis: str) -> None:
    """Train, measure and print."""
    print("| seed | as it came, plain simulator | as it came, robot | trained on, robot |\n|---|---|---|---|")
    for seed in seeds:
        came, better = f"mine_{seed}", f"better_{seed}"
        if not Path(f"{came}.zip").is_file():
            train(steps, came, seed=seed)
        if not Path(f"{better}.zip").is_file():
            train(steps, better, start=came, grounded=diagnosis, seed=seed)
        pairs = ((came, "plain_pendulum"), (came, "real_pendulum"), (better, "real_pendulum"))
        values = [measure(file, world) for file, world in pairs]
        print(f"| {seed} | {' | '.join(f'{value:.1f}' for value in values)} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("seeds", type=int, nargs="+")
    parser.add_argument("--steps", type=int, default=120_000)
    parser.add_argument("--diagnosis", default="mine")
    main(**vars(parser.parse_args()))
