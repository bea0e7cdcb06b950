"""The check of a grounding in a gymnasium environment, which nobody can set into a measured state: what is π0 worth?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gsl.core.interfaces import Grounding, GroundingRun
from gsl.core.layout import Layout
from gsl.core.seeds import derive_seed
from gsl.core.statistics import Interval, difference_interval, mean_interval
from gsl.core.trajectory import Trajectory
from gsl.core.unit import Unit
from gsl.grounding.none import NoGrounding
from gsl.rollout.rollout import Scenario, rollout

EPISODES = 10  # of π0 in either simulator
TITLES = ("where", "value of π0", "95 % interval", "steps")


@dataclass(frozen=True)
class ValueReport:
    """Values and lengths of π0's episodes, by where: real (held out), grounded, ungrounded."""

    values: dict[str, np.ndarray]
    steps: dict[str, np.ndarray]

    @property
    def problems(self) -> tuple[str, ...]:
        """Why nothing should be optimised in this grounding, in words: π0 is surely farther from real than without."""
        if not self._surely_nearer("ungrounded", "grounded"):
            return ()
        values = {name: Unit().bare(self.values[name].mean()) for name in self.values}
        return (
            f"π0 is worth {values['grounded']}, {values['ungrounded']} without grounding, "
            f"{values['real']} on the real side",
        )

    @property
    def sentence(self) -> str:
        """What π0 tells of the grounding, in words."""
        count = len(self.values["real"])
        if count < 2:
            return "one held-out real episode is no measure: nothing is known of this grounding"
        if self.problems:
            return "with the grounding π0 is significantly farther from what it is worth on the real side"
        if self._surely_nearer("grounded", "ungrounded"):
            return (
                f"with the grounding π0 is significantly nearer to what it is worth on the real side{self._remainder}"
            )
        unclear = f"π0's {count} held-out real episodes do not show whether this grounding is nearer to the real side"
        return f"{unclear}{self._remainder}: the search goes on with it"

    @property
    def _remainder(self) -> str:
        """What the grounding leaves of the gap, as far as that is sure; a search makes use of it."""
        left = self._apart("grounded")
        if left.lower > 0.0 or left.upper < 0.0:
            return f", and π0 is still significantly worth {'more' if left.lower > 0.0 else 'less'} in it"
        return ""

    def _apart(self, name: str) -> Interval:
        """Return how much more π0 is worth in a simulator than in real.

        Few values may be alike by chance: then the spread of the others is taken to be theirs too.
        """
        simulated, real = self.values[name], self.values["real"]
        alike = any(np.ptp(values) == 0.0 for values in (simulated, real))
        return difference_interval(simulated, real, pooled=alike)

    def _surely_nearer(self, first: str, second: str) -> bool:
        """Whether π0 is nearer in one simulator to what it is worth in real than in another, by both intervals."""
        near, far = self._apart(first), self._apart(second)
        return len(self.values["real"]) > 1 and max(abs(near.lower), abs(near.upper)) < max(0.0, far.lower, -far.upper)

    def rows(self) -> list[tuple[str, ...]]:
        """Return a table for people; its titles are `TITLES`."""
        return [self._row(name) for name in self.values]

    def metrics(self) -> dict[str, Any]:
        """Return everything as a JSON document."""
        metrics = {
            name: {"values": values.tolist(), "steps": self.steps[name].tolist()}
            for name, values in self.values.items()
        }
        return {"pi0": metrics, "acceptable": not self.problems, "problems": self.problems}

    def _row(self, name: str) -> tuple[str, ...]:
        values = self.values[name]
        interval = mean_interval(values)
        bounds = Unit().interval([interval.lower, interval.upper]) if len(values) > 1 else "-"
        return name, Unit().bare(values.mean()), bounds, f"{self.steps[name].mean():.0f}"


@dataclass(frozen=True)
class Shaken:
    """A grounding behind noise: what the real episodes were collected with is not to tell the worlds apart."""

    noise: Grounding
    grounding: Grounding

    def start(self, layout: Layout, rng: np.random.Generator) -> ShakenRun:
        """Return both at the beginning of an episode."""
        return ShakenRun(self.noise.start(layout, rng), self.grounding.start(layout, rng))


@dataclass(frozen=True)
class ShakenRun:
    """Noise and grounding in one episode."""

    noise: GroundingRun
    grounding: GroundingRun

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return the grounded noisy action."""
        return self.grounding.transform(observation, self.noise.transform(observation, action))


def value_report(
    scenario: Scenario, parameters: np.ndarray, real: Sequence[Trajectory], noise: Grounding, seed: int
) -> ValueReport:
    """Compare π0's episodes.

    Args:
        scenario: The simulator with a grounding ready to act.
        parameters: Of π0, shape (n_parameters,).
        real: Its held-out episodes.
        noise: On the actions of the real episodes; the simulated ones get it too.
        seed: Of the simulated ones.
    """
    ways = {
        name: replace(scenario, grounding=Shaken(noise, grounding))
        for name, grounding in (("grounded", scenario.grounding), ("ungrounded", NoGrounding()))
    }
    episodes = {"real": list(real), **{name: _episodes(way, parameters, seed) for name, way in ways.items()}}
    values = {name: np.array([episode.value for episode in done]) for name, done in episodes.items()}
    steps = {name: np.array([float(len(episode)) for episode in done]) for name, done in episodes.items()}
    return ValueReport(values, steps)


def _episodes(scenario: Scenario, parameters: np.ndarray, seed: int) -> list[Trajectory]:
    env = scenario.make()
    done = [rollout(scenario, env, parameters, derive_seed(seed, index)) for index in range(EPISODES)]
    env.close()
    return done
