"""An answer: what the diagnosis, or a baseline, says of one case, from its log alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.plant import Plant
from gsl.core.trajectory import Batch
from gsl.diagnosis.diagnose import diagnose
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.options import Chance, Options
from gsl.diagnosis.search.reference import Nominal, calibrate_on
from gsl.diagnosis.verdict.document import document
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
        return lump(self.plant.robot)


def answer_question(
    question: Question, options: Options, *, chances: Sequence[Chance], tick: Callable[[str], None]
) -> dict[str, Any]:
    """Return the document of a diagnosis with the gains of chance that it measured."""
    options = replace(options, chances=tuple(chances))
    findings = diagnose(question.log, question.plant, question.step, options, tick, reference=question.reference)
    report = document(findings, chances=[list(chance) for chance in findings.chances])
    return {key: value for key, value in report.items() if key not in BULKY}


def answer_by_baselines(
    question: Question, options: Options, tick: Callable[[str], None]
) -> dict[str, tuple[dict[str, Any], float]]:
    """Return what each baseline says and the time it took [s], by name.

    With a reference they get the same calibrated simulator as we do. They work in the air: of a robot on the ground
    they say nothing.
    """
    if question.walking:
        return {}
    nominal = Nominal(question.plant, question.step)
    log = cut_log(question.log, question.robot)
    if question.reference is not None:
        base = calibrate_on(cut_log(question.reference, question.robot), nominal, options, tick)
        log, nominal, options = base.take_out(log, nominal, options)
    arena = nominal.problem(log, options, tick)
    answers = {}
    for name, baseline in BASELINES.items():
        begin = time.perf_counter()
        with np.errstate(all="ignore"):
            answer = baseline(log, arena)
        answers[name] = answer, time.perf_counter() - begin
    return answers
