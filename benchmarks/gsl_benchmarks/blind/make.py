"""The making of a case: a robot with jitter, causes that are dialled to a strength, and what it logs of a programme."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from gsl.core.body import lump
from gsl.core.plant import Plant
from gsl.core.series import interpolate
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.log.records import slope
from gsl.effects.effect import TWINS
from gsl.errors import GslError
from gsl_benchmarks.blind.dials import CALIBRATED, Dial, draw, draw_extra, takes_joint, visible
from gsl_benchmarks.blind.extras import EXTRAS
from gsl_benchmarks.blind.foreign import play_foreign
from gsl_benchmarks.blind.jitter import NOISE, jitter
from gsl_benchmarks.blind.label import ABSENT, FOREIGN, JOINT, NULL, SAME, TWO, WITHHELD, Label
from gsl_benchmarks.blind.mix import Slot
from gsl_benchmarks.blind.programmes import Programme
from gsl_benchmarks.blind.rigid_mujoco import play_mujoco
from gsl_benchmarks.blind.same import play_same
from gsl_benchmarks.blind.strength import Player, Yardstick, turn_up

PLAYERS: Mapping[str, Player] = {SAME: play_same, FOREIGN: play_mujoco}
DIALLED: Mapping[str, Player] = {SAME: play_same, FOREIGN: play_foreign}  # the same robots, forty times as fast
START = 0.02  # spread of the joints before the first command is held [rad]
JITTERING, CLOCK = 0.25, (0.05, 0.3)  # share of loggers whose clock jitters; its standard deviation [periods]
TRIES = 3  # draws of an effect before the next one has its turn


@dataclass(frozen=True)
class Case:
    """What is handed out and what is sealed.

    Attributes:
        label: The truth.
        log: Of the robot.
        reference: Of the same robot without the causes, for the foreign generator.
    """

    label: Label
    log: Batch
    reference: Batch | None


@dataclass(frozen=True)
class Workshop:
    """Where cases are made.

    Attributes:
        plant: The nominal simulator.
        step, period: Its physics and control periods [s].
        programmes: The commands.
    """

    plant: Plant
    step: float
    period: float
    programmes: Sequence[Programme]

    def case(self, name: str, slot: Slot, rng: np.random.Generator) -> Case:
        """Make one case."""
        noise = float(rng.uniform(*NOISE))
        clock = float(rng.uniform(*CLOCK)) if rng.random() < JITTERING else 0.0
        label = Label(
            name, slot.kind, slot.generator, slot.strength, programme=slot.programme, noise=noise, clock=clock
        )
        if slot.kind != NULL:
            label = self._add_causes(label, slot, rng)
        robot = jitter(self.plant, rng)
        log = self._record(robot, label, rng)
        bare = replace(label, effects={}, extra=None)
        return Case(label, log, self._record(robot, bare, rng) if slot.generator == FOREIGN else None)

    def _add_causes(self, label: Label, slot: Slot, rng: np.random.Generator) -> Label:
        """Return the label with causes of the strength that the slot wants."""
        player, programme = DIALLED[slot.generator], self.programmes[slot.programme]
        yardstick = Yardstick.of(self.plant, self.step, self.period, player, programme)
        if slot.kind == ABSENT:
            dial, share, gap = _dial(tuple(EXTRAS), yardstick, label, slot.turn, rng)
            return replace(label, extra={"effect": dial.effect, **dial.entry(share)}, gap=gap)
        choices = [effect for effect in visible() if _fits(effect, slot.kind)]
        dial, share, gap = _dial(choices, yardstick, label, slot.turn, rng)
        effects, neutral = {dial.effect: dial.entry(share)}, {dial.effect: dial.neutral}
        if slot.kind == TWO:
            others = [effect for effect in choices if TWINS.get(effect, effect) != TWINS.get(dial.effect, dial.effect)]
            dial, share, second = _dial(others, yardstick, label, int(rng.integers(len(others))), rng)
            effects[dial.effect], neutral[dial.effect] = dial.entry(share), dial.neutral
            gap = float(np.sqrt(gap**2 + second**2 - 1.0))
        without = tuple(effects) if slot.kind == WITHHELD else ()
        return replace(label, effects=effects, neutral=neutral, gap=gap, without=without)

    def _record(self, robot: Plant, label: Label, rng: np.random.Generator) -> Batch:
        """Return what a robot logs of its programme; its metadata say nothing of the causes."""
        programme, body = self.programmes[label.programme], lump(robot.robot)
        targets, n = programme.targets(body), len(body.controlled)
        starts = [path[0] + START * rng.standard_normal(len(path[0])) for path in targets]
        played = PLAYERS[label.generator](robot, label.effects, label.extra, targets, starts, self.period)
        episodes = []
        for commands, path in zip(programme.commands, played, strict=True):
            times = self.period * np.arange(len(path))
            position = log_readings(times, path[:, :n], label.clock * self.period, label.noise, rng)
            episodes.append(Trajectory(times, commands, position, slope(position, self.period)))
        about = {"robot": body.name, "role": "real", "source": "gsl blind"}
        names = [{"policy": name} for name in programme.names]
        return Batch(tuple(episodes), body.controlled, self.period, {**about, "episodes": names})


def log_readings(
    times: np.ndarray, path: np.ndarray, jitter: float, noise: float, rng: np.random.Generator
) -> np.ndarray:
    """Return what an import makes of a path whose logger has noise [rad] and a jittering clock [s], shape (T, k)."""
    if jitter <= 0.0:
        return path + noise * rng.standard_normal(path.shape)
    stamps = times + jitter * np.clip(rng.standard_normal(len(times)), -1.5, 1.5)  # stays in order up to 0.3 periods
    read = CubicSpline(times, path)(stamps) + noise * rng.standard_normal(path.shape)
    return interpolate(stamps, read, times)


def rng_of(secret: str, *parts: int | str) -> np.random.Generator:
    """Return the random numbers of a part of a benchmark; who has not its secret cannot draw them again."""
    words = "\0".join([secret, *map(str, parts)])
    return np.random.default_rng(int.from_bytes(hashlib.sha256(words.encode()).digest()))


def _dial(
    choices: Sequence[str], yardstick: Yardstick, label: Label, turn: int, rng: np.random.Generator
) -> tuple[Dial, float, float]:
    """Return an effect that reaches the label's strength, its share of its range and its gap.

    The one whose turn it is comes first; then all others in random order.
    """
    robot = yardstick.plant.robot
    others = [effect for effect in choices if effect != choices[turn % len(choices)]]
    for effect in (choices[turn % len(choices)], *rng.permutation(others).tolist()):
        for _ in range(TRIES):
            extra = effect in EXTRAS
            dial = draw_extra(effect, robot, rng) if extra else draw(effect, robot, rng, alone=label.kind == JOINT)
            if (share := turn_up(measure_gap(dial, yardstick, label.noise), label.strength, rng)) is not None:
                return dial, *share
    raise GslError(f"no effect reaches the strength {label.strength}; choose a larger excitation.amplitude=")


def measure_gap(dial: Dial, yardstick: Yardstick, noise: float) -> Callable[[float], float]:
    """Return the gap of a dial's effect as a function of how far it is turned up."""
    joints = dial.mask(yardstick.plant)

    def gap(share: float) -> float:
        entry = dial.entry(share)
        if dial.effect in EXTRAS:
            return yardstick.gap({}, {"effect": dial.effect, **entry}, joints, noise)
        return yardstick.gap({dial.effect: entry}, None, joints, noise)

    return gap


def _fits(effect: str, kind: str) -> bool:
    if kind == JOINT:
        return takes_joint(effect)
    return kind != WITHHELD or effect not in CALIBRATED
