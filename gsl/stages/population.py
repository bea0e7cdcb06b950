"""Many rollouts on all cores: the result depends on the jobs, not on who does them or when.

joblib spreads them (loky on one machine; `joblib.parallel_config` chooses another engine, such as dask). If a worker
dies, what has arrived is kept and only the missing jobs are tried again.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gsl.core.trajectory import Trajectory
from gsl.errors import GslError
from gsl.stages.rollout import Scenario, rollout

TRIES = 3


class Job(NamedTuple):
    """One rollout to do: parameters, shape (n_parameters,), and seed."""

    parameters: np.ndarray
    seed: int


class Episode(NamedTuple):
    """What a search needs of a rollout; `outcome` is what the task reports of it, by name with unit."""

    value: float
    fell: bool
    steps: int
    outcome: Mapping[str, float]


def trajectories(scenario: Scenario, jobs: Sequence[Job], *, workers: int, progress: Any) -> list[Trajectory]:
    """Return the trajectories of all jobs, in their order."""
    return _in_parallel(_trajectory, scenario, jobs, workers, progress)


def episodes(scenario: Scenario, jobs: Sequence[Job], *, workers: int, progress: Any) -> list[Episode]:
    """Return value, fall and length of all jobs, in their order."""
    return _in_parallel(_episode, scenario, jobs, workers, progress)


def _in_parallel(function: Any, scenario: Scenario, jobs: Sequence[Job], workers: int, progress: Any) -> list[Any]:
    frozen = pickle.dumps(scenario)
    done: dict[int, Any] = {}
    for _ in range(TRIES):
        missing = [index for index in range(len(jobs)) if index not in done]
        for index, result in _arriving(function, frozen, jobs, missing, workers):
            done[index] = result
            progress.advance()
        if len(done) == len(jobs):
            return [done[index] for index in range(len(jobs))]
    raise GslError(
        f"worker processes died {TRIES} times in one batch of rollouts; try workers=1 or look at free memory"
    )


def _arriving(function: Any, frozen: bytes, jobs: Sequence[Job], missing: list[int], workers: int) -> Iterator[Any]:
    """Yield (index, result) as they come, until a worker dies."""
    import joblib
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    if workers == 1:
        yield from ((index, function(frozen, jobs[index])) for index in missing)
        return
    parallel = joblib.Parallel(n_jobs=workers, batch_size=1, return_as="generator_unordered")
    try:
        yield from parallel(joblib.delayed(_numbered)(function, frozen, jobs[index], index) for index in missing)
    except TerminatedWorkerError:
        return


def _numbered(function: Any, frozen: bytes, job: Job, index: int) -> tuple[int, Any]:
    return index, function(frozen, job)


def _trajectory(frozen: bytes, job: Job) -> Trajectory:
    scenario, env = _standing_by(frozen)
    return rollout(scenario, env, job.parameters, job.seed)


def _episode(frozen: bytes, job: Job) -> Episode:
    scenario, env = _standing_by(frozen)
    done = rollout(scenario, env, job.parameters, job.seed)
    return Episode(done.value, done.ended_in_a_fall, len(done), scenario.task.outcome(scenario.world.layout, done))


_STANDING: dict[bytes, tuple[Scenario, Any]] = {}  # what this process has ready, one at most


def _standing_by(frozen: bytes) -> tuple[Scenario, Any]:
    """Return this process' scenario with its environment, kept from one job to the next."""
    if frozen not in _STANDING:
        for _, env in _STANDING.values():
            env.close()
        _STANDING.clear()
        scenario = pickle.loads(frozen)  # noqa: S301  our own bytes, from the parent process
        _STANDING[frozen] = scenario, scenario.make()
    return _STANDING[frozen]
