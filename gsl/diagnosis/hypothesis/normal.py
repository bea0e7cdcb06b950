"""Normal equations of parameters, which all joints share, and of the calibration, which is each joint's own.

Shifts of two joints never stand in one equation, so each joint's are eliminated alone. What is left are the few
equations of the parameters (Schur complement); a step of the shifts follows from theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.log.residual import weight
from gsl.diagnosis.simulate.calibration import SPREADS

RIDGE, LEAST = 1e-9, 1e-12  # on parameters that change nothing: as a share of their own, and alone


@dataclass(frozen=True)
class Normal:
    """Normal equations of p parameters and of 7 shifts of each joint.

    Attributes:
        of_parameters: Of the parameters, shape (p, p).
        mixed: Of parameters and shifts, shape (n_joints, 7, p).
        of_shifts: Of each joint's shifts, shape (n_joints, 7, 7).
        right_of_parameters: Right-hand side of the parameters, shape (p,).
        right_of_shifts: Of the shifts, shape (n_joints, 7, 1).
    """

    of_parameters: np.ndarray
    mixed: np.ndarray
    of_shifts: np.ndarray
    right_of_parameters: np.ndarray
    right_of_shifts: np.ndarray

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
        ridge = np.diag(RIDGE * np.diag(matrix) + LEAST)
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
        step = np.linalg.solve(schur, self.right_of_parameters - np.einsum("jap,ja->p", self.mixed, alone))
        return step, (alone - answers @ step).T

    @property
    def covariance(self) -> np.ndarray:
        """Of the parameters with the shifts free, shape (p, p)."""
        return np.linalg.inv(self._schur(self._answer(0.0)[..., :-1], 0.0))

    def _answer(self, damping: float) -> np.ndarray:
        """Return how the shifts answer to each parameter and, last, to the residuals, shape (n_joints, 7, p + 1)."""
        diagonal = np.eye(self.of_shifts.shape[1]) * self.of_shifts
        return np.linalg.solve(
            self.of_shifts + damping * diagonal, np.concatenate([self.mixed, self.right_of_shifts], axis=2)
        )

    def _schur(self, answers: np.ndarray, damping: float) -> np.ndarray:
        own = self.of_parameters + damping * np.diag(np.diag(self.of_parameters))
        return np.asarray(own - np.einsum("jap,jaq->pq", self.mixed, answers))
