"""How long many rollouts will take, by the clock of a few."""

from __future__ import annotations

import time

import numpy as np

from gsl.core.words import duration
from gsl.rollout.parallel import threads
from gsl.rollout.rollout import Scenario, rollout

TRIED = 2  # rollouts, after one that compiles
LONG = 2000  # rollouts: minutes of a walk; what is shorter shows its time left soon enough


def estimate(scenario: Scenario, parameters: np.ndarray, count: int, workers: int) -> str:
    """Return a line on how long rollouts of a policy will take on this machine; none where they are few.

    Args:
        scenario: With a grounding that is ready to act.
        parameters: Of a policy, shape (n_parameters,).
        count: Of the rollouts.
        workers: Processes.
    """
    if count < LONG:
        return ""
    processes, seconds = threads(workers), measure_rollout(scenario, parameters)
    return f"{count} rollouts at most: about {duration(seconds * count / processes)} on {processes} workers"


def measure_rollout(scenario: Scenario, parameters: np.ndarray) -> float:
    """Return the CPU time of a rollout of a policy [s], which does not grow with what else the machine does."""
    env = scenario.make()
    rollout(scenario, env, parameters, 0)  # compiles and loads
    begin = time.process_time()
    for seed in range(TRIED):
        rollout(scenario, env, parameters, 1 + seed)
    env.close()
    return (time.process_time() - begin) / TRIED
