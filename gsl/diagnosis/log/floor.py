"""The noise floor: how far two logs of the same commands differ, or what a log's own roughness says of that."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.log.records import Record
from gsl.diagnosis.log.repeats import Repeat, align_repeats
from gsl.diagnosis.settings import FloorSettings

STILL = 1e-5  # [rad]: what commands move by beside a parabola, when they are one
SAME = 1e-6  # by which positions of one step of an encoder may differ [rad]: rounding in a file
FEW_VALUES = 0.25  # values a row, below which positions lie on a grid
BLOCK = 5  # ticks of the low pass that joints that shake are seen through: 0.1 s at 50 Hz


@dataclass(frozen=True)
class NoiseFloor:
    """What noise alone explains.

    Attributes:
        sd: Standard deviation of a measured position [rad], shape (n_joints,).
        slow: Of its means over BLOCK ticks, by repeats; 0 without [rad], shape (n_joints,).
        unsteady: Joints whose repeats differ by much more than those of the others, and not by white noise; they get
            the floor of the others, shape (n_joints,).
        source: `repeats` or `estimated`.
        pairs: Repeats that were compared.
        resolution: Of the encoders [rad].
        samples: Independent numbers that it comes from, over all joints.
        white: Of white noise alone, from the quietest part of the spectrum [rad], shape (n_joints,).
        restless: Joints that move by much more than that, though commands are smooth, shape (n_joints,).
        wandering: How far joints move about what smooth commands explain [rad], 0 where none are, shape (n_joints,).
    """

    sd: np.ndarray
    slow: np.ndarray
    unsteady: np.ndarray
    source: str
    pairs: int
    resolution: float
    samples: int
    white: np.ndarray
    restless: np.ndarray
    wandering: np.ndarray

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
    air, grid = least is None, np.zeros(1)
    if least is None:
        grid = find_grid(records)
        least = np.maximum(np.maximum(resolution, grid) / np.sqrt(12.0), 1e-5)
    groups = [group for group in _group(records, repeats, held, how) if len(group) > 1]
    white = np.maximum(white_level(records, how), least)
    restless, wandering = np.zeros(len(white), dtype=bool), np.zeros(len(white))
    if air:  # on the ground steps shake a robot
        wandering = _measure_wandering(records, white, period, how)
        restless = _find_restless(records, white, np.maximum(how.unwhite * white, resolution), how)
    wavers = wandering > np.maximum(how.unsteadily * white, resolution)
    if groups:
        spread = [align_repeats(group, period)[:, how.settled :] for group in groups]
        square, slow = _variance(spread), _variance([in_blocks(part).mean(axis=2) for part in spread])
        pairs = sum(len(group) - 1 for group in groups)
        samples = sum(part.shape[1] * (len(part) - 1) for part in spread) * len(square)
        sd = np.maximum(np.sqrt(square), least)
        usual = float(np.median(sd)) if air else np.inf
        own = np.maximum(how.unsteadily * white, grid)  # noise of an encoder of its own
        unsteady = (sd > how.unsteady * usual) & (sd > own)
        restless |= wavers & (sd > how.unsteadily * white)  # what repeats as well shakes by no chance
        sd = np.where(unsteady, usual, sd)
        return NoiseFloor(
            sd, np.sqrt(slow), unsteady, "repeats", pairs, resolution, samples, white, restless, wandering
        )
    restless |= wavers
    rough = roughness(records, how.quiet)
    sd = np.maximum(np.where(restless, np.minimum(rough, white), rough), least)
    calm = np.zeros(len(sd), dtype=bool)
    return NoiseFloor(sd, np.zeros(len(sd)), calm, "estimated", 0, resolution, how.estimate, white, restless, wandering)


def find_grid(records: Sequence[Record]) -> np.ndarray:
    """Return the step of each joint's encoder as its positions show it [rad], 0 where they show none, (n_joints,)."""
    columns = np.vstack([record.measured for record in records]).T
    return np.array([_find_step(column) for column in columns])


def _find_step(values: np.ndarray) -> float:
    steps = np.diff(np.unique(values))
    steps = steps[steps > SAME]
    few = len(steps) < FEW_VALUES * len(values)
    return float(steps.min()) if few and len(steps) else 0.0


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
        bands.append(spectrum(whole.reshape(-1, length, whole.shape[1]))[:, settings.skipped :])
    power = np.concatenate(bands).reshape(-1, records[0].measured.shape[1])
    if not len(power):
        return np.full(power.shape[1], np.inf)
    return np.sqrt(np.quantile(power, settings.quietest, axis=0) / -np.log1p(-settings.quietest))


def _find_restless(records: Sequence[Record], white: np.ndarray, most: np.ndarray, how: FloorSettings) -> np.ndarray:
    """Return which joints are rougher than `most` where commands have been smooth for a while, shape (n_channels,).

    These are the commands of all joints, whose motion takes the others along; where they never are, its own.
    """
    restless = np.zeros(len(white), dtype=bool)
    long = [record for record in records if len(record) > 2 * how.settled]
    if not long:
        return restless
    rough = np.vstack([third_differences(record.measured)[how.settled :] for record in long])
    jerk = np.vstack([_jerk_of_commands(record, how.settled) for record in long])[:, : len(white)]
    smooth = jerk < how.smooth * white[: jerk.shape[1]] ** 2
    still = smooth.all(axis=1, keepdims=True)
    for joint, rows in enumerate((smooth if still.sum() <= how.settled else smooth & still).T):
        if rows.sum() > how.settled:
            restless[joint] = np.mean(rough[rows, joint]) > most[joint] ** 2
    return restless


def _measure_wandering(records: Sequence[Record], white: np.ndarray, period: float, how: FloorSettings) -> np.ndarray:
    """Return how far joints move about what smooth commands explain [rad], shape (n_channels,); 0 without such windows.

    A window of a calm joint is a parabola and its own command, now and a little earlier, as far as noise goes. No
    command of any joint has turned round for a while, which friction and play would answer.
    """
    ticks = max(1, round(how.tick / period))  # of a fast log, that make one of 50 Hz
    length, settled, n, windows = how.wavering * ticks, how.settled * ticks, len(white), []
    for record in records:
        if record.beside is not None or len(record) < 2 * (settled + length):
            continue  # what comes beside positions moves a joint as well
        jerk = _jerk_of_commands(record, how.settled)[:, :n]
        smooth = np.all(jerk < how.smooth * white[: jerk.shape[1]] ** 2, axis=1)
        first, targets, on = len(record.position) - len(smooth), record.targets[:, :n], record.driven > 0.0
        for t in range(settled + how.late[-1] * ticks + 1, len(record.position) - length + 1, length):
            way = np.diff(targets[t - 1 - settled : t - 1 + length], axis=0)
            onward = np.all(way >= 0.0, axis=0) | np.all(way <= 0.0, axis=0)
            calm = smooth[max(0, t - first - settled + how.settled) : t - first + length]
            if np.all(onward) and np.all(calm) and np.all(on[t - 1 - settled : t + length]):
                sent = np.stack([targets[t - 1 - late * ticks :][:length] for late in how.late])
                windows.append((record.measured[t : t + length], sent))
    left = [_measure_remainder(*window) for window in windows[:: max(1, len(windows) // how.windows)]]
    return np.median(left, axis=0) if len(left) >= how.least else np.zeros(n)


def _measure_remainder(positions: np.ndarray, sent: np.ndarray) -> np.ndarray:
    """Return the standard deviation about a parabola and commands in the calmer half of a window, shape (n,).

    What rings after a step is calm later on; what shakes goes on.

    Args:
        positions: Shape (T, n).
        sent: Commands, each some ticks older, shape (lags, T, n).
    """
    parabola = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, len(positions)), 3))[0]
    x, beside = (y - parabola @ (parabola.T @ y) for y in (positions.T[..., None], np.moveaxis(sent, (0, 2), (2, 0))))
    basis, size, _ = np.linalg.svd(beside, full_matrices=False)
    basis = basis * (size > STILL)[:, None]
    left = (x - basis @ (basis.swapaxes(1, 2) @ x))[..., 0]
    free = 1.0 - (3 + (size > STILL).sum(axis=1)) / len(positions)
    return np.sqrt(np.min([(half**2).mean(axis=1) for half in np.array_split(left, 2, axis=1)], axis=0) / free)


def _jerk_of_commands(record: Record, ticks: int) -> np.ndarray:
    """Return the largest squared third difference of what a motor was sent in the last ticks, (T - 2 - ticks, n)."""
    sent = record.commands.reshape(len(record), -1, record.targets.shape[1])[: len(record.position) - 1]
    jerk = third_differences(np.concatenate([sent[:1], sent]).swapaxes(0, 1)).max(axis=0)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(jerk, ticks + 1, axis=0).max(axis=-1))


def spectrum(x: np.ndarray) -> np.ndarray:
    """Return the power of windows by frequency, shape (W, T // 2 + 1, n): white noise has its variance in each."""
    length = x.shape[1]
    taper = np.hanning(length + 2)[1:-1, None]
    taper = taper / np.sqrt((taper**2).mean())
    return np.asarray(np.abs(np.fft.rfft((x - x.mean(axis=1, keepdims=True)) * taper, axis=1)) ** 2 / length)
