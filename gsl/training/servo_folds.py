"""Whole trajectories replayed with a learned servo, which learns from the same logs as a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from gsl.core.plant import Plant
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.log.records import Record
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.simulator import mean_errors
from gsl.training.learn_servo import document, learn_servo
from gsl.training.servo_replays import Replays


def servo_errors(
    exp: Log, plant: Plant, step: float, held: Sequence[Record], *, seed: int, threads: int
) -> tuple[list[float], Mapping[str, Any]]:
    """Return the mean absolute error of every held-out trajectory [rad], and what was learned.

    Args:
        exp: What is learned from; what it holds out itself says what is kept, whatever held it out.
        plant: What the servo stands on.
        step: Physics period [s].
        held: What is replayed; NaN where a replay diverges.
        seed: Of the first weights.
        threads: That replay side by side.

    Raises:
        InputError: The log shows too little motion to learn from.
    """
    learned = learn_servo(exp, plant, step, labelled=False, seed=seed, threads=threads)
    with ThreadPoolExecutor(threads) as pool:
        replays = Replays(plant, step, exp.period, threads, pool).having(learned.model)
        errors = mean_errors(replays, {}, no_shifts(replays.joints), held, exp.robot)
    return errors.mean(axis=1).tolist(), document(learned)
