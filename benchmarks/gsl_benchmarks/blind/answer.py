"""An answer: what the diagnosis, or a baseline, says of one case, from its log alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gsl.core.body import Robot, lumped
from gsl.core.plant import Plant
from gsl.core.trajectory import Batch
from gsl.diagnosis.arena import arena_of
from gsl.diagnosis.diagnose import diagnosed
from gsl.diagnosis.document import document
from gsl.diagnosis.experiment import experiment
from gsl.diagnosis.options import Options
from gsl.diagnosis.reference import calibrated_on
from gsl_benchmarks.blind.baselines import BASELINES

BULKY = ("replays", "horizon", "sides", "next_experiment")  # parts of a document that no mark asks for


@dataclass(frozen=True)
class Question:
    """What is known of a case.

    Attributes:
        log: Of the real robot.
        reference: Of the same robot without the cause, if there is one.
        plant: The simulator.
        step: Its physics period [s].
        walking: Whether the robot is on the ground.
    """

    log: Batch
    reference: Batch | None
    plant: Plant
    step: float
    walking: bool = False

    @property
    def robot(self) -> Robot:
        """Without fixed joints."""
        return lumped(self.plant.robot)


def answered(
    question: Question, options: Options, *, known_nulls: Sequence[float] | None, tick: Callable[[str], None]
) -> dict[str, Any]:
    """Return the document of a diagnosis with the time it took [s] and the gains of chance that it measured."""
    begin = time.perf_counter()
    found = diagnosed(
        question.log,
        question.robot,
        question.plant,
        question.step,
        options,
        tick,
        reference=question.reference,
        walking=question.walking,
        known_nulls=known_nulls,
    )
    told = document(found, seconds=time.perf_counter() - begin, null_gains=list(found.null_gains))
    return {key: value for key, value in told.items() if key not in BULKY}


def answered_by_baselines(
    question: Question, options: Options, tick: Callable[[str], None]
) -> dict[str, dict[str, Any]]:
    """Return what each baseline says, by name; with a reference they get the same calibrated simulator as we do.

    They work in the air: of a robot on the ground they say nothing.
    """
    if question.walking:
        return {}
    plant, step = question.plant, question.step
    found = experiment(question.log, question.robot)
    if question.reference is not None:
        base = calibrated_on(question.reference, question.robot, plant, step, options, tick)
        found, plant, options = base.taken_out(found, plant, options)
    arena = arena_of(found, plant, step, options, tick)
    answers = {}
    for name, baseline in BASELINES.items():
        begin = time.perf_counter()
        with np.errstate(all="ignore"):
            told = baseline(found, arena)
        answers[name] = {**told, "seconds": time.perf_counter() - begin}
    return answers
