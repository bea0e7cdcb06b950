"""Many rollouts on all cores: the result depends on the jobs, not on who does them or when.

joblib spreads them on one machine, and dask where the user has chosen a cluster. If a worker dies, what has arrived is
kept and only the missing jobs are tried again.
"""

from __future__ import annotations

import os
import pickle
import threading
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import AfterValidator

from gsl.core.compiling import report_to, share_compilations
from gsl.core.console import Progress
from gsl.core.interruption import end_with_parent, processes_starting
from gsl.core.loaded import Stamp, pickle_with_code, stamps
from gsl.core.own_code import name_failures
from gsl.core.setting import setting
from gsl.core.trajectory import Trajectory
from gsl.errors import GslError
from gsl.rollout.cluster import find_cluster
from gsl.rollout.place import Place
from gsl.rollout.rollout import Scenario, rollout

TRIES = 5  # deaths of workers in a row, without a job done between, after which it is given up


def _some(workers: int) -> int:
    if workers == 0:
        raise ValueError("must not be 0; -1 is one process a core")
    return workers


Workers = Annotated[
    int, setting("processes; -1 is one a core, 1 none beside this one", ge=-64, le=1024), AfterValidator(_some)
]


def threads(workers: int) -> int:
    """Return how many processes or threads a setting of `workers` stands for."""
    from joblib import cpu_count

    return workers if workers > 0 else int(cpu_count())


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


def trajectories(scenario: Scenario, jobs: Sequence[Job], *, workers: int, progress: Progress) -> list[Trajectory]:
    """Return the trajectories of all jobs, in their order."""
    return in_parallel(play_trajectory, scenario, jobs, workers, progress)


def episodes(scenario: Scenario, jobs: Sequence[Job], *, workers: int, progress: Progress) -> list[Episode]:
    """Return value, fall and length of all jobs, in their order."""
    done = dict[int, Episode]()
    for index, episode in arriving(_episode, scenario, jobs, workers, progress):
        done[index] = episode
        progress.fell(episode.fell)
    return [done[index] for index in range(len(jobs))]


def in_parallel(function: Any, shared: Any, jobs: Sequence[Any], workers: int, progress: Progress) -> list[Any]:
    """Return `function(pickled shared, job)` of all jobs, in their order."""
    done = dict(arriving(function, shared, jobs, workers, progress))
    return [done[index] for index in range(len(jobs))]


def arriving(
    function: Any, shared: Any, jobs: Sequence[Any], workers: int, progress: Progress
) -> Iterator[tuple[int, Any]]:
    """Yield (index of job, `function(pickled shared, job)`) of all jobs, as they end."""
    if not jobs:
        return
    cluster = find_cluster()
    frozen = _pickle(shared, alone=workers == 1 and cluster is None)
    if cluster is not None:
        for index, result in cluster.arriving(function, frozen, jobs, threads(workers)):
            progress.advance()
            yield index, result
        return
    missing, in_vain = list(range(len(jobs))), 0
    while in_vain < TRIES:
        before = len(missing)
        for index, result in _arriving(function, frozen, jobs, tuple(missing), workers):
            missing.remove(index)
            progress.advance()
            yield index, result
        if not missing:
            return
        in_vain = in_vain + 1 if len(missing) == before else 0
    raise GslError(f"worker processes died {TRIES} times before a job was done; try workers=1 or look at free memory")


def _pickle(shared: Any, *, alone: bool) -> bytes:
    """Return what all workers need, pickled; what stands by of classes that were made anew since then is closed.

    Raises:
        GslError: A component of the user's own cannot be.
    """
    try:
        frozen, code = pickle_with_code(shared)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        advice = "give its object plain fields and functions of a module, no closures"
        raise GslError(f"a component cannot go to the worker processes ({error}); {advice}") from error
    if code != _standing.code:
        _standing.close()
        _standing.code = code
    if not alone and b"__main__" in frozen:
        problem = "a class of this script or notebook cannot be found by worker processes"
        raise GslError(f"{problem}; put it into a module of its own, or say workers=1")
    return frozen


def _arriving(function: Any, frozen: bytes, jobs: Sequence[Any], missing: Sequence[int], workers: int) -> Iterator[Any]:
    """Yield (index, result) as they come, until a worker dies."""
    import joblib
    from joblib._parallel_backends import LokyBackend
    from joblib.externals.loky.process_executor import TerminatedWorkerError
    from joblib.parallel import get_active_backend

    engine = get_active_backend()[0]
    # Threads, which joblib takes in a process of a launcher, would be as many times too many.
    if workers == 1 or joblib.effective_n_jobs(workers) == 1 or getattr(engine, "uses_threads", False):
        yield from ((index, function(frozen, jobs[index])) for index in missing)
        return
    begin = {"initializer": _begin_worker, "initargs": (os.getpid(), share_compilations(), stamps())}
    more = begin if isinstance(engine, LokyBackend) else {}
    # Without max_nbytes=None joblib leaves a file for every large array.
    parallel = joblib.Parallel(workers, batch_size=1, max_nbytes=None, return_as="generator_unordered", **more)
    try:
        with processes_starting():
            run = joblib.delayed(partial(_run_job, function, frozen, Place.here()))
            results = parallel(run(jobs[index], index) for index in missing)
        yield from results
    except TerminatedWorkerError:
        return


def _begin_worker(parent: int, marks: str, loaded: Sequence[Stamp]) -> None:
    """Begin; joblib starts other workers where what was loaded is not the same."""
    end_with_parent(parent)
    report_to(marks)


def _run_job(function: Any, frozen: bytes, place: Place, job: Any, index: int) -> tuple[int, Any]:
    place.enter()
    with name_failures():
        return index, function(frozen, job)


def play_trajectory(frozen: bytes, job: Job) -> Trajectory:
    """Return the trajectory of a job, in a worker that holds the scenario ready."""
    scenario, env = _standing_by(frozen)
    return rollout(scenario, env, job.parameters, job.seed)


def _episode(frozen: bytes, job: Job) -> Episode:
    scenario, env = _standing_by(frozen)
    done = rollout(scenario, env, job.parameters, job.seed)
    return Episode(done.value, done.ended_in_a_fall, len(done), scenario.task.outcome(scenario.world.layout, done))


class _StandingBy(threading.local):
    """What a thread of this process has ready, one scenario with its environment at most."""

    frozen: bytes | None = None
    ready: tuple[Scenario, Any]
    code: tuple[Any, ...] = ()

    def close(self) -> None:
        """Let go of the environment."""
        if self.frozen is not None:
            self.frozen = None
            self.ready[1].close()


_standing = _StandingBy()


def _standing_by(frozen: bytes) -> tuple[Scenario, Any]:
    """Return a scenario with its environment, kept from one job to the next."""
    if frozen != _standing.frozen:
        _standing.close()
        scenario = pickle.loads(frozen)  # noqa: S301  our own bytes, from the parent process
        _standing.ready, _standing.frozen = (scenario, scenario.make()), frozen
    return _standing.ready
