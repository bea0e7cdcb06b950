"""What held-out windows say of a new servo: how far its cost lies from the old one's, in bootstraps over motions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gsl.diagnosis.log.residual import loss

SAMPLES = 1000  # of a bootstrap


def relative_changes(
    old: np.ndarray, new: np.ndarray, sample: np.ndarray, group: np.ndarray, groups: Sequence[str]
) -> dict[str, np.ndarray]:
    """Return the relative change of the robust cost, by group of joints, shape (SAMPLES,) each.

    Args:
        old: Residuals of the old servo [floors], shape (W, scored, n_joints).
        new: Of the new one.
        sample: What a bootstrap draws, by window, shape (W,).
        group: Of each joint, shape (n_joints,).
        groups: Their names.
    """
    rng, every = np.random.default_rng(0), np.unique(sample)
    costs = [loss(residuals).sum(axis=1) for residuals in (old, new)]
    sums = np.array([[cost[sample == k].sum(axis=0) for k in every] for cost in costs])
    before, after = sums[:, rng.integers(0, len(every), (SAMPLES, len(every)))].sum(axis=2)
    return {
        name: after[:, group == g].sum(axis=1) / before[:, group == g].sum(axis=1) - 1.0
        for g, name in enumerate(groups)
        if (group == g).any()
    }


def levels(z: np.ndarray, used: np.ndarray, group: np.ndarray, groups: Sequence[str]) -> dict[str, float]:
    """Return the root mean square of residuals by group, and of `all` [floors].

    Args:
        z: The residuals, shape (W, scored, n_joints).
        used: How many of a window count, by joint, shape (n_joints,).
        group: Of each joint, shape (n_joints,).
        groups: Their names.
    """
    square = (z**2).sum(axis=(0, 1))
    masks = {name: group == g for g, name in enumerate(groups)}
    masks = {"all": np.ones(len(used), dtype=bool)} | {name: mask for name, mask in masks.items() if mask.any()}
    return {name: float(np.sqrt(square[mask].sum() / (used[mask].sum() * len(z)))) for name, mask in masks.items()}
