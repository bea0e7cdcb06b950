"""Counterfactuals: what a simulator with other effects and nuisances says to the commands of a log."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis.nuisance import calibrated
from gsl.diagnosis.records import Pieces
from gsl.diagnosis.residual import Comparison
from gsl.effects.effect import applied, built
from gsl.worlds.held import Held, Windows, shares

Effects = Mapping[str, Any]


@dataclass(frozen=True)
class InTheAir:
    """Replays of a robot that is held, by the chain model.

    Attributes:
        plant: The simulator as the user has it.
        step: Physics period [s].
        period: Control period [s].
        threads: That replay side by side.
        spread: Of the robot's calibration about this one, as a share of the usual spread of one make.
    """

    plant: Plant
    step: float
    period: float
    threads: int = 1
    spread: float = 1.0
    calibrates = True
    _pool: ThreadPoolExecutor = field(default_factory=ThreadPoolExecutor, repr=False, compare=False)

    def told(self, effects: Effects, nuisances: np.ndarray, pieces: Pieces) -> np.ndarray:
        """Return the replayed positions [rad], shape (W, T, n_joints); NaN where a replay diverges."""
        plant = calibrated(applied(self.plant, built(effects)), nuisances)
        alike = pieces.alike
        if len(alike) == 1:
            return self._replayed(applied(plant, built(alike[0][0])), pieces.windows)[..., : nuisances.shape[1]]
        result = np.empty((len(pieces), pieces.windows.length, nuisances.shape[1]))
        for known, index in alike:
            windows = Windows(*(part[index] for part in pieces.windows))
            result[index] = self._replayed(applied(plant, built(known)), windows)[..., : nuisances.shape[1]]
        return result

    def _replayed(self, plant: Plant, windows: Any) -> np.ndarray:
        held = Held.of(plant, self.step, self.period)
        slices = shares(len(windows.clock), self.threads)
        parts = [Windows(*(part[share] for part in windows)) for share in slices]
        result = np.empty((len(windows.clock), windows.length, len(plant.robot.motors)))
        for share, told in zip(slices, self._pool.map(held.replay, parts), strict=True):
            result[share] = told
        return result


class Simulator(Protocol):
    """Something that replays windows.

    Attributes:
        calibrates: Whether all nuisances are fitted in its replays; else zeros alone.
    """

    calibrates: bool

    @property
    def spread(self) -> float:
        """Of the robot's calibration about this one, as a share of the usual spread of one make."""

    @property
    def plant(self) -> Plant:
        """The simulator as the user has it."""

    @property
    def step(self) -> float:
        """Physics period [s]."""

    @property
    def period(self) -> float:
        """Control period [s]."""

    def told(self, effects: Effects, nuisances: np.ndarray, pieces: Pieces) -> np.ndarray:
        """Return what replays say, shape (W, T, n_channels)."""


@dataclass(frozen=True)
class Bench:
    """A log on which counterfactuals compete.

    Attributes:
        simulator: What replays.
        pieces: The log's windows.
        comparison: How both are compared.
    """

    simulator: Simulator
    pieces: Pieces
    comparison: Comparison

    @property
    def joints(self) -> int:
        """Number of logged joints, base channels included."""
        return self.pieces.real.shape[2]

    def residual(self, effects: Effects, nuisances: np.ndarray) -> np.ndarray:
        """Return residuals in units of the floor, shape (W, scored, n_joints)."""
        return self.comparison.residual(self.simulator.told(effects, nuisances, self.pieces), self.pieces)
