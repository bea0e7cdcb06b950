"""What a simulator of a robot that is held in the air answers to commands, by the chain model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from gsl.core.body import lump
from gsl.core.interruption import checkpoint
from gsl.core.plant import Plant
from gsl.core.slides import in_metres, levers
from gsl.diagnosis.log.records import Pieces, Record, group_alike
from gsl.diagnosis.simulate.calibration import HALF_STEP, calibrate
from gsl.effects.effect import apply_all, build
from gsl.worlds.engine import Engine
from gsl.worlds.fits import fitting_step
from gsl.worlds.held import Held, Windows, shares
from gsl.worlds.physics import Physics
from gsl.worlds.servo_state import COMMANDS
from gsl.worlds.start import resting

Effects = Mapping[str, Any]
"""A world's `effects:` mapping."""
Item = TypeVar("Item")
Result = TypeVar("Result")


def change(plant: Plant, effects: Effects, shifts: np.ndarray | None = None) -> Plant:
    """Return the plant with effects switched on and, on top of them, a calibration, shape (7, n_joints)."""
    changed = apply_all(plant, build(effects))
    return changed if shifts is None else calibrate(changed, shifts)


@dataclass(frozen=True)
class InTheAir:
    """Replays of a robot that is held, by the chain model.

    Attributes:
        plant: The simulator as the user has it.
        step: Physics period [s].
        period: Control period [s].
        threads: That fit, screen and replay side by side.
        spread: Of the robot's calibration about this one, as a share of the usual spread of one make.
        accurate: Whether errors fall with the square of the step; if not, replays are those of Bullet at this step.
    """

    plant: Plant
    step: float
    period: float
    threads: int = 1
    spread: float = 1.0
    accurate: bool = False
    calibrates = True
    _pool: ThreadPoolExecutor = field(default_factory=ThreadPoolExecutor, repr=False, compare=False)

    @property
    def log_step(self) -> float:
        """Physics period of the logs of a self-test [s]: where replays are accurate another one, by another scheme.

        That scheme is half a step ahead of its commands: of a coarse one chance would gain as of a cause.
        """
        return fitting_step(min(0.5 * self.step, 2.0 * HALF_STEP), self.period) if self.accurate else self.step

    def simulate(self, effects: Effects, shifts: np.ndarray, pieces: Pieces) -> np.ndarray:
        """Return the replayed positions [rad], shape (W, T, n_joints); NaN where a replay diverges."""
        checkpoint()  # threads hear of no Ctrl-C by themselves
        plant, joints = change(self.plant, effects, shifts), shifts.shape[1]
        if len(pieces.alike) == 1:
            return self._replay(change(plant, pieces.alike[0][0]), pieces.windows)[..., :joints]
        result = np.empty((len(pieces), pieces.windows.length, joints))
        for conditions, index in pieces.alike:
            windows = Windows(*(part[index] for part in pieces.windows))
            result[index] = self._replay(change(plant, conditions), windows)[..., :joints]
        return result

    def side_by_side(
        self, work: Callable[[Any, Item], Result], items: Sequence[Item], done: Callable[[Result], object]
    ) -> list[Result]:
        """Return what some work makes of each item, as many at once as there are threads; see `Simulator`."""
        results, share = list[Result](), replace(self, threads=max(1, self.threads // max(1, len(items))))
        with ThreadPoolExecutor(max(1, self.threads)) as pool:
            try:
                for result in pool.map(lambda item: work(share, item), items):
                    results.append(result)
                    done(result)
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
        return results

    def _replay(self, plant: Plant, windows: Any) -> np.ndarray:
        held = Held.of(plant, self.step, self.period, self.accurate)
        if self.threads == 1:
            return held.replay(windows)
        slices = shares(len(windows.clock), self.threads)
        parts = [Windows(*(part[share] for part in windows)) for share in slices]
        result = np.empty((len(windows.clock), windows.length, len(plant.robot.motors)))
        for share, positions in zip(slices, self._pool.map(held.replay, parts), strict=True):
            result[share] = positions
        return result


def play(
    records: Sequence[Record],
    plant: Plant,
    starts: Sequence[np.ndarray],
    *,
    step: float,
    period: float,
    settle: int,
    accurate: bool = False,
) -> list[np.ndarray]:
    """Return what a plant logs to the commands of records [rad], shapes (T + 1, n_motors).

    Args:
        records: Of which the commands and the conditions count.
        plant: With effects and calibration.
        starts: Positions at rest before them [rad], shape (n_motors,) each.
        step: Physics period [s].
        period: Control period [s].
        settle: Control periods for which the first command is held before a record begins.
        accurate: Whether errors fall with the square of the step.
    """
    positions = [np.zeros(0)] * len(records)
    for group in group_alike([record.conditions for record in records]):
        held = Held.of(change(plant, records[group[0]].conditions), step, period, accurate)
        paths = held.play([records[k].commands for k in group], [starts[k] for k in group], settle)
        for k, path in zip(group, paths, strict=True):
            positions[k] = path
    return positions


def replay_in_bullet(plant: Plant, pieces: Pieces, *, step: float, period: float, iterations: int) -> np.ndarray:
    """Return what Bullet answers to windows in the air, encoders' bias included [rad], shape (W, T, n_joints)."""
    joints, way = pieces.real.shape[2], levers(plant.robot)
    positions = np.empty(pieces.real.shape)
    for conditions, group in pieces.alike:
        engine = Engine(in_metres(change(plant, conditions)), Physics(step, iterations, period, floating=False))
        for k in group:
            commands, motion, clock = (values[k] for values in pieces.windows)
            positions[k] = (_replay_window(engine, _in_metres(commands, way), motion * way, clock) / way)[:, :joints]
        engine.close()
    return positions + plant.sensors.bias[:joints]


def _in_metres(commands: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Return commands to motors with these levers in metres and newtons, see `ServoState.commands`."""
    same = np.ones_like(way)
    return commands * np.concatenate([way, way, 1.0 / way, same, same])[: commands.shape[1]]


def _replay_window(engine: Engine, commands: np.ndarray, motion: np.ndarray, clock: float) -> np.ndarray:
    """Return what the encoders show in Bullet after each control period [rad], shape (T, n_motors)."""
    length = len(commands) - COMMANDS + 1
    start = resting(lump(engine.plant.robot), motion[0], commands[length], floating=False).reading
    engine.load(start._replace(motion=motion), commands[length:], float(clock))
    rows = []
    for t in range(length):
        engine.run(commands[length - 1 - t])
        rows.append(engine.encoders(engine.read())[0])
    return np.array(rows)
