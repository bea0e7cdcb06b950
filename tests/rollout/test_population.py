"""A batch of rollouts depends on its jobs alone."""

from __future__ import annotations

import os
import pickle
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import joblib
import numpy as np
import pytest
from scenarios import QUIET, arm, walk

from gsl.core.compiling import count_compilation, is_compiling
from gsl.core.trajectory import Trajectory
from gsl.errors import GslError
from gsl.rollout import parallel
from gsl.rollout.parallel import Job, episodes, trajectories
from gsl.rollout.rollout import Scenario, rollout
from gsl.worlds.bullet import BulletWorld

pytestmark = pytest.mark.slow


def _jobs(scenario: Scenario, count: int = 4) -> list[Job]:
    rng = np.random.default_rng(0)
    start = scenario.policy.initial
    return [Job(start + 0.02 * scenario.policy.scale * rng.standard_normal(len(start)), 10 + k) for k in range(count)]


def _bytes(trajectories: list[Trajectory]) -> list[bytes]:
    return [entry.position.tobytes() + entry.velocity.tobytes() + entry.reward.tobytes() for entry in trajectories]


def _run(scenario: Scenario, jobs: list[Job], workers: int) -> list[Trajectory]:
    with QUIET.progress(len(jobs), "") as progress:
        return trajectories(scenario, jobs, workers=workers, progress=progress)


def test_the_number_and_order_of_workers_change_no_bit() -> None:
    scenario = walk()
    jobs = _jobs(scenario)
    alone, together, reversed_ = _run(scenario, jobs, 1), _run(scenario, jobs, 2), _run(scenario, jobs[::-1], 2)
    assert _bytes(alone) == _bytes(together) == _bytes(reversed_[::-1])


def test_so_few_workers_that_one_is_left_are_none_beside_this_process() -> None:
    scenario = walk()
    jobs = _jobs(scenario, 2)
    assert _bytes(_run(scenario, jobs, 1)) == _bytes(_run(scenario, jobs, -joblib.cpu_count()))


def test_an_episode_is_the_summary_of_its_trajectory() -> None:
    scenario = arm()
    jobs = _jobs(scenario, 2)
    with QUIET.progress(2, "") as progress:
        short = episodes(scenario, jobs, workers=1, progress=progress)
    long = _run(scenario, jobs, 1)
    assert [(episode.value, episode.fell, episode.steps) for episode in short] == [
        (t.value, t.ended_in_a_fall, len(t)) for t in long
    ]


def test_a_rollout_after_a_very_short_one_is_the_same() -> None:
    scenario = walk()
    env = scenario.make()
    first = rollout(scenario, env, scenario.policy.initial, 3)
    rollout(walk(duration=0.02), env, scenario.policy.initial, 4)
    assert _bytes([first]) == _bytes([rollout(scenario, env, scenario.policy.initial, 3)])


def _dies_once(marker: Path, frozen: bytes, job: Job) -> int:
    if job.seed == 12 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return job.seed


def _dies_at_first(marker: Path, frozen: bytes, job: Job) -> int:
    own = marker.with_name(f"{job.seed}")
    if not own.exists():
        own.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return job.seed


def _dies(marker: Path, frozen: bytes, job: Job) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


def _compiles(seen: Path, frozen: bytes, job: Job) -> int:
    count_compilation(1)
    while not seen.exists():
        time.sleep(0.01)
    count_compilation(-1)
    return job.seed


def _dies_compiling(marker: Path, frozen: bytes, job: Job) -> int:
    count_compilation(1)
    _dies_once(marker, frozen, job)
    count_compilation(-1)
    return job.seed


def _in_parallel(function: Callable[..., int], tmp_path: Path) -> list[int]:
    jobs = [Job(np.zeros(1), seed) for seed in range(10, 16)]
    with QUIET.progress(len(jobs), "") as progress:
        return parallel.in_parallel(partial(function, tmp_path / "died"), arm(), jobs, 2, progress)


def test_it_is_seen_when_a_worker_compiles_until_it_is_done_or_dead(tmp_path: Path) -> None:
    def look() -> None:
        while not is_compiling():
            time.sleep(0.01)
        (tmp_path / "died").touch()

    watching = threading.Thread(target=look)
    watching.start()
    assert _in_parallel(_compiles, tmp_path) == [*range(10, 16)]
    watching.join()
    assert not is_compiling()
    (tmp_path / "died").unlink()
    assert _in_parallel(_dies_compiling, tmp_path) == [*range(10, 16)]
    assert not is_compiling()


class Closure:
    """A grounding of a user's own that holds a function without a name."""

    def __init__(self) -> None:
        self.change = lambda action: action

    def start(self, *_: object) -> Closure:
        return self


def test_a_component_with_a_closure_is_refused_in_one_line() -> None:
    scenario = replace(walk(), grounding=Closure())  # type: ignore[arg-type]
    with pytest.raises(GslError, match=r"cannot go to the worker processes .*lambda.*; give its object plain fields"):
        _run(scenario, _jobs(scenario, 1), 1)


def test_a_world_whose_effect_hooks_a_closure_goes_to_workers() -> None:
    world = BulletWorld(robot="nao", effects={})
    vars(world)["plant"] = replace(world.plant, hook=lambda motion, time: 0.0 * motion[0])
    assert pickle.loads(pickle.dumps(world)).plant.hook is None  # built anew from the effects, which have none
    assert pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(world)))) == world


def test_a_killed_worker_costs_only_its_own_jobs(tmp_path: Path) -> None:
    assert _in_parallel(_dies_once, tmp_path) == list(range(10, 16))


def test_workers_may_die_more_often_than_in_vain(tmp_path: Path) -> None:
    jobs = [Job(np.zeros(1), seed) for seed in range(2 * (parallel.TRIES + 1))]  # two workers may die at a time
    with QUIET.progress(len(jobs), "") as progress:
        done = parallel.in_parallel(partial(_dies_at_first, tmp_path / "died"), arm(), jobs, 2, progress)
    assert done == [job.seed for job in jobs]


def test_workers_that_always_die_end_in_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(GslError, match="workers=1"):
        _in_parallel(_dies, tmp_path)
