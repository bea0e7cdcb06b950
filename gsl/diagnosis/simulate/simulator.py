"""A simulator of a log: in the air the chain model, on the ground Bullet; and a part of a log on which it competes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from gsl.core.body import Robot
from gsl.core.plant import Plant
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.log.log import spread as spread_evenly
from gsl.diagnosis.log.records import Pieces, Record, cut_pieces
from gsl.diagnosis.log.residual import Comparison
from gsl.diagnosis.simulate.in_the_air import Effects, InTheAir, Item, Result, change, replay_in_bullet
from gsl.diagnosis.simulate.on_ground import Walking
from gsl.worlds.fits import fitting_step
from gsl.worlds.held import Held

CHECKED = 12  # held-out windows that are replayed in Bullet, and windows on which a step is chosen
SMALL = 0.1  # share of the floor that the time step may be off
HALVINGS = 3  # of the step, at most: replays take as many times as long
FINEST = 2.4e-4  # step [s]: encoders remember so many of half this size that a sensor delay of 30 ms is within


class Replayer(Protocol):
    """Something that replays windows."""

    @property
    def period(self) -> float:
        """Control period [s]."""

    def simulate(self, effects: Effects, shifts: np.ndarray, pieces: Pieces) -> np.ndarray:
        """Return what would be logged, shape (W, T, n_channels); NaN where a replay diverges."""


class Simulator(Replayer, Protocol):
    """The simulator that a diagnosis asks.

    Attributes:
        calibrates: Whether all shifts are fitted in its replays; else zeros alone.
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
    def log_step(self) -> float:
        """Physics period of logs that a self-test makes [s]."""

    @property
    def accurate(self) -> bool:
        """Whether errors of replays fall with the square of the step."""

    def side_by_side(
        self, work: Callable[[Any, Item], Result], items: Sequence[Item], done: Callable[[Result], object]
    ) -> list[Result]:
        """Return what some work makes of each item, in their order; their number and that of threads change no bit.

        Args:
            work: Gets a simulator, with fewer threads than this one, and an item; runs in any thread and keeps no
                state.
            items: Of the work.
            done: Called with each result in turn, in the caller's thread; what it raises ends the work.
        """


def simulator_of(log: Log, plant: Plant, step: float, *, threads: int = 1, spread: float = 1.0) -> Simulator:
    """Return what replays a log's commands in a plant, in steps of half the size where joints shake.

    In the air a log of gsl's own is replayed as it was made, any other by a second-order scheme, in steps that are so
    small that they are no part of the gap.

    Args:
        log: Whose commands.
        plant: The simulator as the user has it.
        step: Its physics period [s], at most.
        threads: That fit, screen and replay side by side; of a walk processes that replay.
        spread: Of the robot's calibration about this one, as a share of the usual spread of one make.
    """
    if log.walking:
        return Walking(plant, fitting_step(step, log.period), log.period, workers=threads)
    own = log.made_at == step  # a world of gsl's at this step: the same errors on both sides are no gap
    step *= 0.5 if log.comparison.shaking.any() else 1.0
    if own:
        return InTheAir(plant, fitting_step(step, log.period), log.period, threads, spread)
    return InTheAir(plant, _find_step(log, plant, step), log.period, threads, spread, accurate=True)


def _find_step(log: Log, plant: Plant, step: float) -> float:
    """Return the physics period [s], at most `step`, at which replays are a small part of the floor off."""
    windows: Any = log.pieces.take(spread_evenly(np.arange(len(log.pieces)), CHECKED)).windows
    floor = log.comparison.floor
    for _ in range(HALVINGS):
        step = fitting_step(step, log.period)
        coarse, fine = (Held.of(plant, part, log.period, accurate=True).replay(windows) for part in (step, 0.5 * step))
        apart = np.sqrt(np.mean((coarse - fine)[..., : len(floor)] ** 2, axis=(0, 1)))
        if (apart < SMALL * floor).all():
            break
        step *= 0.5
    return fitting_step(max(step, FINEST), log.period)


@dataclass(frozen=True)
class Bench:
    """A part of a log on which hypotheses compete.

    Attributes:
        simulator: What replays.
        pieces: The windows.
        comparison: How both are compared.
    """

    simulator: Simulator
    pieces: Pieces
    comparison: Comparison

    @property
    def joints(self) -> int:
        """Number of logged joints, base channels included."""
        return self.pieces.real.shape[2]

    def residual(self, effects: Effects, shifts: np.ndarray) -> np.ndarray:
        """Return residuals in units of the floor, shape (W, scored, n_joints)."""
        return self.comparison.residual(self.simulator.simulate(effects, shifts, self.pieces), self.pieces)


def mean_errors(
    simulator: Replayer, effects: Effects, shifts: np.ndarray, records: Sequence[Record], robot: Robot
) -> np.ndarray:
    """Return the mean absolute error of whole trajectories replayed open loop, shape (n_records, n_joints) [rad].

    Windows start anew from what was measured; here errors may add up, as they do in whoever trains in the simulator.
    The error is NaN where a replay diverges, and of trajectories whose torque is never on.

    Args:
        simulator: What replays.
        effects: That are switched on.
        shifts: Calibration, shape (7, n_joints).
        records: In the air, each replayed from where its torque is first on to where it is switched off.
        robot: Theirs.
    """
    errors = []
    for record in (record.cut_to_driven() for record in records):
        if not len(record):
            errors.append(np.full(record.position.shape[1], np.nan))
            continue
        whole = cut_pieces([record], robot, simulator.period, warm_up=0, scored=len(record))
        errors.append(np.abs(simulator.simulate(effects, shifts, whole) - whole.real).mean(axis=(0, 1)))
    return np.array(errors)


def compare_with_bullet(
    log: Log, simulator: Simulator, effects: Effects, shifts: np.ndarray, iterations: int = 50
) -> dict[str, Any]:
    """Return how far Bullet and the chain model differ in held-out windows [mrad], and Bullet's gap in floors.

    Args:
        log: In the air.
        simulator: The chain model.
        effects: That are switched on in both.
        shifts: Calibration of both, shape (7, n_joints).
        iterations: Of Bullet's solver.
    """
    index = log.held_out[np.unique(np.linspace(0, len(log.held_out) - 1, CHECKED).round().astype(int))]
    part = log.pieces.take(index)
    plant = change(simulator.plant, effects, shifts)
    bullet = replay_in_bullet(plant, part, step=simulator.log_step, period=simulator.period, iterations=iterations)
    chain = simulator.simulate(effects, shifts, part)
    z = log.comparison.residual(bullet, part)
    difference = float(np.sqrt(np.mean((bullet - chain)[:, part.warm_up :] ** 2)))
    return {"windows": len(part), "chain_rms_mrad": 1e3 * difference, "rms": float(np.sqrt(np.mean(z**2)))}
