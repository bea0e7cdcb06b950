"""The arena for a log: which effects compete, in which scopes, and what a look at the log says beforehand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis.attribute import Arena, scopes_of
from gsl.diagnosis.candidates import Candidate, library
from gsl.diagnosis.experiment import Experiment
from gsl.diagnosis.options import Options
from gsl.diagnosis.staircase import staircase
from gsl.diagnosis.transient import transient
from gsl.effects.effect import applied, built, effect_class, names, own

LATENCY, PUSH, STEPS = "command_latency", "external_push", "quantisation"
SCOUTS = 8  # windows of a walk that a screening looks at: a replay in Bullet takes milliseconds
ON_GROUND = ("contact",)  # kinds of effects that a robot in the air cannot show


class Looks(NamedTuple):
    """What a look at the log finds of effects that no search over their range would.

    Attributes:
        known: Parameters by effect that are fixed from now on.
        starts: Values by effect from which a fit begins as well.
    """

    known: Mapping[str, Mapping[str, float]]
    starts: Mapping[str, float]


def looked_at(found: Experiment, left: np.ndarray) -> Looks:
    """Look for pushes and staircases in the residuals of the windows of `found`, shape (W, scored, n_channels)."""
    moment = transient(found, left)
    return Looks({PUSH: moment._asdict()} if moment else {}, {} if found.walking else {STEPS: staircase(found, left)})


def arena_of(
    found: Experiment,
    plant: Plant,
    step: float,
    options: Options,
    tick: Callable[[str], None],
    looks: Looks | None = None,
) -> Arena:
    """Return where hypotheses on a log compete, a push among them only if a look found one."""
    simulator = found.simulator(plant, step, options.threads, options.spread)
    contact = () if found.walking else ON_GROUND
    hidden = [name for name in names() if getattr(effect_class(name), "kind", "") in contact]
    hidden += [] if options.clocks else [LATENCY]
    shaking = bool(found.comparison.shaking.any())
    looks = looks or Looks({}, {})
    hidden += [] if PUSH in looks.known else [PUSH]
    candidates = library(
        plant.robot, (*options.without, *hidden), looks.known, looks.starts, dense=shaking, floating=found.walking
    )
    if not found.walking:
        candidates = tuple(one for one in candidates if not _has_hook(one, plant, tick))
    scopes = scopes_of({} if found.walking else found.robot.groups, found.channels, apart=not found.walking)
    scouts = SCOUTS if found.walking else None
    return Arena(found.bench(simulator, "train"), found.bench(simulator, "held_out"), candidates, scopes, tick, scouts)


def _has_hook(candidate: Candidate, plant: Plant, tick: Callable[[str], None]) -> bool:
    """Whether an effect of a user's own hooks its torque: the chain model, which replays logs in air, calls none."""
    if candidate.effect not in own():
        return False
    hooked = applied(plant, built({candidate.effect: candidate.entry(candidate.documented[1])})).hook is not None
    if hooked:
        tick(f"without {candidate.effect}, whose torque hook acts in Bullet alone")
    return hooked
