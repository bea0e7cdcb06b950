"""The noise floor, residuals in units of it, what they cost, and how joints that shake are compared with their replay.

The floor is how far two logs of the same commands differ, or what a log's own roughness says of that.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.log.records import Pieces, Record
from gsl.diagnosis.log.repeats import Repeat, align_repeats
from gsl.diagnosis.settings import FloorSettings

SCALE = 5.0  # floors beyond which a residual counts less and less (Cauchy); 2.4 are 95 % efficient for normal noise
BLOCK = 5  # ticks of the low pass that joints that shake are seen through: 0.1 s at 50 Hz
BANDS = 5  # of the spectrum of a joint that shakes
POWER_SD = 0.6  # of the logarithm of its power in one window, measured on replays of shaking by its true cause
OF_BAND = 0.5  # share of the cost of the band that is furthest off: it is the worst of several


def loss(z: np.ndarray) -> np.ndarray:
    """Return the robust cost of residuals: z² where they are small, logarithmic beyond SCALE (Cauchy)."""
    return SCALE**2 * np.log1p((z / SCALE) ** 2)


def weight(z: np.ndarray) -> np.ndarray:
    """Return the weights with which least squares descend the robust cost."""
    return 1.0 / (1.0 + (z / SCALE) ** 2)


@dataclass(frozen=True)
class NoiseFloor:
    """What noise alone explains.

    Attributes:
        sd: Standard deviation of a measured position [rad], shape (n_joints,).
        slow: Of its means over BLOCK ticks, by repeats; 0 without [rad], shape (n_joints,).
        unsteady: Joints whose repeats differ by much more than those of the others, whose floor they get, (n_joints,).
        source: `repeats` or `estimated`.
        pairs: Repeats that were compared.
        resolution: Of the encoders [rad].
        samples: Independent numbers that it comes from, over all joints.
        restless: Joints that are rough while their commands are smooth, and not as white noise is, (n_joints,).
    """

    sd: np.ndarray
    slow: np.ndarray
    unsteady: np.ndarray
    source: str
    pairs: int
    resolution: float
    samples: int
    restless: np.ndarray

    @property
    def slack(self) -> float:
        """How much more than expected a residual may cost because the floor is itself measured, relative."""
        return float(2.0 * np.sqrt(2.0 / max(self.samples, 1)))


def noise_floor(
    records: Sequence[Record],
    repeats: Sequence[Repeat],
    period: float,
    resolution: float,
    least: np.ndarray | None = None,
    held: Sequence[int] = (),
    settings: FloorSettings | None = None,
) -> NoiseFloor:
    """Measure the floor.

    Args:
        records: All of the log.
        repeats: Which of them are of the same motion, from `find_repeats`.
        period: Control period [s].
        resolution: Of the encoders [rad]; the floor is at least what rounding makes, resolution / sqrt(12).
        least: Least floor of each channel instead, shape (n_channels,).
        held: Indices of records that are held out by a label; they are no repeats of the others, whose difference from
            them is to show.
        settings: How.
    """
    how = settings or FloorSettings()
    least = np.array(max(resolution / np.sqrt(12.0), 1e-5)) if least is None else least
    groups = [group for group in _group(records, repeats, held, how) if len(group) > 1]
    white = white_level(records, how)
    restless = _find_restless(records, white, np.maximum(how.unwhite * white, resolution), how)
    if groups:
        spread = [align_repeats(group, period)[:, how.settled :] for group in groups]
        square, slow = _variance(spread), _variance([in_blocks(part).mean(axis=2) for part in spread])
        pairs = sum(len(group) - 1 for group in groups)
        samples = sum(part.shape[1] * (len(part) - 1) for part in spread) * len(square)
        sd = np.maximum(np.sqrt(square), least)
        usual = np.inf if least.ndim else float(np.median(sd))
        unsteady = sd > how.unsteady * usual
        sd = np.where(unsteady, usual, sd)
        return NoiseFloor(sd, np.sqrt(slow), unsteady, "repeats", pairs, resolution, samples, restless)
    rough = roughness(records, how.quiet)
    sd = np.maximum(np.where(restless, np.minimum(rough, white), rough), least)
    calm = np.zeros(len(sd), dtype=bool)
    return NoiseFloor(sd, np.zeros(len(sd)), calm, "estimated", 0, resolution, how.estimate, restless)


def _variance(spread: Sequence[np.ndarray]) -> np.ndarray:
    """Return the variance between repeats, shape (n_joints,), of groups of shapes (repeats, T, n_joints)."""
    total: np.ndarray = np.sum([part.var(axis=0, ddof=1).sum(axis=0) for part in spread], axis=0)
    return total / sum(part.shape[1] for part in spread)


def in_blocks(x: np.ndarray) -> np.ndarray:
    """Return what is of shape (n, T, n_joints) in blocks of BLOCK ticks, shape (n, T // BLOCK, BLOCK, n_joints)."""
    rows = x.shape[1] // BLOCK
    return x[:, : rows * BLOCK].reshape(len(x), rows, BLOCK, -1)


def _group(
    records: Sequence[Record], repeats: Sequence[Repeat], held: Sequence[int], how: FloorSettings
) -> list[list[tuple[Record, float]]]:
    """Return the records of each motion, and by how many rows each is later; those that are held out apart."""
    groups: dict[tuple[int, bool], list[tuple[Record, float]]] = defaultdict(list)
    for index, (record, repeat) in enumerate(zip(records, repeats, strict=True)):
        if len(record) > 2 * how.settled:
            groups[repeat.motion, index in held].append((record, repeat.later))
    return list(groups.values())


def third_differences(positions: np.ndarray) -> np.ndarray:
    """Return the squares of third differences along the last but one axis, such that white noise has its variance."""
    return np.asarray(np.diff(positions, 3, axis=-2) ** 2 / 20.0)


def roughness(records: Sequence[Record], quiet: float = FloorSettings.quiet) -> np.ndarray:
    """Return what encoder noise alone looks like [rad], shape (n_joints,): nothing of it differs between repeats.

    It is the size of third differences where the motion is slow: that of white noise is sqrt(20) times its own.

    Args:
        records: All of the log.
        quiet: Share of the ticks that counts as slow.
    """
    rough = np.vstack([third_differences(record.measured) for record in records])
    speed = np.vstack([np.abs(np.gradient(record.measured, axis=0)[2:-1]) for record in records])
    slow = speed <= np.quantile(speed, quiet, axis=0)
    return np.sqrt(np.array([np.mean(column[keep]) for column, keep in zip(rough.T, slow.T, strict=True)]))


def white_level(records: Sequence[Record], settings: FloorSettings) -> np.ndarray:
    """Return the size of the white noise under a log's motion [rad], shape (n_joints,); infinite for short records.

    White noise has the same power at all frequencies, so the quietest part of the spectrum shows it: a motion or an
    oscillation is louder elsewhere. The power of noise in a band is exponential, which says what its quantiles are.

    Args:
        records: All of the log.
        settings: How.
    """
    length, bands = settings.spectrum, []
    for record in records:
        whole = record.measured[: len(record) // length * length]
        bands.append(_spectrum(whole.reshape(-1, length, whole.shape[1]))[:, settings.skipped :])
    power = np.concatenate(bands).reshape(-1, records[0].measured.shape[1])
    if not len(power):
        return np.full(power.shape[1], np.inf)
    return np.sqrt(np.quantile(power, settings.quietest, axis=0) / -np.log1p(-settings.quietest))


def _find_restless(
    records: Sequence[Record], white: np.ndarray, most: np.ndarray, how: FloorSettings
) -> np.ndarray:
    """Return which joints are rougher than `most` where commands have been smooth for a while, shape (n_channels,)."""
    rough = np.vstack([third_differences(record.measured)[how.settled :] for record in records])
    jerk = np.vstack([_jerk_of_commands(record, how.settled) for record in records])
    restless = np.zeros(len(white), dtype=bool)
    for joint, still in enumerate(jerk.T[: len(white)] < how.smooth * white[: jerk.shape[1], None] ** 2):
        if still.sum() > how.settled:
            restless[joint] = np.mean(rough[still, joint]) > most[joint] ** 2
    return restless


def _jerk_of_commands(record: Record, ticks: int) -> np.ndarray:
    """Return the largest squared third difference of what a motor was sent in the last ticks, (T - 2 - ticks, n)."""
    sent = record.commands.reshape(len(record), -1, record.targets.shape[1])
    jerk = third_differences(np.concatenate([sent[:1], sent]).swapaxes(0, 1)).max(axis=0)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(jerk, ticks + 1, axis=0).max(axis=-1))


@dataclass(frozen=True)
class Comparison:
    """How replays are compared with a log.

    Attributes:
        floor: Standard deviation that noise and a known model error explain [rad], shape (n_joints,).
        shaking: Joints whose phase a log cannot carry, shape (n_joints,).
        sway: How far these swing slowly at rest, or from one repeat to the next [rad], shape (n_joints,).
    """

    floor: np.ndarray
    shaking: np.ndarray
    sway: np.ndarray

    @classmethod
    def plain(cls, floor: np.ndarray) -> Comparison:
        """Return a comparison in which no joint shakes."""
        return cls(floor, np.zeros(len(floor), dtype=bool), np.zeros(len(floor)))

    def residual(self, replayed: np.ndarray, pieces: Pieces) -> np.ndarray:
        """Return the residuals of the scored part, shape (W, scored, n_joints).

        Args:
            replayed: Positions [rad], shape (W, T, n_joints).
            pieces: With the measured ones.
        """
        sim, real = replayed[:, pieces.warm_up :], pieces.real[:, pieces.warm_up :]
        z = (sim - real) / self.floor
        if self.shaking.any():
            z[..., self.shaking] = self._of_shaking(sim[..., self.shaking], real[..., self.shaking])
        return np.clip(np.nan_to_num(z, nan=1e3), -1e3, 1e3)

    def count_residuals(self, scored: int) -> np.ndarray:
        """Return how many residuals of a window count for each joint, shape (n_joints,)."""
        return np.where(self.shaking, scored // BLOCK + BANDS, scored)

    def levels(self, cost: np.ndarray) -> np.ndarray:
        """Return the mean of costs, shape (W, scored, n_joints), over one joint's residuals, shape (n_joints,).

        Of a joint that shakes the band that is furthest off counts as well: a few rows of many, they say that the
        simulator does not shake.
        """
        mean = cost.mean(axis=0)
        levels, first = mean.sum(axis=0) / self.count_residuals(len(mean)), len(mean) // BLOCK
        band = OF_BAND * mean[first : first + BANDS].max(axis=0)
        return np.where(self.shaking, np.maximum(levels, band), levels)

    def _of_shaking(self, sim: np.ndarray, real: np.ndarray) -> np.ndarray:
        """Slow parts as far as sim and real need not swing alike, and the power in each band; other rows are zero."""
        floor, sway, rows = self.floor[self.shaking], self.sway[self.shaking], sim.shape[1] // BLOCK
        z = np.zeros_like(sim)
        slow, fast = zip(*(_slow_and_fast(x) for x in (sim, real)), strict=True)
        z[:, :rows] = (slow[0] - slow[1]) / np.sqrt(floor**2 + fast[1] / BLOCK + 2.0 * sway**2)[:, None]
        power = [_bands(x) for x in (sim, real)]
        noise = floor**2  # the replay has none of it
        z[:, rows : rows + BANDS] = np.log((power[0] + noise) / np.maximum(power[1], noise)) / POWER_SD
        return z


def _slow_and_fast(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return means over BLOCK ticks, shape (W, rows, n), and the mean square about them, shape (W, n)."""
    blocks = in_blocks(x)
    return blocks.mean(axis=2), blocks.var(axis=2).mean(axis=1)


def _spectrum(x: np.ndarray) -> np.ndarray:
    """Return the power of windows by frequency, shape (W, T // 2 + 1, n): white noise has its variance in each."""
    length = x.shape[1]
    taper = np.hanning(length + 2)[1:-1, None]
    taper = taper / np.sqrt((taper**2).mean())
    return np.asarray(np.abs(np.fft.rfft((x - x.mean(axis=1, keepdims=True)) * taper, axis=1)) ** 2 / length)


def _bands(x: np.ndarray) -> np.ndarray:
    """Return the mean power but for the mean by band, shape (W, BANDS, n): white noise has its variance in each."""
    spectrum = _spectrum(x)
    edges = np.linspace(1, spectrum.shape[1], BANDS + 1).round().astype(int)
    return np.stack([spectrum[:, a:b].mean(axis=1) for a, b in zip(edges[:-1], edges[1:], strict=True)], axis=1)


def compare(pieces: Pieces, noise: NoiseFloor, joints: int, settings: FloorSettings) -> Comparison:
    """Return how to compare, with the joints that shake while their commands rest.

    The floor of a joint that shakes is that of the calm ones: repeats of shaking differ by its phase, not by noise.

    Args:
        pieces: Of the log.
        noise: Its floor.
        joints: How many, the first channels.
        settings: What counts as rest and as shaking.
    """
    commands = np.ptp(pieces.windows.commands[:, : pieces.real.shape[1]], axis=1)
    moving = commands.reshape(len(pieces), -1, pieces.windows.motion.shape[2]).max(axis=1)[:, :joints]
    resting = moving < settings.still
    real = pieces.real[:, pieces.warm_up :]
    at_rest = [_calmest(real[rests, :, joint], settings.usual) for joint, rests in enumerate(resting.T)]
    rests = np.array([len(x) >= settings.rests for x in at_rest])
    shaking = np.where(rests, [_shakes(x, noise.resolution, settings) for x in at_rest], noise.restless[:joints])
    calm = np.median(noise.sd[~shaking]) if not shaking.all() else settings.unmeasured * noise.resolution
    sway = np.array([_sway(x) if shakes else 0.0 for x, shakes in zip(at_rest, shaking, strict=True)])
    sway = np.where(shaking, np.maximum(sway, noise.slow), 0.0)
    return Comparison(np.where(shaking, np.minimum(noise.sd, calm), noise.sd), shaking, sway)


def _calmest(rest: np.ndarray, usual: float) -> np.ndarray:
    """Return the calmest of resting windows, shape (W, scored), each less its line."""
    x = rest - rest.mean(axis=1, keepdims=True)
    line = np.linspace(-1.0, 1.0, rest.shape[1])
    x = x - np.outer(x @ line / (line @ line), line)
    return x[np.argsort((x**2).mean(axis=1))[: max(1, round(usual * len(x)))]]


def _sway(rest: np.ndarray) -> float:
    """Return the standard deviation of the means over BLOCK ticks [rad] of what `_calmest` returns; 0 of nothing."""
    if not len(rest):
        return 0.0
    return float(np.sqrt((in_blocks(rest[..., None]).mean(axis=2) ** 2).mean()))


def _shakes(rest: np.ndarray, resolution: float, settings: FloorSettings) -> bool:
    """Whether a resting joint, as `_calmest` returns it, moves by more than rounding and not as noise does.

    What happens in a few windows only is no shaking.
    """
    if not len(rest):
        return False
    power = float((rest**2).mean())
    colour = max(abs(float((rest[:, lag:] * rest[:, :-lag]).mean())) for lag in range(1, settings.lags + 1))
    return power > resolution**2 and colour > settings.coloured * power
