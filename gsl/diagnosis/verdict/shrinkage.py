"""Shrinkage: how far the held-out gap goes down with the diagnosed effects, beside what a learned residual reaches.

The learned residual is the ceiling, with no physics and the same data: the model of GAT's forward model (linear or MLP,
whichever does better on a part of the training windows) predicts from the last simulated positions and commands how far
the robot is from the simulator.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gsl.diagnosis.log.log import Log
from gsl.diagnosis.settings import VerdictSettings
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.localise import find_regimes
from gsl.models.choice import best, fit_network
from gsl.models.config import ModelConfig
from gsl.models.network import Network, Samples

SAMPLES = 1000  # of the bootstrap
WORDS = {"high_load": "asked for much torque", "reversal": "turning round"}  # for regimes
LAGS = (0, 1, 2, 3, 5, 8, 12)  # ticks back at which the learned residual sees command less position
CONFIG = ModelConfig(hidden=(64, 64), epochs=40, patience=6, ridge=1.0)
VALIDATION = 4  # every fourth training window
CLIP = 50.0  # of its targets, in units of the floor
FEW = 50  # residuals of a regime, of which fewer say nothing


def shrinkage(findings: Findings, before: np.ndarray, after: np.ndarray) -> dict[str, Any]:
    """Return the gap before and after, in floors, and the share of the excess that is gone, on held-out windows.

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
    return {
        "floor": 1.0,
        **{key: float(np.sqrt(value.mean())) for key, value in mean.items()},
        "fraction": fraction,
        "calibration_fraction": compute_removed(log, z["before"], z["calibration"])[0],
        "low": low,
        "high": high,
        "ceiling_fraction": ceiling(log, before, seed=findings.options.seed),
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


def ceiling(log: Log, before: np.ndarray, *, seed: int = 0) -> float | None:
    """Return the share of the held-out excess that a learned residual takes away; None without one, or if joints shake.

    Args:
        log: The log.
        before: Replays of all windows by the simulator as it was [rad], shape (W, T, n_joints).
        seed: Of the fit.
    """
    z, used = log.residual(before)[log.held_out], log.used
    if _excess(z, used) < VerdictSettings.no_excess or log.comparison.shaking.any() or not np.isfinite(before).all():
        return None
    learned = _learn_residual(log, before, seed=seed)
    return 1.0 - max(0.0, _excess(learned, used)) / _excess(np.clip(z, -CLIP, CLIP), used)


def _learn_residual(log: Log, replayed: np.ndarray, *, seed: int) -> np.ndarray:
    """Return held-out residuals after the learned correction, in units of the floor, shape (W, scored, n_joints)."""
    inputs, targets = _samples(log, replayed)
    check = np.arange(len(log.train)) % VALIDATION == 0
    sets = _flat(inputs, targets, log.train[~check]), _flat(inputs, targets, log.train[check])

    def fit(config: ModelConfig, whole: bool) -> Network:
        return fit_network(*sets, config, seed=seed, whole=whole)

    def score(network: Network) -> float:
        return float(np.mean((network.predict_many(sets[1][0]) - sets[1][1]) ** 2))

    network, _ = best(CONFIG, fit, score)
    z = -targets[log.held_out]
    return z + network.predict_many(inputs[log.held_out].reshape(-1, inputs.shape[2])).reshape(z.shape)


def _samples(log: Log, replayed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return inputs, shape (W, scored, n_inputs), and what is to be predicted, shape (W, scored, n_joints)."""
    cut, first, joints = log.pieces, log.pieces.warm_up, len(log.joints)
    behind = cut.targets(joints) - replayed[..., :joints]
    lagged = [behind[:, first - lag : behind.shape[1] - lag] for lag in LAGS if lag <= first]
    speed = np.gradient(replayed, axis=1)[:, first:]
    targets = np.clip((cut.real - replayed) / log.comparison.floor, -CLIP, CLIP)[:, first:]
    place = replayed[:, first:] - np.where(np.arange(replayed.shape[2]) < joints, 0.0, replayed[:, first : first + 1])
    return np.concatenate([*lagged, speed, place, np.sign(speed)], axis=2), targets


def _flat(inputs: np.ndarray, targets: np.ndarray, windows: np.ndarray) -> Samples:
    return inputs[windows].reshape(-1, inputs.shape[2]), targets[windows].reshape(-1, targets.shape[2])
