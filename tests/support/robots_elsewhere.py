"""Requests for tests, and their runner as the robot's computer starts it: a Python with numpy, without gsl."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scenarios import QUIET

from gsl.core.body import Robot
from gsl.core.interfaces import REAL, Policy, Task
from gsl.errors import Waiting
from gsl.grounding.ane import ActionNoise
from gsl.real_robot.errand import Errand, Order, ask
from gsl.robots.catalogue import robot
from gsl.rollout.parallel import Job
from gsl.rollout.rollout import Scenario
from gsl.worlds.external import ExternalRobot


def four_feet() -> Robot:
    """Return a robot with four feet."""
    nao = robot("nao")
    return replace(nao, feet=(*nao.feet, *nao.feet))


def requested(
    folder: Path, policy: Policy, task: Task, thetas: dict[str, np.ndarray], *, noise: float = 0.0, **settings: Any
) -> Path:
    """Write a request of one episode for each policy and return its folder."""
    world = ExternalRobot(robot="nao", requests=str(folder / "asked"), **settings)
    scenario = Scenario(world, task, policy, REAL, ActionNoise(sd=noise))
    orders = [Order(name, Job(theta, index)) for index, (name, theta) in enumerate(thetas.items())]
    errand = Errand("", "A test.", until_fall=False, logs=True)
    try:
        ask(scenario, orders, errand, workers=1, console=QUIET)
    except Waiting as waiting:
        return waiting.request
    raise AssertionError("nobody has answered")


def run(folder: Path, *words: str, typed: str = "") -> subprocess.CompletedProcess[str]:
    """Run a request's runner, `typed` on its keyboard, like a background job, which SIGINT does not reach."""
    line = ["sh", "-c", 'trap "" INT; exec "$@"', "sh", sys.executable, "-I", str(folder / "runner.py"), *words]
    return subprocess.run(line, input=typed, capture_output=True, text=True, timeout=60, check=False)
