"""Normal equations of parameters, which all joints share, and of the calibration, which is each joint's own.

Shifts of two joints never stand in one equation. So the joints are solved for one by one, and the parameters after
them by the Schur complement: as exact as the whole matrix and a hundred times as quick.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.log.residual import weight
from gsl.diagnosis.simulate.calibration import SPREADS

RIDGE, LEAST = 1e-9, 1e-12  # on parameters that change nothing: as a share of the largest, and alone


@dataclass(frozen=True)
class Normal:
    """Normal equations of p parameters and of 7 shifts of each joint.

    Attributes:
        own: Of the parameters, shape (p, p).
        cross: Of parameters and shifts, shape (n_joints, 7, p).
        shifts: Of each joint's shifts, shape (n_joints, 7, 7).
        right: Right-hand side of the parameters, shape (p,).
        below: Of the shifts, shape (n_joints, 7, 1).
    """

    own: np.ndarray
    cross: np.ndarray
    shifts: np.ndarray
    right: np.ndarray
    below: np.ndarray

    @classmethod
    def of(cls, z: np.ndarray, own: np.ndarray, slopes: np.ndarray, at: np.ndarray, spread: float) -> Normal:
        """Return the equations of a step.

        Args:
            z: Residuals, shape (W, scored, n_joints).
            own: Their derivatives to the parameters, shape (p, W, scored, n_joints).
            slopes: To the shifts, shape (7, W, scored, n_joints).
            at: Shifts, shape (7, n_joints).
            spread: Of the shifts, as a share of the usual one.
        """
        w = weight(z)
        weighted, precision = own * w, 1.0 / (spread * SPREADS) ** 2
        matrix = np.einsum("awsj,bwsj->ab", weighted, own)
        ridge = np.diag(RIDGE * np.abs(np.diag(matrix)) + LEAST)
        blocks = np.einsum("awsj,wsj,bwsj->jab", slopes, w, slopes, optimize=True) + np.diag(precision)
        below = -np.einsum("awsj,wsj->ja", slopes, w * z) - precision * at.T
        return cls(
            matrix + ridge,
            np.einsum("awsj,bwsj->jba", weighted, slopes),
            blocks,
            -np.einsum("awsj,wsj->a", weighted, z),
            below[..., None],
        )

    def solve(self, damping: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return the step of the parameters, shape (p,), and of the shifts, shape (7, n_joints).

        Args:
            damping: Added to the diagonal, as a share of it (Marquardt 1963).
        """
        answer = self._answer(damping)
        answers, alone = answer[..., :-1], answer[..., -1]
        schur = self._schur(answers, damping)
        step = np.linalg.solve(schur, self.right - np.einsum("jap,ja->p", self.cross, alone))
        return step, (alone - answers @ step).T

    @property
    def covariance(self) -> np.ndarray:
        """Of the parameters with the shifts free, shape (p, p)."""
        return np.linalg.inv(self._schur(self._answer(0.0)[..., :-1], 0.0))

    def _answer(self, damping: float) -> np.ndarray:
        """Return how the shifts answer to each parameter and, last, to the residuals, shape (n_joints, 7, p + 1)."""
        diagonal = np.eye(self.shifts.shape[1]) * self.shifts
        return np.linalg.solve(self.shifts + damping * diagonal, np.concatenate([self.cross, self.below], axis=2))

    def _schur(self, answers: np.ndarray, damping: float) -> np.ndarray:
        own = self.own + damping * np.diag(np.diag(self.own))
        return np.asarray(own - np.einsum("jap,jaq->pq", self.cross, answers))
