"""An experiment: a log cut into windows, its noise floor, and which part is for fitting and which for checking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.labels import alike
from gsl.core.plant import Plant
from gsl.core.trajectory import Batch
from gsl.diagnosis.noise_floor import NoiseFloor, noise_floor
from gsl.diagnosis.on_ground import Walking
from gsl.diagnosis.records import BASE, Pieces, Record, pieces, records
from gsl.diagnosis.replay import Bench, InTheAir, Simulator
from gsl.diagnosis.residual import Comparison, comparison
from gsl.errors import InputError
from gsl.worlds.fits import fitting_step

WARM_UP, SCORED = 0.4, 0.6  # of a window [s]: shorter warm-ups bias friction, whose state a log does not show
ON_GROUND = (0.1, 0.2)  # the same for a walk, where replays part soon
WALKS = 200  # windows of walks that are looked at, spread over all
LEAST = {
    "x": 1e-3,
    "y": 1e-3,
    "z": 1e-3,
    "roll": 2e-3,
    "pitch": 2e-3,
    "yaw": 2e-3,
}  # floor of the base [m], [rad]: estimate
FIT_WINDOWS = 32  # windows that a fit uses, spread over the training records
CHECKS = 400  # and a check, over the others
STILL = 1e-6  # a command that moves less rests [rad]


@dataclass(frozen=True)
class Experiment:
    """A log ready for counterfactuals.

    Attributes:
        robot: Whose log it is.
        records: Its trajectories.
        pieces: All windows.
        noise: The noise floor.
        comparison: How replays are compared with it.
        train: Windows for fitting, shape (n_train,).
        held_out: Windows for checking, shape (n_held_out,).
        period: Control period [s].
        by_record: Whether whole records are held out; else parts of one, which is weaker.
    """

    robot: Robot
    records: tuple[Record, ...]
    pieces: Pieces
    noise: NoiseFloor
    comparison: Comparison
    train: np.ndarray
    held_out: np.ndarray
    period: float
    by_record: bool

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the logged joints."""
        return self.robot.controlled

    @property
    def walking(self) -> bool:
        """Whether the robot is on the ground."""
        return self.records[0].base is not None

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of what is compared: the joints, and the base if it moves."""
        return (*self.joints, *BASE) if self.walking else self.joints

    def simulator(self, plant: Plant, step: float, threads: int, spread: float) -> Simulator:
        """Return what replays the log's commands in a plant, in steps of half the size where joints shake."""
        if self.walking:
            return Walking(plant, fitting_step(step, self.period), self.period, workers=threads)
        fine = 0.5 if self.comparison.shaking.any() else 1.0
        return InTheAir(plant, fitting_step(fine * step, self.period), self.period, threads, spread)

    def bench(self, simulator: Simulator, part: str) -> Bench:
        """Return the windows of a part, `train` (thinned), `held_out` or `all`, with a simulator."""
        chosen = {
            "train": _spread(self.train, FIT_WINDOWS),
            "held_out": _spread(self.held_out, CHECKS),
            "all": np.arange(len(self.pieces)),
        }
        return Bench(simulator, self.pieces.chosen(chosen[part]), self.comparison)

    def with_model_error(self, error: np.ndarray) -> Experiment:
        """Return the experiment with a floor that holds a known error of the model, [rad], shape (n_joints,)."""
        return replace(self, comparison=replace(self.comparison, floor=np.hypot(self.comparison.floor, error)))


def experiment(
    batch: Batch, robot: Robot, *, walking: bool = False, held_out: Mapping[str, Any] | None = None
) -> Experiment:
    """Prepare a log.

    Args:
        batch: Of this robot, with records long enough for a window.
        robot: Whose motors follow.
        walking: Whether it is on the ground.
        held_out: Labels of the records that are for checking; without any, every second motion is.

    Raises:
        InputError: No record, or every one, has these labels; or effects are known of records on the ground.
    """
    found, period = records(batch, robot, walking=walking), batch.control_period
    if walking:
        if any(one.conditions for one in found):
            raise InputError("conditions of a trajectory are for logs in the air; leave them out of its label")
        return _on_ground(found, robot, period, labelled(found, held_out or {}))
    warm_up, scored = round(WARM_UP / period), round(SCORED / period)
    asked = labelled(found, held_out or {})
    noise = noise_floor(found, robot.encoder_step, held=asked)
    cut = pieces(found, robot, period, warm_up=warm_up, scored=scored)
    commands = cut.windows.commands[:, : warm_up + scored, : len(robot.controlled)]
    held, by_record = _held_out(found, cut, asked)
    how = comparison(cut, noise, np.ptp(commands, axis=1) < STILL)
    return Experiment(robot, found, cut, noise, how, np.flatnonzero(~held), np.flatnonzero(held), period, by_record)


def _on_ground(found: tuple[Record, ...], robot: Robot, period: float, asked: Sequence[int]) -> Experiment:
    warm_up, scored = (round(part / period) for part in ON_GROUND)
    cut = pieces(found, robot, period, warm_up=warm_up, scored=scored)
    cut = cut.chosen(_spread(np.arange(len(cut)), WALKS))
    joints = np.full(len(robot.controlled), robot.encoder_step / np.sqrt(12.0))
    noise = noise_floor(found, robot.encoder_step, np.r_[joints, list(LEAST.values())], asked)
    held, by_record = _held_out(found, cut, asked)
    how = Comparison(noise.sd, np.zeros(len(noise.sd), dtype=bool), np.zeros(len(noise.sd)))
    return Experiment(robot, found, cut, noise, how, np.flatnonzero(~held), np.flatnonzero(held), period, by_record)


def _held_out(found: Sequence[Record], cut: Pieces, asked: Sequence[int]) -> tuple[np.ndarray, bool]:
    """Hold out what is asked for, else every second motion in the order of the names; repeats stay together."""
    if asked:
        return np.isin(cut.record, asked), True
    motions: dict[bytes, list[int]] = {}
    for index in sorted(range(len(found)), key=lambda k: (found[k].name, k)):
        motions.setdefault(np.round(found[index].targets, 6).tobytes(), []).append(index)
    if len(motions) > 1:
        held = [index for k, group in enumerate(motions.values()) if k % 2 for index in group]
        return np.isin(cut.record, held), True
    return np.arange(len(cut)) % 2 == 1, False


def labelled(found: Sequence[Record], asked: Mapping[str, Any]) -> list[int]:
    """Return the indices of the records that have some labels, each a value or one of several; none without labels.

    Raises:
        InputError: None of them has, or every one.
    """
    if not asked:
        return []
    wanted = {key: value if isinstance(value, list | tuple) else [value] for key, value in asked.items()}
    chosen = [
        k
        for k, one in enumerate(found)
        if all(any(alike(one.about.get(key), value) for value in some) for key, some in wanted.items())
    ]
    if 0 < len(chosen) < len(found):
        return chosen
    told = ", ".join(f"{key}: {value}" for key, value in asked.items())
    known = {key: sorted({str(one.about.get(key)) for one in found}) for key in asked}
    there = "; ".join(f"{key} is {', '.join(values)}" for key, values in known.items())
    which = "every trajectory" if chosen else "no trajectory"
    raise InputError(f"held_out: {which} of the log has {{{told}}}; there {there}")


def _spread(index: np.ndarray, most: int) -> np.ndarray:
    return index[np.unique(np.linspace(0, len(index) - 1, min(most, len(index))).round().astype(int))]
