"""The physics that competes with a wiring fault: each joint's gains, friction, inertia, zero and delay.

They are fitted freely within the documented ranges of their effects. A wiring fault has to beat the best of them:
what they can explain is for the diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis.log.log import Cut, spread
from gsl.diagnosis.log.records import Pieces
from gsl.diagnosis.log.residual import loss, weight
from gsl.effects.effect import list_documented
from gsl.worlds.fits import fitting_step
from gsl.worlds.held import Held
from gsl.worlds.servo_state import COMMANDS

KP, KD, COULOMB, VISCOUS, ZERO, DELAY, INERTIA = range(7)
EFFECTS = (
    ("servo_gain", "kp"), ("servo_gain", "kd"), ("coulomb_friction", "torque"), ("viscous_friction", "coefficient"),
    ("zero_offset", "offset"), ("command_latency", "delay"), ("armature", "inertia"),
)  # fmt: skip
BEYOND = 1.5  # times the documented range that these parameters may go: its ends are estimates
PROBES = np.array([0.1, 0.2, 0.05, 0.05, 0.005, 0.004, 0.2])  # of finite differences; friction, inertia: see `_probe`
ROUNDS = 4  # of a fit
SHARES = (1.0, 0.3)  # of a step that are tried
RIDGE = 1e-3  # of the diagonal, and of half the range of each parameter
FIT_WINDOWS, CHECK_WINDOWS = 20, 40
# What servos of one make differ by: logarithms of gains, friction in shares of the documented range, zero [rad],
# delay [s], inertia in shares of its range; twice the spreads of the diagnosis' calibration. Estimate
MAKE = np.array([0.08, 0.14, 0.08, 0.03, 0.006, 0.001, 0.03])
WORST = 1e3  # floors that a diverging replay counts


@dataclass(frozen=True)
class Fit:
    """How well a log is explained.

    Attributes:
        parameters: Of the physics, shape (7, n_joints).
        cost: Mean robust cost of a held-out residual, shape (n_joints,); pure noise costs 0.96.
        rms: Of the held-out residuals [floors], shape (n_joints,).
        angle: Of the same [rad].
    """

    parameters: np.ndarray
    cost: np.ndarray
    rms: np.ndarray
    angle: np.ndarray


def parameter_bounds(plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest values of the parameters, gains as logarithms, shapes (7, 1)."""
    lower, upper = [], []
    for effect, name in EFFECTS:
        documented = list_documented(effect, plant.robot)[name]
        assert documented.lower is not None and documented.upper is not None
        lower.append(documented.lower)
        upper.append(documented.upper)
    low, high = np.array(lower), np.array(upper)
    high[[KP, KD]] = np.log(np.maximum(high[[KP, KD]], 1.0 / low[[KP, KD]])) + np.log(BEYOND)
    low[[KP, KD]] = np.log(low[[KP, KD]] / BEYOND)
    unit = plant.robot.torque_unit
    high[[COULOMB, VISCOUS]] *= max(1.0, unit)
    for row in (COULOMB, VISCOUS, DELAY, INERTIA):
        low[row], high[row] = 0.0, BEYOND * high[row]
    low[ZERO], high[ZERO] = BEYOND * low[ZERO], BEYOND * high[ZERO]
    return low[:, None], high[:, None]


def apply(plant: Plant, parameters: np.ndarray) -> Plant:
    """Return the plant with other servos; parameters of shape (7, n_joints)."""
    wide, servo = parameters[:, plant.robot.drive], plant.servo
    return plant.with_servo(
        kp=servo.kp * np.exp(wide[KP]),
        kd=servo.kd * np.exp(wide[KD]),
        coulomb=servo.coulomb + wide[COULOMB],
        viscous=servo.viscous + wide[VISCOUS],
        offset=servo.offset + wide[ZERO],
        delay=servo.delay + wide[DELAY],
        armature=servo.armature + wide[INERTIA],
    )


@dataclass(frozen=True)
class Contest:
    """A log that is explained by a simulator and its physics.

    Attributes:
        plant: The simulator.
        step: Its physics period [s].
        log: In windows.
        floor: Noise floor of its positions [rad], shape (n_joints,); joints that shake are compared like others.
        tick: Called after every replay.
    """

    plant: Plant
    step: float
    log: Cut
    floor: np.ndarray
    tick: Callable[[], None]

    @property
    def train(self) -> Pieces:
        """Windows for fitting."""
        return self.log.pieces.take(spread(self.log.train, FIT_WINDOWS))

    @property
    def held_out(self) -> Pieces:
        """Windows for checking."""
        return self.log.pieces.take(spread(self.log.held_out, CHECK_WINDOWS))

    def residual(self, plant: Plant, pieces: Pieces) -> np.ndarray:
        """Return residuals in floors, shape (W, scored, n_joints)."""
        self.tick()
        period, joints = self.log.period, pieces.real.shape[2]
        own = self.log.made_at == self.step  # the same errors on both sides; a robot has no step
        held = Held.of(plant, fitting_step(self.step, period), period, accurate=not own)
        windows: Any = pieces.windows  # in the air
        replay = held.replay(windows)[..., :joints]
        z = (replay - pieces.real)[:, pieces.warm_up :] / self.floor
        return np.clip(np.nan_to_num(z, nan=WORST), -WORST, WORST)

    def screen(self) -> np.ndarray:
        """Return the cost of the simulator with zeros of its own on the windows for fitting, shape (n_joints,)."""
        z = self.residual(self.plant, self.train)
        most = parameter_bounds(self.plant)[1][ZERO, 0] / self.floor
        return loss(z - np.clip(np.median(z, axis=(0, 1)), -most, most)).mean(axis=(0, 1))

    @property
    def count(self) -> int:
        """Number of residuals of a joint that are checked, times the joints."""
        pieces = self.held_out
        return len(pieces) * pieces.scored * pieces.real.shape[2]

    def fit(self, *, make: bool = False, late: bool = False) -> Fit:
        """Fit the physics joint by joint, and return how well it does on the windows for checking.

        Args:
            make: Only as far as servos of one make differ, which costs as it does in the diagnosis,
            late: but with any delay.
        """
        joints = self.log.pieces.real.shape[2]
        low, high = parameter_bounds(self.plant)
        high = np.minimum(high, np.where(np.arange(len(EFFECTS))[:, None] == DELAY, self._longest(), np.inf))
        x = np.clip(np.zeros((len(EFFECTS), joints)), low, high)
        pieces, probe = self.train, self._probe(high, joints)
        tight = self._make(high) if make else np.full((len(EFFECTS), 1), np.inf)
        tight[DELAY] = np.inf if late else tight[DELAY]

        def total(x: np.ndarray, z: np.ndarray) -> np.ndarray:
            return loss(z).sum(axis=(0, 1)) + ((x / tight) ** 2).sum(axis=0)

        z = self.residual(apply(self.plant, x), pieces)
        cost = total(x, z)
        for _ in range(ROUNDS):
            before, slopes = cost, self._slopes(x, z, probe, high, pieces)
            step = _solve(slopes, z, x, high - low, tight)
            for share in SHARES:
                other = np.clip(x + share * step, low, high)
                moved = self.residual(apply(self.plant, other), pieces)
                there = total(other, moved)
                better = there < cost
                x, z = np.where(better, other, x), np.where(better, moved, z)
                cost = np.where(better, there, cost)
                if better.all():
                    break
            if cost.sum() > 0.99 * before.sum():
                break
        return self._check(x)

    def _check(self, x: np.ndarray) -> Fit:
        z = self.residual(apply(self.plant, x), self.held_out)
        rms = np.sqrt((z**2).mean(axis=(0, 1)))
        return Fit(x, loss(z).mean(axis=(0, 1)), rms, rms * self.floor)

    def _longest(self) -> float:
        return (COMMANDS - 2) * self.log.period - float(self.plant.servo.delay.max())

    def _make(self, high: np.ndarray) -> np.ndarray:
        """Return what parameters of one make spread by, shape (7, 1)."""
        relative = np.isin(np.arange(len(EFFECTS)), [COULOMB, VISCOUS, INERTIA])
        return MAKE[:, None] * np.where(relative[:, None], high, 1.0)

    def _probe(self, high: np.ndarray, joints: int) -> np.ndarray:
        """Return the steps of finite differences, shape (7, n_joints)."""
        probe = np.repeat(PROBES[:, None], joints, axis=1)
        relative = [COULOMB, VISCOUS, INERTIA]
        probe[relative] *= high[relative]
        return probe

    def _slopes(self, x: np.ndarray, z: np.ndarray, probe: np.ndarray, high: np.ndarray, pieces: Pieces) -> np.ndarray:
        """Return derivatives of residuals, shape (7, W, scored, n_joints), of all joints at once."""
        slopes = []
        for row in range(len(EFFECTS)):
            step = np.where(x[row] + probe[row] > high[row], -probe[row], probe[row])
            other = x.copy()
            other[row] += step
            change = (self.residual(apply(self.plant, other), pieces) - z) / step
            slopes.append(np.where(np.abs(z) < WORST, change, 0.0))
        return np.array(slopes)


def _solve(slopes: np.ndarray, z: np.ndarray, x: np.ndarray, widths: np.ndarray, tight: np.ndarray) -> np.ndarray:
    """Return a step of robust least squares for each joint, shape (7, n_joints)."""
    w, scale = weight(z), 0.5 * widths
    steps = np.zeros_like(x)
    for k in range(x.shape[1]):
        j = slopes[..., k].reshape(len(slopes), -1) * scale
        own, weights = z[..., k].ravel(), w[..., k].ravel()
        matrix, right = (j * weights) @ j.T, -(j * weights) @ own
        prior = (scale[:, 0] / tight[:, 0]) ** 2
        matrix, right = matrix + np.diag(prior), right - prior * x[:, k] / scale[:, 0]
        size = float(np.trace(matrix))
        if size > 0.0 and np.isfinite(size):
            ridge = np.diag(matrix) + size / len(matrix)
            matrix += np.diag(RIDGE * ridge + 1e-9)
            steps[:, k] = np.linalg.solve(matrix, right) * scale[:, 0]
    return steps
