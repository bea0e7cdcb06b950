"""The wiring of a network that was trained elsewhere: what it observes, in order, and what its outputs do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field
from typing import Annotated, Literal, NamedTuple

import numpy as np

from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.core.validation import did_you_mean
from gsl.core.words import several
from gsl.errors import ConfigError
from gsl.policies.signals import (
    Episode,
    Signal,
    Source,
    constant_source,
    find_part,
    phase_source,
    source_of_part,
)

Numbers = float | tuple[float, ...]


@component
class Term:
    """One part of what the network observes."""

    signal: Annotated[Signal, setting("which of gsl's signals")]
    joints: Annotated[
        tuple[str, ...], setting("its joints, or other entries by name, in the network's order; all if none is named")
    ] = ()
    scale: Annotated[Numbers, setting("factor, or a factor for each number")] = 1.0
    relative: Annotated[bool, setting("positions from the pose on")] = False
    values: Annotated[tuple[float, ...], setting("of signal=constant")] = ()
    frequency: Annotated[float, setting("of signal=phase", unit="Hz", ge=0)] = 0.0


@component
class Wiring:
    """Observation and action of a network. Without terms it sees the whole observation of the world, in its order.

    A robot's joints go to pose + scale · output [rad]. An environment gets scale · output in its own unit.
    """

    observation: Annotated[tuple[Term, ...], setting("what the network sees, in order")] = ()
    history: Annotated[int, setting("how many observations it sees at once", ge=1, le=1000)] = 1
    stacked: Annotated[Literal["term", "frame"], setting("history of each term in turn, or whole observations")] = (
        "term"
    )
    newest: Annotated[Literal["first", "last"], setting("where the newest of a history stands")] = "last"
    limit: Annotated[float | None, setting("what the network sees is clipped to", gt=0)] = None
    joints: Annotated[
        tuple[str, ...], setting("joints that the outputs move, in order; all of the world's if none is named")
    ] = ()
    pose: Annotated[
        Mapping[str, float], setting("default pose, where episodes start; 0 where none is named", unit="rad")
    ] = field(default_factory=dict)
    scale: Annotated[Numbers, setting("action scale: factor on an output, or one for each")] = 1.0
    action_limit: Annotated[float | None, setting("what outputs are clipped to, before the scale", gt=0)] = None

    def moves(self, layout: Layout) -> tuple[str, ...]:
        """Return the joints that the outputs move, in their order."""
        return self.joints or layout.joints

    def outputs(self, layout: Layout) -> int:
        """Return how many outputs there are; where actions are choices, as many as choices."""
        return layout.choices or len(self.moves(layout))

    def stance(self, layout: Layout) -> np.ndarray:
        """Return the default pose [rad], shape (n_joints,)."""
        return np.array([self.pose.get(joint, 0.0) for joint in layout.joints])

    def parts(self, layout: Layout) -> tuple[Part, ...]:
        """Return the terms in a world.

        Raises:
            ConfigError: The world has no such signal, or a name or a number of factors is wrong.
        """
        terms = self.observation or tuple(Term(part) for part in layout.sizes)  # type: ignore[arg-type]
        return tuple(self._part(term, f"policy.wiring.observation.{k}", layout) for k, term in enumerate(terms))

    def _part(self, term: Term, where: str, layout: Layout) -> Part:
        source = self._source(term, where, layout)
        picked = list(range(len(source.names)))
        if term.joints:
            for name in term.joints:
                check_name(f"{where}.joints", name, source.names)
            picked = [source.names.index(name) for name in term.joints]
        scale = factors(term.scale, len(picked), f"{where}.scale")
        zero = np.zeros(len(picked))
        if term.relative:
            if term.signal != "position":
                raise ConfigError(f"{where}.relative", "is for positions alone", given=term.signal)
            zero = self.stance(layout)[picked]
        return Part(term.signal, tuple(source.names[k] for k in picked), source, np.array(picked), scale, zero)

    def _source(self, term: Term, where: str, layout: Layout) -> Source:
        if term.signal == "last_action":
            return Source(self.moves(layout), lambda _, episode: episode.last_action)
        if term.signal == "constant":
            if not term.values:
                raise ConfigError(f"{where}.values", "are missing; a constant needs its numbers")
            return constant_source(term.values)
        if term.signal == "phase":
            return phase_source(term.frequency)
        part = find_part(term.signal)
        if part not in layout.sizes:
            observed = [*layout.sizes, "last_action", "constant", "phase"]
            problem = f"this world does not observe it{did_you_mean(part, observed, listed=True)}"
            raise ConfigError(f"{where}.signal", problem, given=term.signal)
        return source_of_part(term.signal, layout)


class Part(NamedTuple):
    """A term in one world: (numbers of the source that are picked - zero) · scale.

    Attributes:
        signal: Its name.
        names: Of its numbers, in order.
        source: Where they come from.
        picked: Which of the source's numbers they are, shape (n,).
        scale: Factors, shape (n,).
        zero: What is taken away before, shape (n,).
    """

    signal: str
    names: tuple[str, ...]
    source: Source
    picked: np.ndarray
    scale: np.ndarray
    zero: np.ndarray

    def read(self, observation: np.ndarray, episode: Episode) -> np.ndarray:
        """Return its numbers, shape (n,)."""
        values: np.ndarray = self.source.read(observation, episode)[self.picked]
        return (values - self.zero) * self.scale


def check_name(where: str, name: str, names: Iterable[str]) -> None:
    """Refuse a name that is none of some.

    Raises:
        ConfigError: It is none.
    """
    names = tuple(names)
    if name not in names:
        raise ConfigError(where, f"there is no '{name}'{did_you_mean(name, names, listed=True)}")


def factors(scale: Numbers, count: int, where: str) -> np.ndarray:
    """Return a factor for each of some numbers, shape (count,).

    Raises:
        ConfigError: There is another number of factors.
    """
    values = np.atleast_1d(np.asarray(scale, dtype=float))
    if len(values) not in (1, count):
        raise ConfigError(
            where, f"has {several(len(values), 'factor')} for {several(count, 'number')}; give one, or one for each"
        )
    return np.broadcast_to(values, (count,)).copy()


def check_joints(wiring: Wiring, layout: Layout) -> None:
    """Refuse a wiring whose action names joints that the world does not have, or names one twice.

    Raises:
        ConfigError: It names one of these.
    """
    for name in wiring.joints:
        check_name("policy.wiring.joints", name, layout.joints)
        if wiring.joints.count(name) > 1:
            raise ConfigError("policy.wiring.joints", f"names {name} twice; one output moves a joint")
    for name in wiring.pose:
        check_name("policy.wiring.pose", name, layout.joints)
    if wiring.pose and layout.states:
        raise ConfigError("policy.wiring.pose", "is for robots; an environment has its own start")
    if wiring.joints and layout.states and set(wiring.joints) != set(layout.joints):
        raise ConfigError("policy.wiring.joints", "must name every action of an environment")
    if layout.choices and (wiring.scale != 1.0 or wiring.action_limit):
        raise ConfigError("policy.wiring.scale", "has no meaning here: the actions of this world are choices")
    factors(wiring.scale, wiring.outputs(layout), "policy.wiring.scale")
