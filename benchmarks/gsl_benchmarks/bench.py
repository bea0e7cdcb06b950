"""What things cost, as ratios of CPU time that are measured side by side in one run."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gsl.core.console import Console as AnyConsole
from gsl.core.console import Silent
from gsl.core.described import describe
from gsl.core.interfaces import SIM
from gsl.core.scratch import Scratch
from gsl.core.trajectory import Batch, Trajectory
from gsl.grounding.none import NoGrounding
from gsl.policies.walk_engine import WalkEngine
from gsl.report.console import Console
from gsl.rollout.parallel import Job, in_parallel, trajectories
from gsl.rollout.rollout import Scenario
from gsl.storage.trajectories import write
from gsl.tasks.walk import Walk
from gsl.worlds.bullet import BulletWorld
from gsl_benchmarks.loop import LearnedWorld, loops, make_untrained

FIGURES: Mapping[str, tuple[str, float | None]] = {
    "loop_ratio": ("control loop / bare physics steps", 1.20),
    "loop_ratio_grounded": ("the same with an MLP grounding", 1.30),
    "loop_ratio_servo": ("the same with a learned servo", 1.30),
    "worker_inflation": ("rollouts in 2 processes / in one", 1.05),
    "reload_share": ("reload / rollout", 0.01),
    "io_share": ("writing trajectories / making them", 0.01),
    "help_cpu_ms": ("gsl --help, ms", 150.0),
    "step_us": ("bare physics step, µs", None),
    "rollouts_per_hour": ("rollouts in an hour of one core", None),
    "paper_hours": ("a search of the paper's size, core hours", None),
}
"""What each figure is, and the most it should be."""

REPEATS = 9
ROLLOUTS, WORKERS, ROUNDS = 24, 2, 3
PAPER = 150 * 10 * 20  # rollouts of a search (the paper's section 6.4)
EPISODES = 30  # in the file whose writing is measured


def run_bench(console: Console) -> None:
    """Measure everything, and print a table or exactly the figures as JSON."""
    figures = measure(console)
    rows = [judge(name, figures[name]) for name in FIGURES]
    title = f"CPU time of π0 in nao_ideal, {os.cpu_count()} cores"
    console.table(title, ("figure", "is", "measured", "target", ""), rows)
    if console.json:
        console.result(figures)


def measure(console: Console) -> dict[str, float]:
    """Return all figures by name."""
    world = BulletWorld(robot="nao", effects={})
    scenario = Scenario(world, Walk(), WalkEngine(), SIM, NoGrounding())
    console.status("control loops without grounding")
    bare = loops(scenario, REPEATS)
    console.status("control loops with an MLP grounding")
    grounded = loops(make_untrained(scenario), REPEATS)
    console.status("control loops with a learned servo")
    learned = loops(replace(scenario, world=LearnedWorld(world)), REPEATS)
    console.status(f"{ROLLOUTS} rollouts in one process and in {WORKERS}")
    inflation, seconds, made = measure_workers(scenario, console)
    return {
        "loop_ratio": bare.ratio,
        "loop_ratio_grounded": grounded.ratio,
        "loop_ratio_servo": learned.ratio,
        "worker_inflation": inflation,
        "reload_share": bare.reload_seconds / bare.seconds,
        "io_share": _writing(scenario, made) / (EPISODES / ROLLOUTS * seconds),
        "help_cpu_ms": 1e3 * _help(),
        "step_us": bare.step_us,
        "rollouts_per_hour": 3600.0 / bare.seconds,
        "paper_hours": PAPER * bare.seconds / 3600.0,
    }


def judge(name: str, value: float) -> tuple[str, ...]:
    """Return a figure's row: name, meaning, value, target, and whether it keeps to it."""
    meaning, target = FIGURES[name]
    digits = 4 if name.endswith("_share") else 2 if value < 10.0 else 0
    limit = "" if target is None else f"{target:g}"
    verdict = "" if target is None else "ok" if value <= target else "over"
    return name, meaning, f"{value:.{digits}f}", limit, verdict


def measure_workers(
    scenario: Scenario, console: AnyConsole, rollouts: int = ROLLOUTS
) -> tuple[float, float, list[Trajectory]]:
    """Return CPU in workers / serially, serial CPU of all rollouts [s] and what they made; the two ways take turns."""
    parameters = scenario.policy.initial
    jobs = [Job(parameters, seed) for seed in range(rollouts)]
    share, serial, spread = rollouts // ROUNDS, [], []
    made: list[Trajectory] = []
    with console.progress(2 * rollouts + 4 * WORKERS, "rollouts") as progress:
        for count in (1, WORKERS):  # compile, import, load
            trajectories(scenario, jobs[: 2 * count], workers=count, progress=progress)
        for first in range(0, rollouts, share):
            part = jobs[first : first + share]
            begin = time.process_time()
            made += trajectories(scenario, part, workers=1, progress=progress)
            serial.append(time.process_time() - begin)
            clocks, begin = _clocks(), time.process_time()
            trajectories(scenario, part, workers=WORKERS, progress=progress)
            own = time.process_time() - begin
            spread.append(own + sum(later - clocks[pid] for pid, later in _clocks().items()))
    return float(np.median(np.array(spread) / np.array(serial))), float(sum(serial)), made


def _clocks() -> dict[int, float]:
    """CPU time so far [s] of each worker that rollouts go to, by process number."""
    seconds: dict[int, float] = {}
    with Silent().progress(0, "") as unseen:
        while len(seconds) < WORKERS:
            seconds = dict(in_parallel(_clock, None, range(2 * WORKERS), WORKERS, unseen))
    return seconds


def _clock(_frozen: bytes, _job: int) -> tuple[int, float]:
    time.sleep(0.05)  # so that every worker gets one
    return os.getpid(), time.process_time()


def _writing(scenario: Scenario, made: Sequence[Trajectory]) -> float:
    """CPU time of writing a file of EPISODES trajectories [s]."""
    layout = scenario.world.layout
    episodes = tuple(made[index % len(made)] for index in range(EPISODES))
    about = {
        "robot": "nao",
        "role": SIM,
        "source": "gsl bench",
        "seed": 0,
        "world": describe(scenario.world),
        "policy": describe(scenario.policy),
    }
    batch = Batch(episodes, layout.joints, layout.control_period, about)
    with Scratch() as folder:
        return _median(lambda: write(Path(folder, "trajectories.parquet"), batch), time.process_time, 5)


def _help() -> float:
    """CPU time of `gsl --help` in a process of its own [s]."""
    command = [sys.executable, "-m", "gsl", "--help"]
    return _median(lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL), _children, 5)


def _children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _median(work: Callable[[], object], clock: Callable[[], float], repeats: int) -> float:
    work()
    taken = []
    for _ in range(repeats):
        begin = clock()
        work()
        taken.append(clock() - begin)
    return float(np.median(taken))
