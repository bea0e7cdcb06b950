"""Replays of a log's windows by a learned servo, each under what is known of its record: a gain, a load."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis.log.records import Pieces
from gsl.diagnosis.simulate.in_the_air import Effects
from gsl.effects.effect import apply_all, build
from gsl.models.servo import ServoModel
from gsl.worlds.held import Held, Windows, shares


@dataclass(frozen=True)
class Replays:
    """A plant with room for a learned servo.

    Attributes:
        plant: What the servo stands on.
        step: Physics period [s].
        period: Control period [s].
        threads: That replay side by side.
        pool: In which.
        model: The servo, if it is a fixed one.
    """

    plant: Plant
    step: float
    period: float
    threads: int
    pool: Executor = field(repr=False, compare=False)
    model: ServoModel | None = None

    @property
    def joints(self) -> int:
        """Number of logged joints, which come first among the motors."""
        return len(self.plant.robot.controlled)

    def having(self, model: ServoModel) -> Replays:
        """Return the same with a fixed servo."""
        return replace(self, model=model)

    def group_by_plant(self, pieces: Pieces) -> list[tuple[Plant, np.ndarray]]:
        """Return windows by what is known of their records: the plant, and indices, shape (k,)."""
        return [(apply_all(self.plant, build(effects)), index) for effects, index in pieces.alike]

    def replay(self, model: ServoModel | None, pieces: Pieces) -> np.ndarray:
        """Return the replayed positions [rad], shape (W, T, n_joints); NaN where a replay diverges."""
        result = np.empty((len(pieces), pieces.windows.length, self.joints))
        for plant, index in self.group_by_plant(pieces):
            held = Held.of(plant if model is None else model.on(plant), self.step, self.period)
            windows = [
                Windows(*(part[index[share]] for part in pieces.windows)) for share in shares(len(index), self.threads)
            ]
            result[index] = np.concatenate(list(self.pool.map(held.replay, windows)))[..., : self.joints]
        return result

    def simulate(self, effects: Effects, shifts: np.ndarray, pieces: Pieces) -> np.ndarray:
        """Return what the fixed servo replays, as a simulator without effects of its own does."""
        assert not effects and not shifts.any(), "effects lie below a learned servo"
        return self.replay(self.model, pieces)
