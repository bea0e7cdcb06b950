"""The contract tests that gsl offers: our components pass them, and a broken promise is named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest

import gsl
from gsl.core.interfaces import Trainable
from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.deadband import Deadband
from gsl.effects.effect import SCOPE, Scope
from gsl.errors import ConfigError
from gsl.grounding.ane import ActionNoise
from gsl.grounding.effects import DiagnosedEffects
from gsl.grounding.none import NoGrounding
from gsl.grounding.randomised import RandomisedEffects
from gsl.optimizers.cma_es import CmaEs
from gsl.tasks.excite import Excite, ExciteRun
from gsl.testing import check_component, check_effect, check_grounding, check_policy, check_search, check_task

pytestmark = pytest.mark.slow

GROUNDINGS = {
    "none": NoGrounding(),
    "ane": ActionNoise(sd=0.02),
    "effects": DiagnosedEffects(effects={"backlash": {"width": 0.01}}),
    "randomised": RandomisedEffects(width=0.1),
}


@pytest.mark.parametrize("name", ["walk_engine", "linear_walk", "linear"])
def test_our_policies_keep_their_contract(name: str) -> None:
    check_policy(gsl.make_policy(name))


@pytest.mark.parametrize("name", ["walk", "arm", "distance"])
def test_our_tasks_keep_their_contract(name: str) -> None:
    check_task(gsl.make_task(name, duration=0.5))


@pytest.mark.parametrize("name", GROUNDINGS)
def test_our_groundings_keep_their_contract(name: str) -> None:
    check_grounding(GROUNDINGS[name])


def test_cma_es_keeps_the_contract_of_a_search() -> None:
    check_search(CmaEs(candidates=6, generations=4))


@component
class Worn(Deadband):
    """Deadband by another name. Signature: the same. Confused with backlash."""

    rank: ClassVar[int] = 50
    share: Annotated[float, setting("of the width", lower=0.5, upper=1.0, source="here")] = 1.0

    def apply(self, plant: Plant) -> Plant:
        return replace(self, width=self.share * self.width).wider(plant)

    def wider(self, plant: Plant) -> Plant:
        return Deadband(width=self.width, joints=self.joints).apply(plant)


@component
class Everywhere(Worn):
    """Signature: on all joints. Confused with nothing."""

    def wider(self, plant: Plant) -> Plant:
        return Deadband(width=self.width).apply(plant)


@component
class Always(Worn):
    """Signature: there at any width. Confused with nothing."""

    def wider(self, plant: Plant) -> Plant:
        return Deadband(width=self.width + 0.01, joints=self.joints).apply(plant)


@component
class InPlace(Worn):
    """Signature: what was applied stays. Confused with nothing."""

    def wider(self, plant: Plant) -> Plant:
        plant.servo.kp[:] *= 0.5
        return plant


@component
class Endless(Worn):
    """Signature: it runs away. Confused with nothing."""

    def wider(self, plant: Plant) -> Plant:
        return plant.with_servo(viscous=plant.servo.viscous - 1e3 * self.width)


@component
class Silent(Worn):
    """It says nothing."""


@component
class Wordless(Deadband):
    """Signature: none. Confused with nothing."""

    extra: float = 0.0


@component
class Kindless(Worn):
    """Signature: none. Confused with nothing."""

    kind: ClassVar[str] = "firmware"


def hook(motion: np.ndarray, time: float) -> np.ndarray:
    return np.zeros(3)


@component
class Hooked:
    """Signature: none. Confused with nothing."""

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 51
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        return replace(plant, hook=hook)


def test_an_effect_of_ones_own_keeps_the_contract() -> None:
    check_effect(Worn(width=0.02))


@pytest.mark.parametrize(
    ("effect", "promise"),
    [
        (Everywhere(width=0.02), "it changes deadband of other joints"),
        (Always(width=0.02), "does something at width = 0.0"),
        (InPlace(width=0.02), "changes the plant that it is applied to"),
        (Endless(width=0.02), "run away"),
        (Worn(width=0.0), "does nothing at the strength of this check"),
        (Silent(width=0.02), "has no 'Signature:'"),
        (Wordless(width=0.02), "extra does not say what it means"),
        (Hooked(), "returns no torque for each motor"),
    ],
    ids=lambda value: type(value).__name__ if not isinstance(value, str) else "",
)
def test_what_an_effect_breaks_is_named(effect: Any, promise: str) -> None:
    with pytest.raises(AssertionError, match=promise) as caught:
        check_effect(effect)
    assert str(caught.value).startswith(f"{type(effect).__name__}: ")


@dataclass
class Loose:
    size: float = 1.0


@component
class Changing:
    """Reads another setting than it writes."""

    size: Annotated[Any, setting("of it")] = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", self.size + 1.0)


@component
class Closed:
    """Holds what no worker process can get."""

    size: Annotated[Any, setting("of it")] = 1.0


def test_what_a_component_breaks_is_named() -> None:
    with pytest.raises(AssertionError, match="Loose: can be changed; put @component"):
        check_component(Loose())
    with pytest.raises(AssertionError, match="Changing: is another one when read from a file"):
        check_component(Changing())
    with pytest.raises(AssertionError, match="Closed: cannot go to a worker process"):
        check_component(Closed(size=lambda: 1.0))


class Acts:
    def __init__(self, act: Callable[[np.ndarray], Any]) -> None:
        self.act = act


@component
class Idle:
    """Holds still."""

    names: ClassVar[tuple[str, ...]] = ("a", "b")
    initial: ClassVar[np.ndarray] = np.zeros(2)
    scale: ClassVar[np.ndarray] = np.ones(2)

    def posture(self, parameters: np.ndarray, layout: Any) -> np.ndarray:
        return np.zeros(len(layout.joints))

    def start(self, parameters: np.ndarray, layout: Any) -> Any:
        return Acts(lambda observation: np.zeros(len(layout.joints)))


@component
class Twins(Idle):
    """Two parameters of one name."""

    names: ClassVar[tuple[str, ...]] = ("a", "a")


@component
class Flat(Idle):
    """A scale of nothing."""

    scale: ClassVar[np.ndarray] = np.zeros(2)


@component
class Short(Idle):
    """An action for three joints."""

    def start(self, parameters: np.ndarray, layout: Any) -> Any:
        return Acts(lambda observation: np.zeros(3))


EPISODES: list[int] = []


@component
class Remembering(Idle):
    """Acts otherwise in every episode."""

    def start(self, parameters: np.ndarray, layout: Any) -> Any:
        EPISODES.append(1)
        return Acts(lambda observation: np.full(len(layout.joints), 0.01 * len(EPISODES)))


def test_a_policy_of_ones_own_keeps_the_contract() -> None:
    check_policy(Idle())


@pytest.mark.parametrize(
    ("policy", "promise"),
    [
        (Twins(), "two parameters have one name"),
        (Flat(), "has a scale that is not positive"),
        (Short(), r"returns an action of shape \(3,\)"),
        (Remembering(), "acts otherwise in another episode"),
    ],
)
def test_what_a_policy_breaks_is_named(policy: Any, promise: str) -> None:
    with pytest.raises(AssertionError, match=promise):
        check_policy(policy)


@component
class Nan(Excite):
    """Reports what is no number."""

    def outcome(self, layout: Any, trajectory: Any) -> Mapping[str, float]:
        return {"way [m]": float("nan")}


class Bare(ExciteRun):
    def step(self, before: np.ndarray, after: np.ndarray, fell: bool) -> Any:
        return 0.0


@component
class Unjudged(Excite):
    """Judges nothing."""

    def start(self, layout: Any, observation: np.ndarray, role: str) -> Any:
        return Bare()


@pytest.mark.parametrize(
    ("task", "promise"),
    [(Nan(duration=0.2), r"reports way \[m\] = nan"), (Unjudged(duration=0.2), "returns no Step")],
)
def test_what_a_task_breaks_is_named(task: Any, promise: str) -> None:
    with pytest.raises(AssertionError, match=promise):
        check_task(task)


class Transforms:
    def __init__(self, transform: Callable[[np.ndarray, np.ndarray], Any]) -> None:
        self.transform = transform


@component
class Unseeded:
    """Draws from nobody's seed."""

    def start(self, layout: Any, rng: np.random.Generator) -> Any:
        return Transforms(lambda observation, action: action + np.random.default_rng().standard_normal())


@component
class Greedy:
    """Writes into the action."""

    def start(self, layout: Any, rng: np.random.Generator) -> Any:
        return Transforms(lambda observation, action: np.add(action, 0.1, out=action))


@component
class Learned(Trainable):
    """Learns the mean position."""

    model: Annotated[str, setting("path or run of train-grounding")] = ""

    def learn(self, evidence: Any, seed: int) -> Mapping[str, np.ndarray]:
        return {"mean": np.mean([episode.position.mean(axis=0) for episode in evidence.real.episodes], axis=0)}

    def load(self, arrays: Mapping[str, np.ndarray]) -> Any:
        return NoGrounding()


@component
class Forgetful(Learned):
    """Learns anything."""

    def learn(self, evidence: Any, seed: int) -> Mapping[str, np.ndarray]:
        return {"mean": np.random.default_rng().standard_normal(3)}


@component
class Wordy(Learned):
    """Learns words."""

    def learn(self, evidence: Any, seed: int) -> Mapping[str, np.ndarray]:
        return {"mean": np.array(["much"])}


def test_a_grounding_that_learns_keeps_the_contract() -> None:
    check_grounding(Learned())


@pytest.mark.parametrize(
    ("grounding", "promise"),
    [
        (Unseeded(), "sends something else in another episode of the same seed"),
        (Greedy(), "changes the observation or the action"),
        (Forgetful(), "learns something else from the same evidence"),
        (Wordy(), "learns mean, which is no array of numbers"),
    ],
)
def test_what_a_grounding_breaks_is_named(grounding: Any, promise: str) -> None:
    with pytest.raises(AssertionError, match=promise):
        check_grounding(grounding)


class Asks:
    def __init__(self, ask: Callable[[], Any], tell: Callable[[Any], Any] = lambda values: None) -> None:
        self.ask, self.tell = ask, tell


@component
class Deaf:
    """Draws around the start, whatever it is told."""

    candidates: Annotated[int, setting("of a generation")] = 3
    generations: Annotated[int, setting("how many")] = 2

    def start(self, parameters: np.ndarray, scale: np.ndarray, seed: int) -> Any:
        rng = np.random.default_rng(seed)
        return Asks(lambda: list(rng.standard_normal((self.candidates, len(parameters)))))


@component
class Seedless(Deaf):
    """Draws the same by every seed."""

    def start(self, parameters: np.ndarray, scale: np.ndarray, seed: int) -> Any:
        return super().start(parameters, scale, 0)


@component
class Restless(Deaf):
    """Draws anew after a kill."""

    def start(self, parameters: np.ndarray, scale: np.ndarray, seed: int) -> Any:
        return super().start(parameters, scale, np.random.SeedSequence().entropy)


@component
class Fewer(Deaf):
    """Asks for one less than it says."""

    def start(self, parameters: np.ndarray, scale: np.ndarray, seed: int) -> Any:
        rng = np.random.default_rng(seed)
        return Asks(lambda: list(rng.standard_normal((self.candidates - 1, len(parameters)))))


@component
class Narrow(Deaf):
    """Asks for fewer parameters."""

    def start(self, parameters: np.ndarray, scale: np.ndarray, seed: int) -> Any:
        return super().start(parameters[1:], scale, seed)


@pytest.mark.parametrize(
    ("search", "promise"),
    [
        (Deaf(), "does not depend on the values"),
        (Seedless(), "does not depend on its seed"),
        (Restless(), "asks for other candidates for the same values again"),
        (Fewer(), "returned 2 instead of the 3 candidates of its settings"),
        (Narrow(), r"its ask\(\) returned a candidate of shape \(4,\)"),
    ],
)
def test_what_a_search_breaks_is_named(search: Any, promise: str) -> None:
    with pytest.raises(AssertionError, match=promise):
        check_search(search)


def test_a_kind_that_does_not_exist_is_named() -> None:
    with pytest.raises(ConfigError, match="kind = firmware: must be one of command, servo"):
        check_effect(Kindless(width=0.02))
