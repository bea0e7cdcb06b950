"""Diagnosed effects: the simulator with what a diagnosis found switched on, and another grounding in it, if any.

The world changes, the actions do not, but for what the inner grounding does to them: with a grounded action
transformation inside, physics takes what has a name, and what is left is learned.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np

from gsl.core.described import described
from gsl.core.interfaces import Grounding, GroundingRun, World
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.effects.effect import together
from gsl.errors import ConfigError
from gsl.grounding.draws import UncertainCause, around
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.none import NoGrounding
from gsl.grounding.randomised import RandomisedEffects
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.ensemble import EnsembleWorld

MANY = 6  # effects, more of which are counted and not named
DOUBT = "In the task that may be no nearer: compare with grounding=ane and grounding=gat."  # docs/results/withheld.md


@dataclass(frozen=True)
class Diagnosis:
    """What a diagnosis says of a simulator.

    Attributes:
        verdict: `no_gap`, `causes`, `inseparable`, `unknown`; `given` or `identified` where nobody diagnosed.
        causes: Names of the effects that it names.
        summary: In a sentence.
        robot: That was simulated.
        simulated: The `effects:` of the simulator as it was.
        effects: What it lacks, its calibration included.
        before, after: The held-out gap without and with them, in noise floors; None where nobody measured.
        uncertain: Causes with their probabilities and intervals, as far as it tells them.
    """

    verdict: str
    causes: tuple[str, ...]
    summary: str
    robot: str
    simulated: Mapping[str, Any]
    effects: Mapping[str, Any]
    before: float | None = None
    after: float | None = None
    uncertain: tuple[UncertainCause, ...] = ()

    @property
    def told(self) -> str:
        """What is done with it, in a sentence."""
        if not self.causes:
            kept = "Nothing is switched on: the simulator is taken as it is, calibrated joint by joint."
            return f"{kept} {DOUBT}" if self.verdict == "unknown" else kept
        return f"Switched on in the simulator: {named(self.causes)}."


def named(causes: Sequence[str]) -> str:
    """Return effects by name, or only how many they are."""
    names = tuple(dict.fromkeys(causes))
    return ", ".join(names) if len(names) <= MANY else f"{len(names)} effects"


@component
class DiagnosedEffects:
    """Which diagnosis to believe, and what to ground in its world besides; `load` reads it."""

    diagnosis: Annotated[str, setting("path or run of the diagnosis")] = ""
    effects: Annotated[
        Mapping[str, Any], setting("what to switch on instead of a diagnosis, as in a world's `effects:`")
    ] = field(default_factory=dict)
    method: Annotated[
        Literal["diagnose", "identify"], setting("what finds the effects: a diagnosis, or a fit of all of them at once")
    ] = "diagnose"
    inner: Annotated[
        Grounding | ActionTransformation, setting("what stands between action and the diagnosed simulator")
    ] = field(default_factory=NoGrounding)
    draws: Annotated[
        bool, setting("each episode is in another simulator, drawn from the causes' probabilities and intervals")
    ] = False

    def __post_init__(self) -> None:
        """Refuse to draw what nobody diagnosed, or twice.

        Raises:
            ConfigError: One of these.
        """
        if self.draws and (self.effects or self.method != "diagnose"):
            problem = "are around a diagnosis; what was given or fitted at once has no intervals"
            raise ConfigError("draws", problem, given="true")
        if self.draws and isinstance(self.inner, RandomisedEffects):
            raise ConfigError("draws", "and grounding.inner both draw simulators; take one", given="true")

    def drawn(self, world: World, found: Diagnosis) -> World:
        """Return the world with the effects as it is, or simulators around it if these were asked for."""
        if not self.draws:
            return world
        assert isinstance(world, BulletWorld | EnsembleWorld), "only these are diagnosed"
        return around(world, found.uncertain)

    def load(self, read: Callable[[str, str], Diagnosis]) -> Diagnosis:
        """Return the diagnosis; `read` finds one by its reference and method.

        Raises:
            ConfigError: There is neither a diagnosis nor an effect.
        """
        if self.effects:
            names = tuple(self.effects)
            told = f"These effects were given, not diagnosed: {', '.join(names)}."
            return Diagnosis("given", names, told, "", {}, self.effects)
        if not self.diagnosis:
            raise ConfigError("grounding.diagnosis", f"is missing; name a run of gsl {self.method}, or set effects")
        return read(self.diagnosis, self.method)

    def start(self, layout: Layout, rng: np.random.Generator) -> GroundingRun:
        """Refuse to start: the world has to be changed first.

        Raises:
            ConfigError: Always; `switched_on` gives the world, and `inner` acts in it.
        """
        raise ConfigError("grounding", "its effects are not switched on; a stage that uses it has to do that")


def having_effects(world: World) -> Any:
    """Return a world in which effects can be switched on.

    Raises:
        ConfigError: It has none.
    """
    if not is_dataclass(world) or isinstance(world, type) or not hasattr(world, "effects"):
        raise ConfigError("grounding", "this world has no effects to switch on; take another grounding")
    return world


def switched_on(world: World, found: Diagnosis) -> World:
    """Return the world with what it lacks.

    Raises:
        ConfigError: It is not the simulator that was diagnosed.
    """
    simulator = having_effects(world)
    settings = described(simulator)
    if found.verdict != "given" and (settings["robot"], settings["effects"]) != (found.robot, found.simulated):
        other = f"the {found.robot} with {', '.join(found.simulated) or 'no effects'}"
        raise ConfigError("grounding.diagnosis", f"is of another simulator: {other}; take this one")
    return replace(simulator, effects=together([settings["effects"], found.effects]))


def innermost(grounding: Grounding) -> Grounding:
    """Return what transforms the actions, whatever was done to the world before."""
    while isinstance(grounding, DiagnosedEffects):
        grounding = grounding.inner
    return grounding


def with_innermost(grounding: Grounding, inner: Grounding) -> Grounding:
    """Return a grounding with another one in the place of what transforms the actions."""
    if isinstance(grounding, DiagnosedEffects):
        return replace(grounding, inner=with_innermost(grounding.inner, inner))
    return inner


def learned(grounding: Grounding) -> bool:
    """Whether a grounding has models that learn from real trajectories."""
    return isinstance(innermost(grounding), ActionTransformation)
