"""Where the gap lies: the simulator's excess over the floor by joint, regime, horizon and side of the robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gsl.core.body import Robot
from gsl.core.plant import Plant
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.log.records import Pieces
from gsl.diagnosis.settings import LocaliseSettings
from gsl.diagnosis.simulate.in_the_air import change

OF_ALL = ("all", "early", "late", "after_contact")  # regimes to which the base belongs


@dataclass(frozen=True)
class Cell:
    """What one joint does in one regime.

    Attributes:
        joint, regime: Which.
        share: Of the whole excess.
        low, high: 95 % interval, by bootstrap over `Pieces.samples`.
        rms: Of the residuals in units of the floor.
        named: Whether the lower bound of rms is significantly above the floor.
    """

    joint: str
    regime: str
    share: float
    low: float
    high: float
    rms: float
    named: bool


def cells(
    log: Log, z: np.ndarray, regimes: Mapping[str, np.ndarray], settings: LocaliseSettings | None = None
) -> list[Cell]:
    """Return the excess of every joint in every regime.

    Args:
        log: The log.
        z: Residuals of all windows in units of the floor, shape (W, scored, n_joints).
        regimes: Which residuals belong to each, shape (W, scored, n_joints).
        settings: What is named.
    """
    how = settings or LocaliseSettings()
    sample, names = log.pieces.samples, np.unique(log.pieces.samples)
    alike = z.shape[1] / log.comparison.count_residuals(
        z.shape[1]
    )  # a joint that shakes has fewer residuals in a window
    sums = {key: alike * _by_sample(np.where(mask, z**2, 0.0), sample) for key, mask in regimes.items()}
    counts = {key: alike * _by_sample(mask.astype(float), sample) for key, mask in regimes.items()}
    index = np.random.default_rng(0).integers(0, len(names), (how.samples, len(names)))
    index = np.vstack([np.arange(len(names)), index])
    square = {key: sums[key][index].sum(axis=1) for key in regimes}
    count = {key: counts[key][index].sum(axis=1) for key in regimes}
    excess = {key: np.maximum(0.0, square[key] - count[key]) for key in regimes}
    total = np.maximum(excess["all"].sum(axis=1), 1e-12)[:, None]
    result = []
    for key in regimes:
        share = excess[key] / total
        rms = np.sqrt(square[key] / np.maximum(count[key], 1.0))
        low, high = np.quantile(share[1:], [0.025, 0.975], axis=0)
        named = np.quantile(rms[1:], 0.025, axis=0) > how.above
        named &= (counts[key] > 0).sum(axis=0) >= how.least
        columns = zip(log.channels, share[0], low, high, rms[0], named, strict=True)
        result += [
            Cell(joint, key, float(value), float(least), float(most), float(size), bool(is_named))
            for joint, value, least, most, size, is_named in columns
        ]
    return result


def find_regimes(log: Log, plant: Plant, settings: LocaliseSettings | None = None) -> dict[str, np.ndarray]:
    """Return which residuals of all windows belong to which regime, shape (W, scored, n_joints) each.

    Args:
        log: The log.
        plant: Whose gains and limits say what torque a command asks for: as near to the robot as is known.
        settings: Where regimes begin and end.
    """
    how, cut, n = settings or LocaliseSettings(), log.pieces, len(log.joints)
    kp, kd, limit, no_load = _servos(cut, plant, n)
    real = cut.real[..., :n]
    speed = _smooth(np.gradient(real, log.period, axis=1))
    sent_speed, torque, of_kp, of_kd = cut.beside(n)
    wanted = of_kp * kp * (cut.targets(n) - real) + torque
    if sent_speed.any() or torque.any():
        wanted += of_kd * kd * (sent_speed - speed)
    wanted = np.abs(wanted) / limit
    share = np.abs(speed) / no_load
    tick = cut.tick[:, None] + np.arange(real.shape[1])
    length = np.array([len(log.records[k]) for k in cut.record])[:, None]
    masks = {
        "all": np.ones(real.shape, dtype=bool),
        "rest": share < how.rest,
        "slow": (share >= how.rest) & (share < how.fast),
        "fast": share >= how.fast,
        "reversal": _reversals(speed, share >= how.rest, round(how.reversal / log.period)),
        "high_load": wanted > how.loaded,
        "saturated": wanted > how.saturated,
        "early": np.broadcast_to((tick < length / 3)[..., None], real.shape),
        "late": np.broadcast_to((tick >= 2 * length / 3)[..., None], real.shape),
    }
    if log.walking:
        masks |= _phases(log, round(how.contact / log.period))
    wide = {key: _widen(mask, len(log.channels), key) for key, mask in masks.items()}
    return {key: _count(log, mask[:, cut.warm_up :], key) for key, mask in wide.items()}


def _servos(cut: Pieces, plant: Plant, joints: int) -> np.ndarray:
    """Return kp, kd, torque limit and no-load speed in each window, shape (4, W, 1, n_joints)."""
    rows = np.empty((4, len(cut), 1, joints))
    for conditions, index in cut.alike:
        servo = change(plant, conditions).servo
        rows[:, index, 0] = np.array([servo.kp, servo.kd, servo.limit, servo.no_load_speed])[:, None, :joints]
    return rows


def _count(log: Log, mask: np.ndarray, key: str) -> np.ndarray:
    """Leave joints that shake in no regime but `all`, and there as many residuals as they have: they are no ticks."""
    rows = np.arange(mask.shape[1])[:, None] < log.comparison.count_residuals(mask.shape[1])
    return mask & (rows if key == "all" else ~log.comparison.shaking)


def _widen(mask: np.ndarray, channels: int, key: str) -> np.ndarray:
    """Add columns for the base, which belongs to the regimes that are of the whole robot."""
    if mask.shape[2] == channels:
        return mask
    whole = mask.any(axis=2, keepdims=True) if key in OF_ALL else np.zeros((*mask.shape[:2], 1), dtype=bool)
    return np.concatenate([mask, np.repeat(whole, channels - mask.shape[2], axis=2)], axis=2)


def _phases(log: Log, reach: int) -> dict[str, np.ndarray]:
    """Return when each leg stands, swings, and has just touched the ground, by the feet; arms belong to none."""
    cut, shape = log.pieces, (*log.pieces.real.shape[:2], len(log.joints))
    masks = {key: np.zeros(shape, dtype=bool) for key in ("stance", "swing", "after_contact")}
    legs = log.robot.groups.get("legs", ())
    for w, (record, tick) in enumerate(zip(cut.record, cut.tick, strict=True)):
        feet = log.records[record].feet
        if feet is None:
            continue
        landed = feet & ~np.vstack([np.ones((1, 2), dtype=bool), feet[:-1]])
        recent = np.array([landed[max(0, k - reach) : k + 1].any(axis=0) for k in range(len(feet))])
        rows = slice(tick + 1, tick + 1 + shape[1])
        for j, joint in enumerate(log.joints):
            if joint in legs:
                side = int(joint.startswith("R"))
                masks["stance"][w, :, j], masks["swing"][w, :, j] = feet[rows, side], ~feet[rows, side]
                masks["after_contact"][w, :, j] = recent[rows, side]
    return masks


def horizon(log: Log, replayed: np.ndarray) -> tuple[list[float], dict[str, list[float]]]:
    """Return how the residuals grow from the measured state on: times [s] and rms in units of the floor, by joint."""
    z = (replayed - log.pieces.real) / log.comparison.floor
    rms = np.sqrt(np.nanmean(np.clip(z, -1e3, 1e3) ** 2, axis=0))
    times = log.period * np.arange(1, z.shape[1] + 1)
    return times.tolist(), {joint: rms[:, j].tolist() for j, joint in enumerate(log.channels)}


def sides(log: Log, z: np.ndarray, settings: LocaliseSettings | None = None) -> list[dict[str, object]]:
    """Return mirrored joints with the rms of each side and the chance that sides that are alike differ as much.

    The chance is Bonferroni's, of all pairs together: of many pairs that are alike, one differs more than most.
    Only windows count in which both are commanded to move as far: else the motions would be compared.
    """
    how, names = settings or LocaliseSettings(), log.joints
    result = list[tuple[str, float, float, float]]()
    reach = np.ptp(log.pieces.windows.commands[..., : len(names)], axis=1)
    for left, right in mirror_pairs(log.robot):
        own = [names.index(name) for name in (left, right)]
        alike = np.abs(np.diff(reach[:, own], axis=1)[:, 0]) < how.alike * reach[:, own].max(axis=1)
        if alike.sum() < how.least:
            continue
        pair = _by_sample(z[alike][..., own] ** 2, log.pieces.take(alike.nonzero()[0]).samples).T
        counts = log.comparison.count_residuals(z.shape[1])[own] * alike.sum()
        difference = pair[0] - pair[1]
        flips = np.random.default_rng(0).choice([-1.0, 1.0], (how.flips, len(difference)))
        as_far = int((np.abs(flips @ difference) >= abs(difference.sum()) - 1e-9).sum())
        p = (as_far + 1) / (how.flips + 1)
        rms = np.sqrt(pair.sum(axis=1) / counts)
        result.append((left[1:], float(rms[0]), float(rms[1]), p))
    return [
        {"pair": pair, "left": left, "right": right, "p": min(1.0, p * len(result))} for pair, left, right, p in result
    ]


def mirror_pairs(robot: Robot) -> list[tuple[str, str]]:
    """Return pairs of logged joints whose names differ by L and R at the beginning."""
    names = robot.controlled
    return [(name, "R" + name[1:]) for name in names if name.startswith("L") and "R" + name[1:] in names]


def _by_sample(values: np.ndarray, sample: np.ndarray) -> np.ndarray:
    """Sum over each sample's windows, shape (n_samples, n_joints)."""
    return np.array([values[sample == k].sum(axis=(0, 1)) for k in np.unique(sample)])


def _smooth(speed: np.ndarray) -> np.ndarray:
    kernel = np.ones(3) / 3.0
    return np.apply_along_axis(np.convolve, 1, speed, kernel, mode="same")


def _reversals(speed: np.ndarray, moves: np.ndarray, reach: int) -> np.ndarray:
    turns = np.zeros(speed.shape, dtype=bool)
    turns[:, 1:] = (np.sign(speed[:, 1:]) != np.sign(speed[:, :-1])) & (moves[:, 1:] | moves[:, :-1])
    near = turns.copy()
    for k in range(1, reach + 1):
        near[:, k:] |= turns[:, :-k]
        near[:, :-k] |= turns[:, k:]
    return near
