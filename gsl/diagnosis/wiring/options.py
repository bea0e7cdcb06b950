"""The menu of wiring faults that a log is asked about, each for all joints in question at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gsl.core.plant import Plant
from gsl.core.slides import levers
from gsl.core.trajectory import Batch
from gsl.diagnosis.log.files import BEYOND
from gsl.diagnosis.wiring.fault import ACTION, BOTH, POSITION, Fault, gains, hold, permute, rate, rescale, shift
from gsl.diagnosis.wiring.physics import ZERO, parameter_bounds
from gsl.diagnosis.wiring.relation import FOLLOWS, Relation, relate

UNITS = {"deg": np.pi / 180.0, "ticks/4096": 2.0 * np.pi / 4096.0, "ticks/1024": 2.0 * np.pi / 1024.0,
         "turn": 2.0 * np.pi, "mrad": 1e-3, "%": 0.01}  # fmt: skip
LENGTHS = ("mrad", "%")  # of these units, what a slide has as well: mm and cm for m
RANGES = {"-1 to 1": (-1.0, 1.0), "0 to 1": (0.0, 1.0), "-100 to 100": (-100.0, 100.0), "0 to 100": (0.0, 100.0)}
NEAR = 1.18  # factor by which a ratio may differ from that of a unit: quick motion arrives smaller than commanded
USUAL = (0.55, 1.8)  # factors from command to position that physics explains
OVER = 1.02  # share of a normalised range that values may reach
EARLY = (1, 2, 3)  # rows by which commands may act before the row that they are written in
HELD = (2, 3, 4, 5)  # ticks for which a robot may hold a command
RATES = (0.25, 1.0 / 3.0, 0.5, 2.0 / 3.0, 0.8, 1.25, 1.5, 2.0, 3.0, 4.0)
FACTORS = (1.0 / 57.3, 0.1, 0.2, 5.0, 10.0, 57.3)  # of gains: per degree, and orders of magnitude


class Spread(NamedTuple):
    """One fault that each joint may have with numbers of its own.

    Attributes:
        kind, side: As in `Fault`.
        gain, offset: That mend it, shape (n_joints,); NaN where it is no hypothesis for a joint.
        value: What is said of it.
    """

    kind: str
    side: str
    gain: np.ndarray
    offset: np.ndarray
    value: dict[str, object]

    def fault(self, joints: Sequence[int]) -> Fault | None:
        """Return the fault of those of some joints that may have it."""
        own = [k for k in joints if np.isfinite(self.gain[k])]
        if not own:
            return None
        return rescale(self.kind, own, self.side, self.gain, self.offset, self.value)


def by_relation(batch: Batch, plant: Plant) -> Iterator[Spread]:
    """Yield signs, scales and offsets that are seen in how positions follow their own commands."""
    follows = relate(batch.episodes, batch.control_period)
    own = follows.source == np.arange(len(follows.source))
    clear = own & (np.abs(follows.likeness) > FOLLOWS)
    nothing = np.full(len(own), np.nan)
    opposite = clear & (follows.likeness < 0.0)
    for side in (ACTION, POSITION):
        if opposite.any():
            yield Spread("sign", side, np.where(opposite, -1.0, nothing), np.zeros(len(own)), {})
    yield from _units(follows, clear, _ways(plant))
    yield from _propose_shares(follows, clear, plant)
    factor = np.abs(follows.factor)
    usual = clear & (follows.likeness > 0.0) & (factor > USUAL[0]) & (factor < USUAL[1])
    far = usual & (np.abs(follows.offset) > parameter_bounds(plant)[1][ZERO, 0])
    if far.any():
        sizes = np.where(far, follows.offset, 0.0)
        value: dict[str, object] = {"offset": sizes.tolist()}
        yield Spread("offset", ACTION, np.where(far, 1.0, nothing), sizes, value)
        yield Spread("offset", POSITION, np.where(far, 1.0, nothing), -sizes, value)


def _units(follows: Relation, clear: np.ndarray, ways: np.ndarray) -> Iterator[Spread]:
    """Yield commands or positions that are in another unit, or scaled by a factor that has no name."""
    factor = np.abs(follows.factor)
    odd = clear & ((factor < USUAL[0]) | (factor > USUAL[1]))
    for name, unit in UNITS.items():
        for side, ratio in ((ACTION, unit), (POSITION, 1.0 / unit)):
            fits = odd & (np.abs(np.log(np.where(factor > 0.0, factor, 1e-9) / ratio)) < np.log(NEAR))
            fits &= (ways == 1.0) | (name in LENGTHS)
            if fits.any():
                zero = _zero(follows, side, unit)
                yield Spread("scale", side, np.where(fits, unit, np.nan), -unit * zero, {"unit": name})
    if odd.any():
        for side in (ACTION, POSITION):
            size = np.where(odd, np.where(factor > 0.0, factor, np.nan), np.nan)
            gain = size if side == ACTION else 1.0 / size
            value: dict[str, object] = {"factor": (1.0 / gain).tolist()}
            yield Spread("scale", side, gain, -gain * _zero(follows, side, gain), value)


def _zero(follows: Relation, side: str, unit: float | np.ndarray) -> np.ndarray:
    """Return the raw value at the zero of a signal in another unit, 0 where it is about that, shape (n_joints,)."""
    raw, other = (follows.means[0], follows.means[1]) if side == ACTION else (follows.means[1], follows.means[0])
    zero = raw - np.sign(follows.factor) * other / unit
    return np.where(np.abs(unit * zero) < 0.15, 0.0, np.where(np.abs(zero - 2048.0) < 150.0, 2048.0, zero))


def _propose_shares(follows: Relation, clear: np.ndarray, plant: Plant) -> Iterator[Spread]:
    """Yield commands or positions that are given as shares of the joints' ranges."""
    lower, upper = _limits(plant)
    factor = np.abs(follows.factor)
    for name, ends in RANGES.items():
        low, high = (end / _ways(plant) for end in ends)
        unit, offset = _spread_out(lower, upper, low, high)
        for side, ratio in ((ACTION, unit), (POSITION, 1.0 / unit)):
            fits = clear & (np.abs(np.log(np.where(factor > 0.0, factor, 1e-9) / ratio)) < np.log(NEAR))
            fits &= (np.abs(np.log(unit)) > np.log(NEAR)) | (np.abs(offset) > parameter_bounds(plant)[1][ZERO, 0])
            if fits.any():
                yield Spread("scale", side, np.where(fits, unit, np.nan), offset, {"range": name})


def by_range(batch: Batch, plant: Plant) -> Iterator[Spread]:
    """Yield units in which both commands and positions may be: the one follows the other all the same."""
    (lower, upper), ways = _limits(plant), _ways(plant)
    values = np.concatenate([np.vstack([episode.action, episode.position]) for episode in batch.episodes])
    least, most = values.min(axis=0), values.max(axis=0)
    for name, unit in UNITS.items():
        for zero in (0.0, 2048.0) if name == "ticks/4096" else (0.0,):
            small, large = unit * (least - zero), unit * (most - zero)
            fits = (
                (small > lower - 0.5) & (large < upper + 0.5) & (np.maximum(np.abs(least), np.abs(most)) * unit > 0.01)
            )
            fits &= (ways == 1.0) | (name in LENGTHS)
            if fits.any() and unit < 1.0:
                shifted = np.full(len(lower), -unit * zero)
                yield Spread("scale", BOTH, np.where(fits, unit, np.nan), shifted, {"unit": name, "zero": zero})
    for name, ends in RANGES.items():
        low, high = (end / ways for end in ends)
        size, offset = _spread_out(lower, upper, low, high)
        width = high - low
        fits = (least >= low - (OVER - 1.0) * width) & (most <= high + (OVER - 1.0) * width)
        if fits.any():
            yield Spread("scale", BOTH, np.where(fits, size, np.nan), offset, {"range": name})
    pose = np.array([plant.robot.stance.get(name, 0.0) for name in plant.robot.controlled])
    if np.abs(pose).max() > parameter_bounds(plant)[1][ZERO, 0]:
        moved = np.abs(pose) > 0.0
        value: dict[str, object] = {"offset": pose.tolist()}
        yield Spread("offset", BOTH, np.where(moved, 1.0, np.nan), pose, value)


def find_beyond(batch: Batch, plant: Plant) -> set[int]:
    """Return the joints whose commands or positions are far beyond their limits: no physics goes there."""
    lower, upper = _limits(plant)
    values = np.concatenate([np.vstack([episode.action, episode.position]) for episode in batch.episodes])
    beyond = np.maximum(lower - values.min(axis=0), values.max(axis=0) - upper)
    return set(np.flatnonzero(beyond > BEYOND).tolist())


def _limits(plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    ranges = [plant.robot.joint(name) for name in plant.robot.controlled]
    return np.array([interval.lower for interval in ranges]), np.array([interval.upper for interval in ranges])


def _ways(plant: Plant) -> np.ndarray:
    """Return the levers of the joints, shape (n_joints,): a slide's columns were divided by them."""
    return levers(plant.robot)[: len(plant.robot.controlled)]


def _spread_out(
    lower: np.ndarray, upper: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what one unit of a normalised range is [rad], and the angle at its zero [rad], shapes (n_joints,)."""
    unit = (upper - lower) / (high - low)
    return unit, lower - unit * low


def permutations(batch: Batch) -> Iterator[Fault]:
    """Yield the exchange of joints that is seen in which command each position follows."""
    source = relate(batch.episodes, batch.control_period).source
    if (source != np.arange(len(source))).any():
        yield permute(np.argsort(source).tolist(), POSITION)
        yield permute(source.tolist(), ACTION)


def timings(joints: Sequence[int], rows: int) -> Iterator[Fault]:
    """Yield shifts, held commands and other rates.

    Args:
        joints: In question.
        rows: Of the shortest episode.
    """
    yield from (shift(early, joints) for early in EARLY)
    yield from (hold(ticks, phase, joints) for ticks in HELD for phase in range(ticks))
    yield from (rate(factor, joints) for factor in RATES)


def gain_grid(joints: Sequence[int], plant: Plant) -> Iterator[Fault]:
    """Yield gains that are far off: both, or either, or each in the other's place."""
    kp, kd = plant.servo.kp[list(joints)], plant.servo.kd[list(joints)]
    exchanged = np.divide(kd, kp, out=np.ones_like(kp), where=(kp > 0.0) & (kd > 0.0))
    yield gains(exchanged.tolist(), (1.0 / exchanged).tolist(), joints)
    for factor in FACTORS:
        ones = [factor] * len(joints)
        yield gains(ones, ones, joints)
        yield gains(ones, [1.0] * len(joints), joints)
        yield gains([1.0] * len(joints), ones, joints)
        yield gains(ones, [float(np.sqrt(factor))] * len(joints), joints)
