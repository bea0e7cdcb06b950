"""All that a diagnosis came to, as reports and next experiments read it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import settings_of
from gsl.diagnosis.angles import effects_in_metres
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis
from gsl.diagnosis.hypothesis.problem import Problem
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.options import Chance, Options
from gsl.diagnosis.search.reference import Baseline
from gsl.diagnosis.search.selection import Selection
from gsl.diagnosis.simulate.calibration import HALF_STEP, calibrate, to_effects
from gsl.diagnosis.simulate.in_the_air import change
from gsl.diagnosis.simulate.simulator import Simulator
from gsl.diagnosis.verdict.self_test import Trial
from gsl.diagnosis.verdict.servo_law import Form, Laws
from gsl.diagnosis.verdict.verdict import Verdict
from gsl.effects.effect import effect_class, together
from gsl.storage.diagnosis_report import DIGITS

MEANING = 0.03  # spread of a value between two codes of one effect, share of its way from doing nothing. Estimate
TIMING = HALF_STEP / math.sqrt(3.0)  # spread of lags between simulators that are up to half a step apart [s]


@dataclass(frozen=True)
class Findings:
    """All that a diagnosis came to.

    Attributes:
        log: The log.
        problem: Where hypotheses competed.
        selection: What came of it.
        verdict: What can be said.
        chances: What chance gained in simulated logs.
        trials: Duels of the surviving causes in simulated logs.
        baseline: From the reference, if there is one.
        shift: Between the clocks of commands and measurements, taken out first [s], if they are apart.
        refuted: Effects that fitted but lost their claim to the name, with the reason.
        laws: What a law of each servo explains on top of the chosen hypothesis, where it can be learned.
        forms: What joints do that the simulator does not, where no effect explains it and a law does.
        options: How it was made.
    """

    log: Log
    problem: Problem
    selection: Selection
    verdict: Verdict
    chances: tuple[Chance, ...]
    trials: tuple[Trial, ...]
    baseline: Baseline | None
    shift: float = 0.0
    refuted: Mapping[str, str] = field(default_factory=dict)
    laws: Laws | None = None
    forms: tuple[Form, ...] = ()
    options: Options = field(default_factory=Options)

    @property
    def simulator(self) -> Simulator:
        """As the user has it, calibrated on the reference if there is one."""
        return self.problem.simulator

    @property
    def answer(self) -> Hypothesis:
        """The hypothesis that may be used: the chosen one if it may be named, else calibration alone."""
        return self.selection.chosen if self.verdict.names_causes else self.selection.none

    @property
    def shifts(self) -> np.ndarray:
        """The answer's calibration of the joints, shape (7, n_joints)."""
        return self.answer.fit.shifts[:, : len(self.log.joints)]

    @property
    def uncalibrated(self) -> Plant:
        """The simulator's robot with the answer's effects."""
        return change(self.simulator.plant, self.answer.effects)

    @property
    def corrected(self) -> Plant:
        """The simulator's robot with the answer's effects and calibration."""
        return calibrate(self.uncalibrated, self.shifts)

    @property
    def widening(self) -> float:
        """How much wider an interval is than noise alone makes it."""
        return self.options.verdict.widening(self.verdict.remaining)

    @property
    def scatter(self) -> np.ndarray:
        """What the chosen hypothesis' parameters are off by beside noise, shape (n_parameters,).

        That is their root mean square error in the self-test and, where the log is not of one of gsl's own simulators,
        what two simulators differ by that mean the same.
        """
        chosen = self.selection.chosen
        errors = [trial.errors for trial in self.trials if trial.truth == chosen.names]
        scatter = np.sqrt(np.mean(np.square(errors), axis=0)) if errors else np.zeros(len(chosen.start))
        if self.log.made_at is not None or not chosen.size:
            return scatter
        units = [settings_of(effect_class(own.effect))[name].unit for own in chosen.candidates for name in own.free]
        way = chosen.start - np.concatenate([candidate.neutral for candidate in chosen.candidates])
        return np.sqrt(scatter**2 + (MEANING * way) ** 2 + np.where(np.array(units) == "s", TIMING, 0.0) ** 2)

    @property
    def effects(self) -> dict[str, Any]:
        """What the simulator lacks: the reference's findings, the diagnosed effects, then the calibration; in metres.

        Every entry is one of a world's `effects:`; the calibration comes joint by joint. Where nothing may be named it
        is all there is.
        """
        joints = self.log.joints
        parts = [self.answer.effects, to_effects(joints, self.shifts, self.uncalibrated)]
        if self.baseline is not None:
            own = to_effects(joints, self.baseline.shifts, self.simulator.plant)
            parts = [self.baseline.effects, own, *parts]
        return join_effects(*(effects_in_metres(part, self.log.robot) for part in parts))


def join_effects(*parts: Mapping[str, Any]) -> dict[str, Any]:
    """Return several `effects:` mappings as one, numbers rounded to what a file should show."""
    return {name: [_round(entry) for entry in entries] for name, entries in together(parts).items()}


def _round(entry: Mapping[str, Any]) -> dict[str, Any]:
    return {key: round(float(value), DIGITS) if isinstance(value, float) else value for key, value in entry.items()}
