"""Servo laws: what any servo could explain of the gap that a hypothesis leaves, and which form that has.

On top of a hypothesis every joint gets a law of its own, a sum of `servo_terms`. It is fitted to training windows with
a ridge towards the servo that it stands on. Held-out windows say what it is worth, as they do of any hypothesis. Joints
that shake have none: a log does not carry their phase.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.log.log import Log, spread
from gsl.diagnosis.log.residual import loss, weight
from gsl.diagnosis.settings import LawSettings
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.in_the_air import Effects
from gsl.diagnosis.simulate.simulator import Bench, Simulator
from gsl.diagnosis.verdict.servo_terms import (
    FORMS,
    GAIN,
    LAG,
    Replays,
    find_answers,
    find_scales,
    find_variables,
    make_terms,
    replay,
)

TAIL = 0.025  # of a bootstrap below a 95 % interval


@dataclass(frozen=True)
class Laws:
    """What a law for each servo explains beyond a hypothesis, in held-out windows.

    Attributes:
        windows: Which ones of the log, shape (W,).
        z: Residuals that are left there [floors], shape (W, scored, n_joints).
        gain: Cost of one residual that laws save, over joints that have one, with its lower end at 95 %, shape (2,).
        by_joint: The same of each joint, the lower ends such that all hold together, shape (2, n_joints).
        settings: What is of material size.
    """

    windows: np.ndarray
    z: np.ndarray
    gain: np.ndarray
    by_joint: np.ndarray
    settings: LawSettings

    @property
    def missing(self) -> float:
        """What laws surely explain, in units of what is of material size: over 1 the hypothesis lacks something."""
        sure = [np.where(low > 0.0, value, 0.0).max() for value, low in (self.gain, self.by_joint)]
        return float(max(sure[0] / self.settings.of_all, sure[1] / self.settings.of_joint))


@dataclass(frozen=True)
class Form:
    """What a joint does that the simulator does not, as a law says it.

    Attributes:
        joint: Its name.
        form: The one of FORMS whose terms explain most of it on their own.
        shares: Of what a law explains beyond a zero and gains, that each form explains.
        late: How much later the joint acts, all in all [s].
        x: What the form is a function of: see `find_variables`; empty for a lag, as is the next.
        y: Torque of the form's terms there, less its mean [N·m].
    """

    joint: str
    form: str
    shares: Mapping[str, float]
    late: float
    x: tuple[float, ...]
    y: tuple[float, ...]


@dataclass(frozen=True)
class _Joint:
    """One joint's residuals and the answers to its terms.

    Attributes:
        z: Residuals of training windows and of held-out ones [floors], shapes (W, scored).
        answers: To its terms and to a late log, see `find_answers`, shapes (K, W, scored).
        terms: Of the held-out windows, without the late log, shape (K - 1, W, T).
        forms: Of each term, shape (K,).
        folds: Of each training window, shape (W,).
        settings: Of the fit.
    """

    z: tuple[np.ndarray, np.ndarray]
    answers: tuple[np.ndarray, np.ndarray]
    terms: np.ndarray
    forms: np.ndarray
    folds: np.ndarray
    settings: LawSettings

    def fit(self, form: str | None = None) -> np.ndarray:
        """Return the factors of all terms, or of one form's, by the ridge that folds of the training windows like."""
        z, chosen = self.z[0], np.full(len(self.forms), form is None) | np.isin(self.forms, [GAIN, form or GAIN])
        sizes = np.sqrt((self.answers[0][chosen] ** 2).mean(axis=(1, 2))) + 1e-9
        x = self.answers[0][chosen] / sizes[:, None, None]
        costs = [sum(self._check(x, ridge, fold) for fold in np.unique(self.folds)) for ridge in self.settings.ridges]
        factors = np.zeros(len(self.forms))
        if min(costs) < float(loss(z).sum()):
            factors[chosen] = self._solve(z, x, self.settings.ridges[int(np.argmin(costs))]) / sizes
        return factors

    def left(self, factors: np.ndarray) -> np.ndarray:
        """Return the held-out residuals that a law leaves [floors], shape (W, scored)."""
        return np.asarray(self.z[1] + np.tensordot(factors, self.answers[1], 1))

    def level(self, factors: np.ndarray) -> float:
        """Return the held-out cost of one residual with a law."""
        return float(loss(self.left(factors)).mean())

    def _check(self, x: np.ndarray, ridge: float, fold: int) -> float:
        """Return what a fold costs by a law that is fitted to the others."""
        z, out = self.z[0], self.folds == fold
        factors = self._solve(z[~out], x[:, ~out], ridge)
        return float(loss(z[out] + np.tensordot(factors, x[:, out], 1)).sum())

    def _solve(self, z: np.ndarray, x: np.ndarray, ridge: float) -> np.ndarray:
        """Return the factors of columns of size 1, residuals counting less the larger they are."""
        flat, columns = z.ravel(), x.reshape(len(x), -1)
        factors, penalty = np.zeros(len(x)), ridge * len(flat) * np.eye(len(x))
        for _ in range(self.settings.reweightings):
            weighted = columns * weight(flat + factors @ columns)
            factors = np.linalg.solve(weighted @ columns.T + penalty, -weighted @ flat)
        return factors


@dataclass(frozen=True)
class _Fits:
    """Replays of both parts of a log, on which the laws of its joints are fitted.

    Attributes:
        train, held: The replays.
        windows: Which windows are held out, shape (W,).
        folds: Of each training window, shape (W,).
        calm: Indices of the joints that do not shake.
        settings: How.
    """

    train: Replays
    held: Replays
    windows: np.ndarray
    folds: np.ndarray
    calm: np.ndarray
    settings: LawSettings

    @classmethod
    def of(cls, log: Log, simulator: Simulator, effects: Effects, shifts: np.ndarray, how: LawSettings) -> _Fits | None:
        """Replay a log by a simulator with effects and a calibration, if it can be."""
        calm = np.flatnonzero(~log.comparison.shaking)
        if log.walking or not len(calm) or len(log.train) < how.folds:
            return None
        windows = [spread(index, how.windows) for index in (log.train, log.held_out)]
        benches = [Bench(simulator, log.pieces.take(index), log.comparison) for index in windows]
        train, held = (replay(bench, effects, shifts, how.lags) for bench in benches)
        if train is None or held is None:
            return None
        return cls(train, held, windows[1], np.arange(len(windows[0])) % how.folds, calm, how)  # few motions are unlike

    def joint(self, k: int) -> _Joint:
        """Return joint k."""
        usual, how = find_scales(self.train, k), self.settings
        (_, seen), (forms, terms) = (make_terms(part, k, usual, how) for part in (self.train, self.held))
        answers = find_answers(self.train, k, seen), find_answers(self.held, k, terms)
        z = self.train.z[..., k], self.held.z[..., k]
        return _Joint(z, answers, terms, np.append(forms, LAG), self.folds, how)


def learn_laws(
    log: Log, simulator: Simulator, effects: Effects, shifts: np.ndarray, settings: LawSettings | None = None
) -> Laws | None:
    """Return the laws on top of a hypothesis; None where all joints shake, a robot walks, or windows are few.

    Args:
        log: Its training windows are fitted, the held-out ones scored.
        simulator: What replays.
        effects: Of the hypothesis.
        shifts: Its calibration, shape (7, n_joints).
        settings: How.
    """
    fits = _Fits.of(log, simulator, effects, shifts, settings or LawSettings())
    return None if fits is None else _weigh(log, fits)


def _weigh(log: Log, fits: _Fits) -> Laws:
    """Return what laws save in the held-out windows of a log."""
    how = fits.settings
    z = fits.held.z.copy()
    for k in fits.calm:
        joint = fits.joint(int(k))
        z[..., k] = joint.left(joint.fit())
    saved, sample = loss(fits.held.z) - loss(z), log.pieces.take(fits.windows).samples
    sums = np.array([saved[sample == k].sum(axis=(0, 1)) for k in np.unique(sample)])
    index = np.random.default_rng(0).integers(0, len(sums), (how.samples, len(sums)))
    drawn, mean = sums[index].sum(axis=1) / saved[..., 0].size, saved.mean(axis=(0, 1))
    gain = np.array([mean[fits.calm].mean(), np.quantile(drawn[:, fits.calm].mean(axis=1), TAIL)])
    return Laws(fits.windows, z, gain, np.array([mean, np.quantile(drawn, TAIL / len(fits.calm), axis=0)]), how)


def find_forms(log: Log, simulator: Simulator, settings: LawSettings | None = None) -> tuple[Form, ...]:
    """Return what joints do that the simulator as it is does not, of those for which laws explain most.

    A hypothesis that is wrong bends gains and inertias to make up for what it lacks; the simulator as it is has no such
    bends.

    Args:
        log: See `learn_laws`.
        simulator: What replays.
        settings: How.
    """
    none = no_shifts(len(log.joints))
    fits = _Fits.of(log, simulator, {}, none, how := settings or LawSettings())
    if fits is None:
        return ()
    gains, kp = _weigh(log, fits).by_joint[0], simulator.plant.servo.kp
    worst = [int(k) for k in np.argsort(-gains)[: how.listed] if gains[k] > how.least_share * gains.max()]
    return tuple(_describe(fits, k, log.joints[k], float(kp[k])) for k in worst)


def _describe(fits: _Fits, k: int, name: str, stiffness: float) -> Form:
    """Return what joint k does, whose servo has a stiffness [N·m/rad]."""
    joint, held = fits.joint(k), fits.held
    alone, whole = {form: joint.fit(form) for form in FORMS}, joint.fit()
    after, own = joint.level(whole), joint.level(alone[GAIN])
    beyond = max(own - after, 1e-9)
    shares = {form: float(np.clip((own - joint.level(law)) / beyond, 0.0, 1.0)) for form, law in alone.items()}
    form = max(shares, key=lambda key: shares[key]) if beyond > fits.settings.of_joint else GAIN
    speed = held.speed[:, held.warm_up :, k]
    moved = held.floor[k] * np.tensordot(whole, joint.answers[1], 1)
    late = -float((moved * speed).sum() / max((speed**2).sum(), 1e-12))
    variable = find_variables(held, k, fits.settings).get(form)
    if variable is None:
        return Form(name, form, shares, late, (), ())
    law = np.where(joint.forms == form, alone[form], 0.0)[:-1]
    torque = stiffness * np.tensordot(law, joint.terms, 1)
    torque -= torque.mean()
    parts = np.array_split(np.argsort(variable, axis=None), fits.settings.points)
    x, y = (tuple(float(values.ravel()[part].mean()) for part in parts) for values in (variable, torque))
    return Form(name, form, shares, late, x, y)
