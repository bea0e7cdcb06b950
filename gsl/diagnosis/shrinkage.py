"""Shrinkage: how far the held-out gap goes down with the diagnosed effects, beside what a learned residual reaches."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gsl.diagnosis.ceiling import CLIP, learned_residual
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.experiment import Experiment
from gsl.diagnosis.localise import regimes

SAMPLES = 1000
WORDS = {"high_load": "asked for much torque", "reversal": "turning round"}  # for regimes
FAR, ALIKE = 2.0, 0.95  # floors, and a share of what they were before: a part of the log above both is not explained
FARTHEST = 5.0  # floors above which no part of a log is, however far it was before
NOTHING = 0.02  # of an excess in squared floors: below it there is nothing to shrink


def shrinkage(found: Findings, before: np.ndarray, after: np.ndarray) -> dict[str, Any]:
    """Return the gap before and after, in floors, and the share of the excess that is gone, on held-out windows.

    Args:
        found: The diagnosis.
        before: Replays of the simulator as it was [rad], shape (W, T, n_joints).
        after: Replays with the diagnosed effects and the calibration.
    """
    exp, held = found.experiment, found.experiment.held_out
    none = found.selection.none
    told = {"before": before, "after": after, "calibration": found.simulator.told({}, none.fit.nuisances, exp.pieces)}
    z = {key: exp.comparison.residual(values, exp.pieces) for key, values in told.items()}
    used = exp.comparison.used(z["before"].shape[1])
    mean = {key: _mean_square(values[held], used) for key, values in z.items()}
    fraction, low, high = removed(exp, z["before"], z["after"])
    return {
        "floor": 1.0,
        **{key: float(np.sqrt(value.mean())) for key, value in mean.items()},
        "fraction": fraction,
        "calibration_fraction": removed(exp, z["before"], z["calibration"])[0],
        "low": low,
        "high": high,
        "ceiling_fraction": ceiling(exp, before, seed=found.seed),
        "by_joint": [
            {"joint": joint, "before": float(np.sqrt(mean["before"][k])), "after": float(np.sqrt(mean["after"][k]))}
            for k, joint in enumerate(exp.channels)
        ],
        "by_regime": _by_regime(found, z),
    }


def unexplained(told: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the joints and regimes that are far off, and no nearer than before or very far: part, before and after.

    Args:
        told: From `shrinkage`.
    """
    parts = [(one.get("joint") or one["regime"], one) for one in (*told["by_regime"], *told["by_joint"])]
    return [
        {"part": WORDS.get(name, name), "before": one["before"], "after": one["after"]}
        for name, one in parts
        if name != "all" and one["after"] > max(FAR, min(FARTHEST, ALIKE * one["before"]))
    ]


def _mean_square(z: np.ndarray, used: np.ndarray) -> np.ndarray:
    return (z**2).sum(axis=(0, 1)) / (used * len(z))


def _excess(z: np.ndarray, used: np.ndarray) -> float:
    return float(np.average(_mean_square(z, used), weights=used)) - 1.0


def removed(exp: Experiment, before: np.ndarray, after: np.ndarray) -> tuple[float | None, float | None, float | None]:
    """Return the share of the held-out excess that is gone, with its 95 % interval by bootstrap; None if there is none.

    Args:
        exp: The log.
        before: Residuals of all windows without effects, in units of the floor, shape (W, scored, n_channels).
        after: With them.
    """
    used, sample = exp.comparison.used(before.shape[1]), exp.pieces.chosen(exp.held_out).samples
    before, after = before[exp.held_out], after[exp.held_out]
    if _excess(before, used) < NOTHING:
        return None, None, None
    names = np.unique(sample)
    sums = np.array([[(z[sample == k] ** 2).sum() for k in names] for z in (before, after)])
    counts = np.array([(sample == k).sum() * used.sum() for k in names])
    index = np.random.default_rng(0).integers(0, len(names), (SAMPLES, len(names)))
    index = np.vstack([np.arange(len(names)), index])
    excess = sums[:, index].sum(axis=2) - counts[index].sum(axis=1)
    shares = 1.0 - np.maximum(excess[1], 0.0) / np.maximum(excess[0], 1e-9)
    low, high = np.quantile(shares[1:], [0.025, 0.975])
    return float(shares[0]), float(low), float(high)


def ceiling(exp: Experiment, before: np.ndarray, *, seed: int = 0) -> float | None:
    """Return the share of the held-out excess that a learned residual takes away; None without one, or if joints shake.

    Args:
        exp: The log.
        before: Replays of all windows by the simulator as it was [rad], shape (W, T, n_joints).
        seed: Of the fit.
    """
    z = exp.comparison.residual(before, exp.pieces)[exp.held_out]
    used = exp.comparison.used(z.shape[1])
    if _excess(z, used) < NOTHING or exp.comparison.shaking.any() or not np.isfinite(before).all():
        return None
    learned = learned_residual(exp, before, seed=seed)
    return 1.0 - max(0.0, _excess(learned, used)) / _excess(np.clip(z, -CLIP, CLIP), used)


def _by_regime(found: Findings, z: Mapping[str, np.ndarray]) -> list[dict[str, Any]]:
    exp, rows = found.experiment, []
    for name, mask in regimes(exp, found.corrected).items():
        part = mask[exp.held_out]
        if part.sum() > 50:
            values = {key: float(np.sqrt(np.mean(z[key][exp.held_out][part] ** 2))) for key in ("before", "after")}
            rows.append({"regime": name, **values})
    return rows
