"""Diagnosed effects: the simulator with what a diagnosis found switched on, and another grounding in it, if any.

The world changes, the actions do not, but for what the inner grounding does to them: with a grounded action
transformation inside, physics takes what has a name, and what is left is learned.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, is_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from gsl.core.described import describe
from gsl.core.interfaces import REAL, SIM, Grounding, GroundingRun, Preparable, Prepared, Trainable, World
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.effects.effect import together
from gsl.errors import ConfigError
from gsl.grounding.diagnosis_file import Diagnosis, read_diagnosis
from gsl.grounding.draws import around
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.none import NoGrounding
from gsl.grounding.preparation import parents_of, prepare, without_margins
from gsl.grounding.randomised import RandomisedEffects
from gsl.storage.references import resolve
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.ensemble import EnsembleWorld
from gsl.worlds.held import refuse_hook


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
    inner: Annotated[Grounding, setting("what stands between action and the diagnosed simulator")] = field(
        default_factory=NoGrounding
    )
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

    def draw(self, world: World, diagnosis: Diagnosis) -> World:
        """Return the world with the effects as it is, or simulators around it if these were asked for."""
        if not self.draws:
            return world
        assert isinstance(world, BulletWorld | EnsembleWorld), "only these are diagnosed"
        return around(world, diagnosis.uncertain)

    def load(self, read: Callable[[str, str], Diagnosis]) -> Diagnosis:
        """Return the diagnosis; `read` finds one by its reference and method.

        Raises:
            ConfigError: There is neither a diagnosis nor an effect.
        """
        if self.effects:
            names = tuple(self.effects)
            sentence = f"These effects were given, not diagnosed: {', '.join(names)}."
            return Diagnosis("given", names, sentence, "", {}, self.effects)
        if not self.diagnosis:
            raise ConfigError("grounding.diagnosis", f"is missing; name a run of gsl {self.method}, or set effects")
        return read(self.diagnosis, self.method)

    def parents(self, path: str) -> Mapping[str, Path]:
        """Return the diagnosis, and what the inner grounding is made of."""
        own = {} if self.effects else {f"{path}.diagnosis": resolve(self.diagnosis, kind=self.method)}
        return {**own, **parents_of(self.inner, f"{path}.inner")}

    def check(self, world: World) -> None:
        """Refuse a world without effects, and what the inner grounding is not for."""
        having_effects(world)
        if isinstance(world, BulletWorld) and not self.effects:
            refuse_hook(world.plant)
        if isinstance(self.inner, Preparable):
            self.inner.check(world)

    def prepare(self, world: World, settled: Mapping[str, Any]) -> Prepared:
        """Return the world with the effects and the inner grounding in it."""
        diagnosis = self.load(read_diagnosis)
        inside = prepare(self.inner, switch_on(world, diagnosis), settled)
        return inside._replace(world=self.draw(inside.world, diagnosis))

    def without_margins(self) -> DiagnosedEffects:
        """Return the same without draws, and without the margins of the inner grounding."""
        return replace(self, draws=False, inner=without_margins(self.inner))

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


def switch_on(world: World, diagnosis: Diagnosis) -> World:
    """Return the world with what it lacks.

    Raises:
        ConfigError: It is not the simulator that was diagnosed.
    """
    simulator = having_effects(world)
    settings = describe(simulator)
    if diagnosis.verdict != "given" and (settings["robot"], settings["effects"]) != (
        diagnosis.robot,
        diagnosis.simulated,
    ):
        other = f"the {diagnosis.robot} with {', '.join(diagnosis.simulated) or 'no effects'}"
        raise ConfigError("grounding.diagnosis", f"is of another simulator: {other}; take this one")
    return replace(simulator, effects=together([settings["effects"], diagnosis.effects]))


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


def is_learned(grounding: Grounding) -> bool:
    """Whether a grounding has models that learn from trajectories of a policy."""
    return isinstance(innermost(grounding), ActionTransformation | Trainable)


def evidence_of(grounding: Grounding) -> tuple[str, ...]:
    """Return of which worlds, `real` and `sim`, a grounding needs trajectories of a policy."""
    inner = innermost(grounding)
    if isinstance(inner, Trainable):
        return inner.needs
    return (REAL, SIM) if isinstance(inner, ActionTransformation) else ()
