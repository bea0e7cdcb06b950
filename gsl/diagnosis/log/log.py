"""A log ready for a diagnosis: windows, their noise floor, residuals, and which part is for fitting or checking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.labels import alike
from gsl.core.trajectory import Batch
from gsl.diagnosis.log.floor import NoiseFloor, noise_floor
from gsl.diagnosis.log.records import BASE, Pieces, Record, cut_pieces, to_records
from gsl.diagnosis.log.repeats import Repeat, find_repeats
from gsl.diagnosis.log.residual import Comparison, compare
from gsl.diagnosis.settings import LogSettings
from gsl.errors import InputError


@dataclass(frozen=True)
class Cut:
    """A log in windows, of which a part is held out.

    Attributes:
        robot: Whose log it is.
        records: Its trajectories.
        repeats: Which motion each of them is of.
        pieces: All windows.
        train: Windows for fitting, shape (n_train,).
        held_out: Windows for checking, shape (n_held_out,).
        period: Control period [s].
        by_record: Whether whole records are held out; else parts of one, which is weaker.
        asked: Indices of the records that a label holds out.
        order: Place in the batch of each record.
        made_at: Physics period of the simulator of gsl's own that made it [s], None of any other log.
        settings: How it was cut.
    """

    robot: Robot
    records: tuple[Record, ...]
    repeats: tuple[Repeat, ...]
    pieces: Pieces
    train: np.ndarray
    held_out: np.ndarray
    period: float
    by_record: bool
    asked: tuple[int, ...]
    order: tuple[int, ...]
    made_at: float | None
    settings: LogSettings

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the logged joints."""
        return self.robot.controlled

    @property
    def walking(self) -> bool:
        """Whether the robot is on the ground."""
        return self.records[0].base is not None

    @property
    def motions(self) -> int:
        """Number of different motions: repeats are one."""
        return len({repeat.motion for repeat in self.repeats})

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of what is compared: the joints, and the base if it moves."""
        return (*self.joints, *BASE) if self.walking else self.joints


@dataclass(frozen=True)
class Log(Cut):
    """A log in windows, with what counts as noise in it.

    Attributes:
        noise: The noise floor.
        comparison: How replays are compared with it.
    """

    noise: NoiseFloor
    comparison: Comparison

    @property
    def train_pieces(self) -> Pieces:
        """The windows of a fit."""
        return self.pieces.take(spread(self.train, self.settings.fit_windows))

    @property
    def held_out_pieces(self) -> Pieces:
        """The windows of a check."""
        return self.pieces.take(spread(self.held_out, self.settings.check_windows))

    @property
    def used(self) -> np.ndarray:
        """How many residuals of a window count for each channel, shape (n_channels,)."""
        return self.comparison.count_residuals(self.pieces.scored)

    @property
    def shaking_share(self) -> float:
        """The share of the residuals that are of joints that shake."""
        return float(self.used[self.comparison.shaking].sum() / self.used.sum())

    def residual(self, replayed: np.ndarray) -> np.ndarray:
        """Return the residuals of replays of all windows, shape (W, T, n_channels), in floors, (W, scored, ...)."""
        return self.comparison.residual(replayed, self.pieces)

    def only_train(self) -> Log:
        """Return the log of which nothing but the windows for fitting is seen."""
        return replace(self, pieces=self.pieces.take(self.train))

    def with_model_error(self, error: np.ndarray) -> Log:
        """Return the log with a floor that holds a known error of the model, [rad], shape (n_channels,)."""
        return replace(self, comparison=replace(self.comparison, floor=np.hypot(self.comparison.floor, error)))


def cut_log(
    batch: Batch,
    robot: Robot,
    *,
    walking: bool = False,
    held_out: Mapping[str, Any] | None = None,
    blocks: bool = False,
    settings: LogSettings | None = None,
) -> Log:
    """Cut a batch into windows as `cut` does, and measure its noise."""
    part = cut(batch, robot, walking=walking, held_out=held_out, blocks=blocks, settings=settings)
    how, joints = part.settings, np.full(len(robot.controlled), robot.encoder_step / np.sqrt(12.0))
    least = np.r_[joints, list(how.base_floor)] if walking else None
    noise = noise_floor(part.records, part.repeats, part.period, robot.encoder_step, least, part.asked, how.floor)
    comparison = Comparison.plain(noise.sd) if walking else compare(part.pieces, noise, len(joints), how.floor)
    return Log(**{each.name: getattr(part, each.name) for each in fields(part)}, noise=noise, comparison=comparison)


def cut(
    batch: Batch,
    robot: Robot,
    *,
    walking: bool = False,
    held_out: Mapping[str, Any] | None = None,
    blocks: bool = False,
    settings: LogSettings | None = None,
) -> Cut:
    """Cut a batch into windows and part it; the order of its trajectories changes nothing.

    Args:
        batch: Of this robot, with records long enough for a window.
        robot: Whose motors follow.
        walking: Whether it is on the ground.
        held_out: Labels of the records that are for checking; without any, every second motion is.
        blocks: Whether blocks of every motion are, where no name says which motions are variants of one: unlike
            motions have regimes of their own, in which a fit to the others would be off.
        settings: How.

    Raises:
        InputError: No record, or every one, has these labels; or effects are known of records on the ground.
    """
    how, period = settings or LogSettings(), batch.control_period
    records, order = _sort(to_records(batch, robot, walking=walking))
    if walking and any(record.conditions for record in records):
        raise InputError("conditions of a trajectory are for logs in the air; leave them out of its label")
    repeats = tuple(find_repeats(records, period, how.repeats))
    asked = tuple(label_indices([record.about for record in records], held_out or {}))
    parts = (how.walk_warm_up, how.walk_scored) if walking else (how.warm_up, how.scored)
    warm_up, scored = (round(part / period) for part in parts)
    pieces = cut_pieces(records, robot, period, warm_up=warm_up, scored=scored)
    if walking:
        pieces = pieces.take(spread(np.arange(len(pieces)), how.walk_windows))
    held, by_record = _hold_out(records, repeats, pieces, asked, how.block * scored if blocks else 0)
    train, check = np.flatnonzero(~held), np.flatnonzero(held)
    made_at = _read_step(batch)
    return Cut(robot, records, repeats, pieces, train, check, period, by_record, asked, order, made_at, how)


def _read_step(batch: Batch) -> float | None:
    world = batch.metadata.get("world")
    step = world.get("step") if isinstance(world, Mapping) else None
    return float(step) if isinstance(step, int | float) else None


def _sort(records: Sequence[Record]) -> tuple[tuple[Record, ...], tuple[int, ...]]:
    """Return records in an order of their own, by name and content, and their places before."""

    def key(k: int) -> tuple[str, bytes, bytes]:
        return _name(records[k]), records[k].commands.tobytes(), records[k].position.tobytes()

    order = tuple(sorted(range(len(records)), key=key))
    return tuple(records[k] for k in order), order


def _name(record: Record) -> str:
    """Return a motion's name, empty if it is only that of its file: files may be called anything."""
    return "" if record.about.get("file") == record.name else record.name


def _hold_out(
    records: Sequence[Record], repeats: Sequence[Repeat], pieces: Pieces, asked: Sequence[int], block: int
) -> tuple[np.ndarray, bool]:
    """Hold out what is asked for, else every second motion in the records' order; repeats stay together.

    Of motions without names, and of repeats of one, every second block is held out, if blocks have a length [ticks].
    """
    if asked:
        return np.isin(pieces.record, asked), True
    motion = np.array([repeat.motion for repeat in repeats])
    motions = motion.max() + 1
    alike = motions == 1 and len(records) > 1  # of which no repeat may show what another one is held out for
    if block and (alike or (motions > 1 and not any(_name(record) for record in records))):
        later = np.array([round(repeat.later) for repeat in repeats])[pieces.record]
        return ((pieces.tick - later) // block + motion[pieces.record]) % 2 == 1, False
    if motions > 1:
        return motion[pieces.record] % 2 == 1, True
    return pieces.tick // pieces.scored % 2 == 1, False


def label_indices(records: Sequence[Mapping[str, Any]], asked: Mapping[str, Any]) -> list[int]:
    """Return the indices of the records that have some labels, each a value or several; none without labels.

    Args:
        records: What each is called and labelled.
        asked: The labels.

    Raises:
        InputError: None of them has, or every one.
    """
    if not asked:
        return []
    wanted = {key: value if isinstance(value, list | tuple) else [value] for key, value in asked.items()}
    chosen = [
        k
        for k, about in enumerate(records)
        if all(any(alike(about.get(key), value) for value in some) for key, some in wanted.items())
    ]
    if 0 < len(chosen) < len(records):
        return chosen
    labels = ", ".join(f"{key}: {value}" for key, value in asked.items())
    values = {key: sorted({str(about.get(key)) for about in records}) for key in asked}
    there = "; ".join(f"{key} is {', '.join(some)}" for key, some in values.items())
    which = "every trajectory" if chosen else "no trajectory"
    raise InputError(f"held_out: {which} of the log has {{{labels}}}; there {there}")


def spread(index: np.ndarray, most: int) -> np.ndarray:
    """Return at most so many of some indices, spread evenly over them."""
    return index[np.unique(np.linspace(0, len(index) - 1, min(most, len(index))).round().astype(int))]
