"""The check of a grounding before anything is optimised in it: is the grounded simulator nearer to the real robot?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy

from gsl.core.observation import missing
from gsl.core.seeds import derive_seed
from gsl.core.trajectory import Batch, Trajectory
from gsl.errors import InputError
from gsl.grounding.gat import LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.grounding.preparation import without_margins
from gsl.rollout.rollout import Scenario, rollout
from gsl.training.data import FALLS, of_policy
from gsl.validation.reachability import Reachability, reachability
from gsl.validation.replay import PAST, Deviations, places, predict_no_change, replay_starts
from gsl.validation.report import BARE, GROUNDED, OFF, PI0, STILL, GroundingReport
from gsl.worlds.ensemble import EnsembleWorld, take_turns

REPLAYS = 60  # of each group of trajectories, at most
ASKED = 40  # steps of which it is asked whether the simulator can do them
EPISODES = 4  # of pi0 in the grounded simulator
SURELY = 0.05  # chance of so many falls in the grounded simulator, if π0 fell there as often as in real
ALPHAS = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)


def count_allowed_falls(heldout: Batch) -> int:
    """Return how often π0 may fall in the grounded simulator: not surely more often than by its share in real."""
    share = float(heldout.metadata.get(FALLS, 0.0))
    return max(k for k in range(EPISODES + 1) if scipy.stats.binom.sf(k - 1, EPISODES, share) >= SURELY)


def check(scenario: Scenario, parameters: np.ndarray, heldout: Batch, seed: int) -> GroundingReport:
    """Measure a grounding: its replays as it is expected, π0 with its draws and noise.

    Args:
        scenario: The simulator with the task, the policy and a grounding that is ready to act.
        parameters: Of π0, shape (n_parameters,).
        heldout: Real trajectories that no model has seen.
        seed: Of all randomness.

    Raises:
        InputError: The trajectories are of other joints or of another period.
    """
    layout = scenario.world.layout
    if heldout.joints != layout.joints:
        different = sorted(set(heldout.joints) ^ set(layout.joints)) or ["their order"]
        raise InputError(f"the held-out trajectories and the world differ in joints: {', '.join(different)}")
    if not np.isclose(heldout.control_period, layout.control_period):
        periods = f"{heldout.control_period:g} s, not the world's {layout.control_period:g} s"
        raise InputError(f"the held-out trajectories have a control period of {periods}")
    grounding = scenario.grounding
    transformation = grounding if isinstance(grounding, LoadedTransformation) else None
    expected = transformation.deterministic if transformation else without_margins(grounding)
    lacking = tuple(dict.fromkeys(part for episode in heldout.episodes for part in missing(episode, layout)))
    env = scenario.world.make()
    try:
        deviations = {
            group: _compare(env, expected, of_policy(heldout, pi0=group == PI0), seed)
            for group in (PI0, OFF)
            if not lacking
        }
        reach = (
            ask_reachability(env, transformation, heldout.episodes, seed) if transformation and not lacking else None
        )
    finally:
        env.close()
    ran = pi0_in(scenario, parameters, derive_seed(seed, EPISODES))
    return GroundingReport(
        {group: deviation for group, deviation in deviations.items() if deviation},
        layout.joints,
        len(ran),
        sum(fell for _, fell in ran),
        np.array([value for value, _ in ran]),
        count_allowed_falls(heldout),
        transformation.alpha if transformation else None,
        reach,
        sum(episode.ended_in_a_fall for episode in of_policy(heldout, pi0=False)),
        lacking,
    )


def largest_stable(
    scenarios: Mapping[float, Scenario], parameters: np.ndarray, seed: int, *, allowed: int = 0
) -> float:
    """Return the first key of scenarios in which π0 falls in no more than some of `EPISODES` episodes, else the last.

    Args:
        scenarios: By how far each goes, the farthest first.
        parameters: Of π0, shape (n_parameters,).
        seed: Of all randomness.
        allowed: Number of falls.
    """
    *tried, last = scenarios
    stands = (
        far
        for far in tried
        if sum(fell for _, fell in pi0_in(scenarios[far], parameters, seed, patience=allowed)) <= allowed
    )
    return next(stands, last)


def ask_reachability(
    env: Any, grounding: LoadedTransformation, episodes: Sequence[Trajectory], seed: int
) -> Reachability | None:
    """Return how much of what is predicted on real trajectories the simulator can do; None if that is no tick ahead."""
    starts = places(episodes, env.layout, ASKED, max(PAST, grounding.forward.history.span))
    return reachability(env, grounding, starts, seed) if starts and grounding.forward.horizon == 1 else None


def _compare(env: Any, grounding: Any, episodes: Sequence[Any], seed: int) -> dict[str, dict[int, Deviations]]:
    starts = places(episodes, env.layout, REPLAYS)
    if not starts:
        return {}
    return {
        GROUNDED: replay_starts(env, grounding, starts, seed),
        BARE: replay_starts(env, NoGrounding(), starts, seed),
        STILL: predict_no_change(env.layout, starts),
    }


def pi0_in(
    scenario: Scenario, parameters: np.ndarray, seed: int, *, patience: int = EPISODES
) -> list[tuple[float, bool]]:
    """Return value and fall of some episodes of π0, one in each member of an ensemble, up to more than `patience`."""
    env, done = scenario.make(), []
    members = len(scenario.world.members) if isinstance(scenario.world, EnsembleWorld) else 1
    for index in range(max(EPISODES, members)):
        episode = rollout(scenario, env, parameters, take_turns(scenario.world, derive_seed(seed, index), index))
        done.append((episode.value, episode.ended_in_a_fall))
        if sum(fell for _, fell in done) > patience:
            break
    env.close()
    return done
