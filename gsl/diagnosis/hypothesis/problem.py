"""A problem is where hypotheses on one log compete.

Every set of effects competes against smaller ones on windows that no fit has seen, the calibration refitted for each
and its cost counted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis.hypothesis.candidates import Candidate, Looks, effects_of, library
from gsl.diagnosis.hypothesis.common_mode import shares
from gsl.diagnosis.hypothesis.fit import Build, Descent, Fit
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis
from gsl.diagnosis.log.log import Log, spread
from gsl.diagnosis.log.residual import loss
from gsl.diagnosis.options import Options
from gsl.diagnosis.settings import SearchSettings
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.in_the_air import Effects
from gsl.diagnosis.simulate.simulator import Bench, Simulator
from gsl.effects.effect import apply_all, build, effect_class, names, own
from gsl.worlds.servo_state import COMMANDS

LATENCY, PUSH = "command_latency", "external_push"
IN_CONTACT = "contact"  # kind of effects that a robot in the air cannot show


class Ask(NamedTuple):
    """A fit that is asked for.

    Attributes:
        candidates: The effects.
        start: Their parameters in one row.
        at: Shifts to begin with, shape (7, n_joints).
        every: Steps for which sensitivities to the shifts are kept.
        rounds: Steps at most.
    """

    candidates: tuple[Candidate, ...]
    start: np.ndarray
    at: np.ndarray
    every: int | None = None
    rounds: int | None = None

    @property
    def key(self) -> tuple[Any, ...]:
        """By which what came of it is remembered."""
        return (
            *(part.key for part in self.candidates),
            self.start.tobytes(),
            self.at.tobytes(),
            self.every,
            self.rounds,
        )


@dataclass(frozen=True)
class Problem:
    """Where hypotheses on one log compete.

    Attributes:
        train: Windows of the training records.
        held_out: Windows of the others.
        library: The candidates.
        scopes: Names of scopes and their joints, each of shape (n_joints,).
        tick: Called with a phase when it begins, and with an empty word whenever some work is done.
        glances: Training windows that a screening looks at, spread over all of them; None for half of them.
        settings: Of the search and its fits.
        memory: What came of fits and screenings: a search without some of the effects asks for most of them again.
    """

    train: Bench
    held_out: Bench
    library: tuple[Candidate, ...]
    scopes: Mapping[str, np.ndarray]
    tick: Callable[[str], None]
    glances: int | None = None
    settings: SearchSettings = field(default_factory=SearchSettings)
    memory: dict[tuple[Any, ...], Any] = field(default_factory=dict, init=False, compare=False, repr=False)

    @classmethod
    def of(
        cls,
        log: Log,
        simulator: Simulator,
        options: Options,
        tick: Callable[[str], None],
        looks: Looks | None = None,
    ) -> Problem:
        """Return where hypotheses on a log compete, a push among them only if a look found one."""
        hidden = [] if log.walking else [name for name in names() if _kind(name) == IN_CONTACT]
        hidden += [] if options.clocks else [LATENCY]
        hidden += [] if looks and PUSH in looks.fixed else [PUSH]
        candidates = library(
            simulator.plant.robot,
            (*options.without, *hidden),
            looks,
            dense=bool(log.comparison.shaking.any()),
            floating=log.walking,
            settings=options.search.grids,
        )
        latest = (COMMANDS - 1) * log.period - float(simulator.plant.servo.delay.max())  # that servos remember
        kept = (part for part in candidates if part.effect != LATENCY or latest > 0.0)
        candidates = tuple(part.up_to(latest) if part.effect == LATENCY else part for part in kept)
        if not log.walking:
            candidates = tuple(part for part in candidates if not _has_hook(part, simulator.plant, tick))
        return cls(
            Bench(simulator, log.train_pieces, log.comparison),
            Bench(simulator, log.held_out_pieces, log.comparison),
            candidates,
            _scopes(log),
            tick,
            options.search.walk_windows if log.walking else None,
            options.search,
        )

    @property
    def simulator(self) -> Simulator:
        """What replays."""
        return self.train.simulator

    @property
    def glance(self) -> Bench:
        """The windows of a screening: every second one is enough to see which candidates are worth a fit."""
        count = len(self.train.pieces)
        most = self.glances or (count // 2 if count > self.settings.few else count)
        return replace(self.train, pieces=self.train.pieces.take(spread(np.arange(count), most)))

    def only(self, effects: Sequence[str]) -> Problem:
        """Return the problem with a part of the library."""
        return self._part([part for part in self.library if part.effect in effects])

    def without(self, effects: Sequence[str] | Mapping[str, Any]) -> Problem:
        """Return the problem without a part of the library."""
        return self._part([part for part in self.library if part.effect not in effects])

    def _part(self, library: Sequence[Candidate]) -> Problem:
        """Return the problem with another library and the same memory: `replace` alone forgets."""
        part = replace(self, library=tuple(library))
        object.__setattr__(part, "memory", self.memory)
        return part

    def fit_calibration(self) -> Hypothesis:
        """Return the hypothesis without an effect."""
        return self.fit((), np.zeros(0), no_shifts(self.train.joints), every=1, rounds=2 * self.settings.fit.rounds)

    def relax(self, none: Hypothesis, larger: Sequence[Hypothesis]) -> Hypothesis:
        """Return calibration alone, also fitted from the shifts of the best larger hypothesis: what costs less there.

        In a worse valley than that of a hypothesis with an effect, calibration would lack the effect by chance.
        """
        best = min((each.fit for each in larger), key=lambda fit: fit.cost, default=none.fit)
        if best.cost >= none.fit.cost:
            return none
        again = self.fit((), np.zeros(0), best.shifts, every=1)
        return again if again.fit.cost < none.fit.cost else none

    def fit(
        self,
        candidates: tuple[Candidate, ...],
        start: np.ndarray,
        at: np.ndarray,
        *,
        every: int | None = None,
        rounds: int | None = None,
    ) -> Hypothesis:
        """Fit a set of effects and score it; arguments as those of `Ask`."""
        return self.fit_all([Ask(candidates, start, at, every, rounds)])[0]

    def fit_all(self, asks: Sequence[Ask]) -> list[Hypothesis]:
        """Fit sets of effects side by side, each from a start of its own, and score them."""
        new = {ask.key: ask for ask in asks if ask.key not in self.memory}
        fits = self.simulator.side_by_side(
            lambda simulator, ask: self.on(simulator)._fit(ask), [*new.values()], lambda _: self.tick("")
        )
        self.memory.update(zip(new, fits, strict=True))
        return [self.memory[ask.key] for ask in asks]

    def on(self, simulator: Simulator) -> Problem:
        """Return the problem on another simulator of the same replays."""
        train, held_out = (replace(bench, simulator=simulator) for bench in (self.train, self.held_out))
        return replace(self, train=train, held_out=held_out)

    def _fit(self, ask: Ask) -> Hypothesis:
        candidates, start, at, every, rounds = ask
        sizes = np.cumsum([len(candidate.free) for candidate in candidates])[:-1]

        def split(values: np.ndarray) -> tuple[np.ndarray, ...]:
            return tuple(np.split(values, sizes)) if candidates else ()

        def build(values: np.ndarray) -> Effects:
            return effects_of(candidates, split(values))

        how, simulator = self.settings.fit, self.simulator
        bounds = np.hstack([np.zeros((2, 0)), *(candidate.bounds for candidate in candidates)])
        ratios = np.concatenate([np.zeros(0, dtype=bool), *(candidate.ratios for candidate in candidates)])
        unit = simulator.plant.robot.torque_unit
        common = shares(candidates, self.scopes, unit) if simulator.calibrates else ()
        descent = Descent(self.train, build, bounds, ratios, common, every or how.every, rounds or how.rounds, how)
        fit = descent.fit(start, at)
        return self._score(candidates, split(fit.parameters), fit, build)

    def _score(
        self, candidates: tuple[Candidate, ...], parameters: tuple[np.ndarray, ...], fit: Fit, build: Build
    ) -> Hypothesis:
        z = self.held_out.residual(build(fit.parameters), fit.shifts)
        used, sample = self.held_out.comparison.count_residuals(z.shape[1]), self.held_out.pieces.samples
        lost, samples = loss(z), np.unique(sample)
        cost = lost.sum(axis=1)
        costs = np.array([cost[sample == name].sum() for name in samples])
        counts = np.array([used.sum() * (sample == name).sum() for name in samples])
        return Hypothesis(candidates, parameters, fit, costs, counts, self.held_out.comparison.levels(lost))


def _has_hook(candidate: Candidate, plant: Plant, tick: Callable[[str], None]) -> bool:
    """Whether an effect of a user's own hooks its torque: the chain model, which replays logs in air, calls none."""
    if candidate.effect not in own():
        return False
    hooked = apply_all(plant, build({candidate.effect: candidate.entry(candidate.documented[1])})).hook is not None
    if hooked:
        tick(f"without {candidate.effect}, whose torque hook acts in Bullet alone")
    return hooked


def _kind(effect: str) -> str:
    return str(getattr(effect_class(effect), "kind", ""))


def _scopes(log: Log) -> dict[str, np.ndarray]:
    """Return all joints and, in the air, the robot's groups and each joint as scopes: shapes (n_channels,)."""
    parts = {} if log.walking else {**log.robot.groups, **{joint: (joint,) for joint in log.channels}}
    members = {"all": log.channels, **parts}
    masks = {name: np.array([joint in some for joint in log.channels]) for name, some in members.items()}
    return {name: mask for name, mask in masks.items() if mask.any()}
