"""Screening: winners of a search walk often in its simulator before the robot tries them; one that falls is not tried.

A candidate is judged by few episodes, and the best of many had luck. Where the simulator yields as the robot does, a
policy falls in it about as often as on the robot (docs/explanation/torque.md), and falling there costs nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, NamedTuple

import numpy as np

from gsl.core.console import Console
from gsl.core.interfaces import Grounding
from gsl.core.seeds import derive_seed
from gsl.core.setting import setting
from gsl.grounding.effects import DiagnosedEffects, innermost
from gsl.grounding.servo import LearnedServo
from gsl.rollout.parallel import Job, episodes
from gsl.rollout.rollout import Scenario

FIRST = 4  # episodes after which one that fell walks no more

Screening = Annotated[
    int,
    setting("episodes in the grounded simulator, without margins, in which a winner must not fall to be tried", ge=0),
]


class Screened(NamedTuple):
    """How often a policy fell in how many episodes."""

    falls: int
    episodes: int

    @property
    def share(self) -> float:
        """Of its episodes that ended in a fall."""
        return self.falls / self.episodes


def foretells_falls(grounding: Grounding) -> bool:
    """Whether the simulator yields as the robot does: a servo was learned or effects were diagnosed."""
    return isinstance(grounding, DiagnosedEffects) or isinstance(innermost(grounding), LearnedServo)


def screen(
    scenario: Scenario, policies: Mapping[str, np.ndarray], count: int, seed: int, *, workers: int, console: Console
) -> dict[str, Screened]:
    """Return how often policies fall in a simulator; one that falls in its first episodes walks no more.

    Args:
        scenario: Ready to act, without margins.
        policies: Parameters by name, shape (n_parameters,) each.
        count: Episodes of each.
        seed: Of all randomness.
        workers: Processes.
        console: Where progress is shown.
    """
    first = min(FIRST, count)
    with console.progress(len(policies) * count, "walking the winners in simulation") as progress:

        def count_falls(names: Sequence[str], numbers: range) -> dict[str, int]:
            jobs = [Job(policies[name], derive_seed(seed, "screening", name, n)) for name in names for n in numbers]
            fell = [episode.fell for episode in episodes(scenario, jobs, workers=workers, progress=progress)]
            return {name: sum(fell[k * len(numbers) : (k + 1) * len(numbers)]) for k, name in enumerate(names)}

        early = count_falls(list(policies), range(first))
        standing = [name for name, falls in early.items() if not falls]
        progress.advance((len(policies) - len(standing)) * (count - first))
        late = count_falls(standing, range(first, count)) if count > first else {}
    return {
        name: Screened(falls + late.get(name, 0), count if name in standing else first) for name, falls in early.items()
    }


def passing(screened: Mapping[str, Screened]) -> list[str]:
    """Return the policies that never fell; if every one did, those that fell least."""
    least = min((result.share for result in screened.values()), default=0.0)
    return [name for name, result in screened.items() if result.share == least]
