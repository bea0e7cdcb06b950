"""A small policy from Stable-Baselines3, trained in the plain simulator: what you bring."""

import sys

import gsl
from stable_baselines3 import PPO

own = {"config_dir": "my_conf", "trust": ["mark", "stable_baselines3"]}


def plain():
    return gsl.grounded_env(world="xl330_pendulum", task=gsl.make_task("mark", **own), policy=WIRING)


if __name__ == "__main__":
    pass
