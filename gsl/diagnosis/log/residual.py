"""Residuals in units of the noise floor, what they cost, and how joints that shake are compared with their replay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.log.floor import BLOCK, NoiseFloor, in_blocks, spectrum
from gsl.diagnosis.log.records import Pieces
from gsl.diagnosis.settings import FloorSettings

SCALE = 5.0  # floors beyond which a residual counts less and less (Cauchy); 2.4 are 95 % efficient for normal noise
BANDS = 5  # of the spectrum of a joint that shakes
POWER_SD = 0.6  # of the logarithm of its power in one window, measured on replays of shaking by its true cause
LEAST_CALM = 0.5  # of what white noise would move a calm joint by: some is taken for its slow motion. Measured: 0.6
BY_CHANCE = 0.2  # share of a joint's motion that shaking ones explain by chance: two spreads of two windows
OF_BAND = 0.5  # share of the cost of the band that is furthest off: it is the worst of several


def loss(z: np.ndarray) -> np.ndarray:
    """Return the robust cost of residuals: z² where they are small, logarithmic beyond SCALE (Cauchy)."""
    return SCALE**2 * np.log1p((z / SCALE) ** 2)


def weight(z: np.ndarray) -> np.ndarray:
    """Return the weights with which least squares descend the robust cost."""
    return 1.0 / (1.0 + (z / SCALE) ** 2)


@dataclass(frozen=True)
class Comparison:
    """How replays are compared with a log.

    Attributes:
        floor: Standard deviation that noise and a known model error explain [rad], shape (n_joints,).
        shaking: Joints whose phase a log cannot carry, shape (n_joints,).
        sway: How far these swing slowly at rest, or from one repeat to the next [rad], shape (n_joints,).
        carried: Part of the floor of the others: by how much logs differ because these shake [rad], shape (n_joints,).
    """

    floor: np.ndarray
    shaking: np.ndarray
    sway: np.ndarray
    carried: np.ndarray

    @classmethod
    def plain(cls, floor: np.ndarray) -> Comparison:
        """Return a comparison in which no joint shakes."""
        return cls(floor, np.zeros(len(floor), dtype=bool), np.zeros(len(floor)), np.zeros(len(floor)))

    @property
    def noise(self) -> np.ndarray:
        """The floor without what shaking neighbours do: what a simulated log gets [rad], shape (n_joints,)."""
        return np.sqrt(self.floor**2 - self.carried**2)

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


def _bands(x: np.ndarray) -> np.ndarray:
    """Return the mean power but for the mean by band, shape (W, BANDS, n): white noise has its variance in each."""
    power = spectrum(x)
    edges = np.linspace(1, power.shape[1], BANDS + 1).round().astype(int)
    bands = zip(edges[:-1], np.maximum(edges[1:], edges[:-1] + 1), strict=True)  # a slow log has few frequencies
    return np.stack([power[:, min(a, power.shape[1] - 1) : b].mean(axis=1) for a, b in bands], axis=1)


def compare(pieces: Pieces, noise: NoiseFloor, joints: int, settings: FloorSettings) -> Comparison:
    """Return how to compare, with the joints that shake while their commands rest or are smooth.

    The floor of a joint that shakes is white noise, or that of the calm ones: its repeats differ by its phase. Where
    one shakes, the floor of the others holds how it carries them along: twice, for a replay has a phase of its own.

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
    own = [_share_of_its_own(real[rests], joint, settings) for joint, rests in enumerate(resting.T)]
    shakes = np.array([_shakes(x, noise.resolution, settings) for x in at_rest]) & (np.array(own) > settings.own)
    shaking = noise.restless[:joints] | shakes
    calm = np.median(noise.sd[~shaking]) if not shaking.all() else settings.unmeasured * noise.resolution
    sway = np.array([_sway(x) if shakes else 0.0 for x, shakes in zip(at_rest, shaking, strict=True)])
    sway = np.where(shaking, np.maximum(sway, noise.slow), 0.0)
    quiet = np.minimum(noise.sd, np.minimum(calm, noise.white))
    base, carried = np.where(shaking, quiet, noise.sd), np.zeros(joints)
    if shaking.any():
        left = _take_out_commands(pieces, settings)
        carried = _measure_carrying([left[rests] for rests in resting.T], noise, shaking, settings)
        repeated = np.minimum(base, noise.white[:joints])  # repeats differ by it as well, once
        base = np.sqrt(np.maximum(base**2 - carried**2 / 2.0, repeated**2))
    return Comparison(np.hypot(base, carried), shaking, sway, carried)


def _measure_carrying(
    rests: Sequence[np.ndarray], noise: NoiseFloor, shaking: np.ndarray, settings: FloorSettings
) -> np.ndarray:
    """Return by how much logs of joints that do not shake differ because others do [rad], shape (n_joints,).

    It is what the motion of shaking joints explains while a joint rests. Or it is what a joint moves by about smooth
    commands beside white noise, as far as repeats differ. Twice its power counts: a replay swings at another phase.

    Args:
        rests: Of the windows in which each joint rests, what commands do not explain, shape (W, scored, n_channels).
        noise: Of the log.
        shaking: Which joints shake, shape (n_joints,).
        settings: How many windows it takes, and of how many ways in which others move.
    """
    n, by = len(shaking), np.flatnonzero(shaking)
    white = np.where(np.isfinite(noise.white), noise.white, noise.sd)[:n]  # unknown in short records
    power = np.zeros(n)
    for joint in np.flatnonzero(~shaking).tolist():
        explained = 1.0 - _share_of_its_own(rests[joint], joint, settings, by)
        if len(rests[joint]) >= settings.rests and explained > BY_CHANCE:
            power[joint] = explained * (_calmest(rests[joint][..., joint], settings.usual) ** 2).mean()
    if noise.wandering.any():  # there are smooth commands
        calm = np.median((noise.wandering[:n] / white)[~shaking]) if not shaking.all() else 1.0
        moved = (noise.wandering[:n] / np.clip(calm, LEAST_CALM, 1.0)) ** 2 - white**2
        most = noise.sd[:n] ** 2 - white**2 if noise.source == "repeats" else np.inf
        power = np.maximum(power, np.where(noise.wandering[:n] > noise.resolution, np.minimum(moved, most), 0.0))
    return np.where(shaking, 0.0, np.sqrt(2.0 * power))


def _take_out_commands(pieces: Pieces, settings: FloorSettings) -> np.ndarray:
    """Return positions less their line and the main ways in which commands move, shape (W, scored, n_channels)."""
    real, late, motors = pieces.real[:, pieces.warm_up :], settings.late, pieces.windows.motion.shape[2]
    sent = pieces.windows.commands[:, real.shape[1] + late[-1] - 1 :: -1, :motors]
    moved = np.linalg.svd(sent - sent.mean(axis=1, keepdims=True), full_matrices=False)[0][..., : settings.ways]
    lagged = [moved[:, late[-1] - lag :][:, : real.shape[1]] for lag in late]
    line = np.broadcast_to(_line(real.shape[1]), (*real.shape[:2], 2))
    basis = np.linalg.qr(np.concatenate([line, *lagged], axis=2))[0]
    return _take_out(real, basis)


def _calmest(rest: np.ndarray, usual: float) -> np.ndarray:
    """Return the calmest of resting windows, shape (W, scored), each less its line."""
    x = _take_out(rest[..., None], _line(rest.shape[1]))[..., 0]
    return np.asarray(x[np.argsort((x**2).mean(axis=1))[: max(1, round(usual * len(x)))]])


def _line(length: int) -> np.ndarray:
    return np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, length), 2))[0]


def _take_out(x: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Return windows, shape (W, T, n), less what an orthonormal basis explains, shape (T, k) or (W, T, k)."""
    return np.asarray(x - basis @ (np.swapaxes(basis, -1, -2) @ x))


def _share_of_its_own(rest: np.ndarray, joint: int, settings: FloorSettings, by: np.ndarray | None = None) -> float:
    """Return the share of a resting joint's motion that the other joints' does not explain; 1 of a single joint.

    Gravity and inertia of the others bend its servo: by their positions, velocities and accelerations.

    Args:
        rest: Positions in the windows in which it rests, shape (W, scored, n_channels).
        joint: Which.
        settings: What counts as usual, and of how many ways in which the others move.
        by: Which others, if not all.
    """
    (count, length, channels), ways = rest.shape, settings.ways
    if not count or channels == 1 or length < 2 * (3 * ways + 2):
        return 1.0
    others = np.delete(rest, joint, axis=2) if by is None else rest[..., by]
    moved = np.linalg.svd(others - others.mean(axis=1, keepdims=True), full_matrices=False)[0][..., :ways]
    rate = np.gradient(moved, axis=1)
    line = np.broadcast_to(_line(length), (count, length, 2))
    basis = np.linalg.qr(np.concatenate([line, moved, rate, np.gradient(rate, axis=1)], axis=2))[0]
    x = rest[..., [joint]]
    moves, left = ((_take_out(x, part) ** 2).sum(axis=(1, 2)) / (length - part.shape[-1]) for part in (line, basis))
    usual = np.argsort(moves)[: max(1, round(settings.usual * count))]
    return float(left[usual].mean() / max(moves[usual].mean(), 1e-30))


def _sway(rest: np.ndarray) -> float:
    """Return the standard deviation of the means over BLOCK ticks [rad] of what `_calmest` returns; 0 of nothing."""
    if not len(rest):
        return 0.0
    return float(np.sqrt((in_blocks(rest[..., None]).mean(axis=2) ** 2).mean()))


def _shakes(rest: np.ndarray, resolution: float, settings: FloorSettings) -> bool:
    """Whether a resting joint, as `_calmest` returns it, moves by more than rounding and not as noise does.

    What happens in a few windows only is no shaking.
    """
    if len(rest) < settings.rests:
        return False
    power = float((rest**2).mean())
    colour = max(abs(float((rest[:, lag:] * rest[:, :-lag]).mean())) for lag in range(1, settings.lags + 1))
    return power > resolution**2 and colour > settings.coloured * power
