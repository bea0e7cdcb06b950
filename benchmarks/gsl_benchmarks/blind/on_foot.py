"""Cases on the ground: robots that walk with one cause, turned up by how far it moves replays of windows of a walk."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gsl.core.body import lump
from gsl.core.trajectory import Batch
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.log.records import BASE, Pieces
from gsl.diagnosis.simulate.on_ground import Walking, model_error
from gsl.errors import GslError
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.fits import fitting_step
from gsl_benchmarks.blind.dials import Dial, draw_on_foot, list_walk_effects
from gsl_benchmarks.blind.jitter import NOISE
from gsl_benchmarks.blind.label import Label
from gsl_benchmarks.blind.make import TRIES, Case
from gsl_benchmarks.blind.mix import STRONG, Slot
from gsl_benchmarks.blind.strength import WORST, turn_up
from gsl_benchmarks.blind.walks import Individual, Walks

BANDS = {STRONG: (4.0, 20.0)}  # [floors]; lower than in the air, for windows are a third as long
SHOWN = 0.5  # least share of its own gap that an effect takes away
WALKED, WINDOWS = 4, 40  # nominal walks that gaps are measured on, and windows of them


@dataclass(frozen=True)
class Yardstick:
    """What measures gaps on the ground.

        gap² = 1 + median over windows of mean(((replay with the effect - replay without it) / floor)²)

    The windows are those of a diagnosis, as is the floor: noise and what a replay cannot know. The median is for single
    windows that part for little.

    Attributes:
        simulator: The nominal one.
        pieces: Windows of nominal walks.
        floor: Of each channel, shape (n_channels,).
        without: Replays without an effect, shape (W, T, n_channels).
    """

    simulator: Walking
    pieces: Pieces
    floor: np.ndarray
    without: np.ndarray

    @classmethod
    def of(cls, sim: BulletWorld, walks: Walks, noise: float, rng: np.random.Generator) -> Yardstick:
        """Let the nominal robot walk, and replay it."""
        log = replace(walks, episodes=WALKED).log(sim, None, {}, noise, rng)
        cut = cut_log(log, lump(sim.plant.robot), walking=True)
        simulator = Walking(sim.plant, fitting_step(sim.step, sim.period), sim.period)
        pieces = _some(cut.pieces)
        floor = cut.with_model_error(model_error(simulator, pieces, rng)).comparison.floor
        return cls(simulator, pieces, floor, simulator.simulate({}, np.zeros(0), pieces))

    def gap(self, dial: Dial) -> Callable[[float], float]:
        """Return what tells the gap [floors] at a share of an effect's range, over what it acts on.

        An effect with a scope acts on the joints, any other on the base.
        """

        def gap(share: float) -> float:
            replays = self.simulator.simulate({dial.effect: dial.entry(share)}, np.zeros(0), self.pieces)
            return float(np.sqrt(1.0 + self._square(replays - self.without, dial)))

        return gap

    def measure_shown(self, dial: Dial, share: float, log: Batch) -> float:
        """Return the share of the gap that replays with the effect take away from a log of the nominal robot with it.

        A window begins with what a log tells of a state, and not with what springs, gears and delays hold: an effect
        can move a robot from there and yet not be what a replay of it shows.
        """
        pieces = _some(cut_log(log, lump(self.simulator.plant.robot), walking=True).pieces)
        left = [
            self._square(self.simulator.simulate(effects, np.zeros(0), pieces) - pieces.real, dial)
            for effects in ({dial.effect: dial.entry(share)}, {})
        ]
        return 1.0 - left[0] / left[1]

    def _square(self, error: np.ndarray, dial: Dial) -> float:
        """Return the median over windows of the mean square in floors, over what an effect acts on."""
        joints = np.arange(len(self.floor)) < len(self.floor) - len(BASE)
        z = np.clip(np.nan_to_num(error[:, self.pieces.warm_up :] / self.floor, nan=WORST), -WORST, WORST)
        return float(np.median(np.mean(z[..., joints if "joints" in dial.fixed else ~joints] ** 2, axis=(1, 2))))


def _some(pieces: Pieces) -> Pieces:
    spread = np.linspace(0, len(pieces) - 1, min(WINDOWS, len(pieces))).round().astype(int)
    return pieces.take(np.unique(spread))


@dataclass(frozen=True)
class Track:
    """Where robots walk.

    Attributes:
        sim: The world that they are nominally alike to.
        walks: How they are logged.
    """

    sim: BulletWorld
    walks: Walks

    def case(self, name: str, slot: Slot, rng: np.random.Generator) -> Case:
        """Make one case.

        The effect whose turn it is comes first; then all others in random order, until one reaches the strength,
        leaves the robot on its feet, and is to be seen.
        """
        noise = float(rng.uniform(*NOISE))
        label = Label(name, slot.kind, slot.generator, slot.strength, noise=noise)
        individual = Individual(int(rng.integers(2**31)))
        yardstick = Yardstick.of(self.sim, self.walks, noise, rng)
        choices = list_walk_effects()
        turn = choices[slot.turn % len(choices)]
        for effect in (turn, *rng.permutation([effect for effect in choices if effect != turn]).tolist()):
            for _ in range(TRIES):
                dial = draw_on_foot(effect, self.sim.plant, rng)
                level = turn_up(yardstick.gap(dial), slot.strength, rng, BANDS)
                if level is None:
                    continue
                effects = {effect: dial.entry(level[0])}
                nominal = replace(self.walks, episodes=WALKED).log(self.sim, None, effects, noise, rng)
                if yardstick.measure_shown(dial, level[0], nominal) < SHOWN:
                    continue
                log = self.walks.log(self.sim, individual, effects, noise, rng)
                if self.walks.on_foot(log) >= self.walks.still:
                    neutral = {effect: dial.neutral}
                    return Case(replace(label, effects=effects, neutral=neutral, gap=level[1]), log, None)
        raise GslError(f"no effect of strength {slot.strength} leaves the robot on its feet; choose walks.still= lower")
