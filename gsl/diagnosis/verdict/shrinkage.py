"""Shrinkage: how far the held-out gap goes down with the diagnosed effects, beside what any servo could reach.

The ceiling is the best hypothesis with a law of each servo on top, learned from the same data: see servo_law.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gsl.diagnosis.log.log import Log
from gsl.diagnosis.settings import VerdictSettings
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.localise import find_regimes
from gsl.diagnosis.verdict.servo_law import Laws

SAMPLES = 1000  # of the bootstrap
WORDS = {"high_load": "asked for much torque", "reversal": "turning round"}  # for regimes
CLIP = 50.0  # of residuals beside a ceiling [floors]: what runs away counts as much
FEW = 50  # residuals of a regime, of which fewer say nothing


def shrinkage(findings: Findings, before: np.ndarray, after: np.ndarray) -> dict[str, Any]:
    """Return the gap before and after, in floors, and the share of the excess that is gone, on held-out windows.

    "nearest" is the best hypothesis, be it named or not: the share that goes with it, and what it leaves [rad]. That is
    of the joint that is furthest off, of those that do not shake.

    Args:
        findings: The diagnosis.
        before: Replays of the simulator as it was [rad], shape (W, T, n_joints).
        after: Replays with the diagnosed effects and the calibration.
    """
    log, none = findings.log, findings.selection.none
    calibrated = findings.simulator.simulate({}, none.fit.shifts, log.pieces)
    replays = {"before": before, "after": after, "calibration": calibrated}
    z = {key: log.residual(replay) for key, replay in replays.items()}
    mean = {key: _mean_square(values[log.held_out], log.used) for key, values in z.items()}
    fraction, low, high = compute_removed(log, z["before"], z["after"])
    nearest, chosen = z["after"], findings.selection.chosen
    if chosen is not findings.answer:
        nearest = log.residual(findings.simulator.simulate(chosen.effects, chosen.fit.shifts, log.pieces))
    left = np.sqrt(_mean_square(nearest[log.held_out], log.used)) * log.comparison.floor
    calm = ~log.comparison.shaking[: len(log.joints)]
    return {
        "floor": 1.0,
        **{key: float(np.sqrt(value.mean())) for key, value in mean.items()},
        "fraction": fraction,
        "calibration_fraction": compute_removed(log, z["before"], z["calibration"])[0],
        "low": low,
        "high": high,
        "nearest_fraction": compute_removed(log, z["before"], nearest)[0],
        "nearest_left": float(left[: len(log.joints)][calm].max(initial=0.0)),
        "ceiling_fraction": ceiling(log, before, findings.laws),
        "by_joint": [
            {"joint": joint, "before": float(np.sqrt(mean["before"][k])), "after": float(np.sqrt(mean["after"][k]))}
            for k, joint in enumerate(log.channels)
        ],
        "by_regime": _by_regime(findings, z),
    }


def find_unexplained(shrunk: Mapping[str, Any], settings: VerdictSettings | None = None) -> list[dict[str, Any]]:
    """Return the joints and regimes that are far off, and no nearer than before or very far: part, before and after.

    Args:
        shrunk: From `shrinkage`.
        settings: What is far.
    """
    how = settings or VerdictSettings()
    parts = [(row.get("joint") or row["regime"], row) for row in (*shrunk["by_regime"], *shrunk["by_joint"])]
    return [
        {"part": WORDS.get(name, name), "before": row["before"], "after": row["after"]}
        for name, row in parts
        if name != "all" and row["after"] > max(how.far, min(how.farthest, how.as_before * row["before"]))
    ]


def _mean_square(z: np.ndarray, used: np.ndarray) -> np.ndarray:
    return (z**2).sum(axis=(0, 1)) / (used * len(z))


def _excess(z: np.ndarray, used: np.ndarray) -> float:
    return float(np.average(_mean_square(z, used), weights=used)) - 1.0


def compute_removed(log: Log, before: np.ndarray, after: np.ndarray) -> tuple[float | None, float | None, float | None]:
    """Return the share of the held-out excess that is gone, with its 95 % interval by bootstrap; None if there is none.

    Args:
        log: The log.
        before: Residuals of all windows without effects, in units of the floor, shape (W, scored, n_channels).
        after: With them.
    """
    used, sample = log.used, log.pieces.take(log.held_out).samples
    before, after = before[log.held_out], after[log.held_out]
    if _excess(before, used) < VerdictSettings.no_excess:
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


def _by_regime(findings: Findings, z: Mapping[str, np.ndarray]) -> list[dict[str, Any]]:
    held, rows = findings.log.held_out, []
    for name, mask in find_regimes(findings.log, findings.corrected).items():
        part = mask[held]
        if part.sum() > FEW:
            values = {key: float(np.sqrt(np.mean(z[key][held][part] ** 2))) for key in ("before", "after")}
            rows.append({"regime": name, **values})
    return rows


def ceiling(log: Log, before: np.ndarray, laws: Laws | None) -> float | None:
    """Return the share of the held-out excess that goes with a law of each servo, None without an excess or a law.

    Args:
        log: The log.
        before: Replays of all windows by the simulator as it was [rad], shape (W, T, n_joints).
        laws: On top of the best hypothesis.
    """
    if laws is None or log.comparison.shaking.any() or not np.isfinite(before).all():
        return None
    used = log.used
    was = _excess(np.clip(log.residual(before)[laws.windows], -CLIP, CLIP), used)
    if was < VerdictSettings.no_excess:
        return None
    return 1.0 - max(0.0, _excess(np.clip(laws.z, -CLIP, CLIP), used)) / was
