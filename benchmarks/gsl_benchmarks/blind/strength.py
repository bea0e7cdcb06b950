"""Strength: how far an effect moves a robot away from its simulator, in floors, and how far to turn it up for that.

    gap = sqrt(1 + mean(((replay - robot with the effect) - (replay - robot without it))² / noise²))

over windows of a second, replayed in the nominal simulator from measured states as a diagnosis does, and over the
joints that the effect acts on. Jitter is left out, for it alone makes gaps of two floors; so is the encoders' noise, of
which the 1 stands. Where a generator has no model error it is the raw gap of a robot that has only this effect.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gsl.core.body import lump
from gsl.core.plant import Plant
from gsl.diagnosis.log.records import Pieces, Record, cut_pieces, slope
from gsl.diagnosis.settings import LogSettings
from gsl.worlds.held import Held, Windows
from gsl_benchmarks.blind.mix import MEDIUM, STRONG, WEAK
from gsl_benchmarks.blind.programmes import Programme

BANDS = {WEAK: (1.5, 3.0), MEDIUM: (3.0, 8.0), STRONG: (8.0, 20.0)}  # [floors]; beyond 20 nothing is left to learn
INSIDE = 1.03  # how far from the band's ends a target stays, as a factor
LEAST_SHARE = 1e-3  # of a range, where a search begins
HALVINGS, CLOSE = 14, 0.02  # of the search; relative distance from the target at which it ends
WORST = 1e3  # floors that a diverging replay counts

Player = Callable[
    [Plant, Mapping[str, Any], Mapping[str, Any] | None, Sequence[np.ndarray], Sequence[np.ndarray], float],
    list[np.ndarray],
]
"""A generator, see `same.play_same`: what the encoders of a robot with effects tell while it plays a programme."""


@dataclass(frozen=True)
class Yardstick:
    """What measures gaps of one generator on one programme.

    Attributes:
        plant: The nominal simulator.
        step, period: Its physics and control periods [s].
        player: The generator.
        programme: The commands.
        without: Residuals of the nominal robot without an effect [rad], shape (W, scored, n_joints).
    """

    plant: Plant
    step: float
    period: float
    player: Player
    programme: Programme
    without: np.ndarray

    @classmethod
    def of(cls, plant: Plant, step: float, period: float, player: Player, programme: Programme) -> Yardstick:
        """Play and replay the nominal robot."""
        blank = cls(plant, step, period, player, programme, np.zeros(()))
        return cls(plant, step, period, player, programme, blank._residual({}, None))

    def gap(
        self, effects: Mapping[str, Any], extra: Mapping[str, Any] | None, joints: np.ndarray, noise: float
    ) -> float:
        """Return the gap in floors.

        Args:
            effects: As a world's `effects:`.
            extra: From outside the library.
            joints: That count, shape (n_joints,).
            noise: The floor [rad].
        """
        moved = self._residual(effects, extra) - self.without
        z = np.clip(np.nan_to_num(moved / noise, nan=WORST), -WORST, WORST)
        return float(np.sqrt(1.0 + np.mean(z[..., joints] ** 2)))

    def _residual(self, effects: Mapping[str, Any], extra: Mapping[str, Any] | None) -> np.ndarray:
        robot = lump(self.plant.robot)
        targets, n = self.programme.targets(robot), len(robot.controlled)
        played = self.player(self.plant, effects, extra, targets, [path[0] for path in targets], self.period)
        if not all(np.isfinite(path).all() for path in played):
            return np.full(self.without.shape, np.nan)
        made = [
            Record(name, path, position[:, :n], slope(position[:, :n], self.period))
            for name, path, position in zip(self.programme.names, targets, played, strict=True)
        ]
        warm_up, scored = (round(part / self.period) for part in (LogSettings.warm_up, LogSettings.scored))
        cut = cut_pieces(made, robot, self.period, warm_up=warm_up, scored=scored)
        return self._replay(cut)[:, warm_up:, :n] - cut.real[:, warm_up:]

    def _replay(self, cut: Pieces) -> np.ndarray:
        assert isinstance(cut.windows, Windows)
        return Held.of(self.plant, self.step, self.period).replay(cut.windows)


def turn_up(
    gap: Callable[[float], float],
    strength: str,
    rng: np.random.Generator,
    bands: Mapping[str, tuple[float, float]] = BANDS,
) -> tuple[float, float] | None:
    """Return the share of an effect's range at which its gap lies in a band, and the gap; None if it cannot.

    An effect that makes such a gap with hardly any of its range is not turned up: its truth would have no size. So does
    play, whose teeth are elastic however narrow it is.

    Args:
        gap: From the share to the gap.
        strength: Name of the band.
        rng: Of the target in it, log-uniform.
        bands: Ends of each band [floors].
    """
    low, high = bands[strength][0] * INSIDE, bands[strength][1] / INSIDE
    most = gap(1.0)
    if most < low or gap(LEAST_SHARE) >= low:
        return None
    target = float(np.exp(rng.uniform(np.log(low), np.log(min(high, most)))))
    below, above = np.log(LEAST_SHARE), 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (below + above)
        size = gap(float(np.exp(middle)))
        if abs(size / target - 1.0) < CLOSE:
            break
        below, above = (middle, above) if size < target else (below, middle)
    return (float(np.exp(middle)), size) if low <= size <= high else None
