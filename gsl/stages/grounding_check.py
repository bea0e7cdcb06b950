"""The check of a grounding before anything is optimised in it: is the grounded simulator nearer to the real robot?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from gsl.core.observation import missing
from gsl.core.seeds import derived_seed
from gsl.core.trajectory import Batch, Trajectory
from gsl.errors import InputError
from gsl.grounding.gat import LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.stages.grounding_replay import PAST, TICKS, Deviations, places, replayed, unmoved
from gsl.stages.reachability import Reachability, reachability
from gsl.stages.rollout import Scenario, rollout
from gsl.stages.training import FALLS, degrees, degrees_by_joint, of_policy

PI0, OFF = "pi0", "off_pi0"
GROUNDED, BARE, STILL = "grounded", "ungrounded", "no_change"
REPLAYS = 60  # of each group of trajectories, at most
ASKED = 40  # steps of which it is asked whether the simulator can do them
EPISODES = 4  # of pi0 in the grounded simulator
SURELY = 0.05  # chance of so many falls in the grounded simulator, if π0 fell there as often as in real
ALPHAS = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)


@dataclass(frozen=True)
class GroundingReport:
    """What is known of a grounding.

    Attributes:
        deviations: By group (pi0, off_pi0), simulator (grounded, ungrounded, no_change) and ticks; nothing where the
            real robot did not tell all of its state.
        joints: Names of the joints.
        episodes: Of pi0 in the grounded simulator.
        falls: How many of them ended in a fall.
        values: Their values, shape (episodes,).
        allowed: Falls of π0 in the grounded simulator that are no problem, since it falls in real as well.
        alpha: How far the grounding goes.
        reach: What of the forward model's predictions the simulator can do, where that was asked.
        cut: How many held-out episodes off π0 ended in a fall or were stopped.
        lacking: What the real trajectories do not tell, without which no simulation can start from them.
    """

    deviations: Mapping[str, Mapping[str, Mapping[int, Deviations]]]
    joints: tuple[str, ...]
    episodes: int
    falls: int
    values: np.ndarray
    allowed: int = 0
    alpha: float | None = None
    reach: Reachability | None = None
    cut: int = 0
    lacking: tuple[str, ...] = ()

    @property
    def problems(self) -> tuple[str, ...]:
        """Why nothing should be optimised in this grounding, in words."""
        found = self._farther() if self.deviations else []
        if self.falls > self.allowed:
            found.append(f"π0 falls in {self.falls} of {self.episodes} episodes of the grounded simulator")
        return tuple(found)

    def _farther(self) -> list[str]:
        group = OFF if OFF in self.deviations else PI0
        errors = {name: degrees(self.deviations[group][name][TICKS].joints) for name in (GROUNDED, BARE)}
        cut = f"held out, but fallen or stopped too early: {self.cut}; " if self.cut else ""
        nothing = f"off π0 nothing was held out to measure it on ({cut}collect neighbours)"
        found = [] if group == OFF else [nothing]
        if errors[GROUNDED] > errors[BARE]:
            against = f"{errors[GROUNDED]:.2f}°, without grounding {errors[BARE]:.2f}°"
            found.append(f"after {TICKS} ticks the joints {_named(group)} are farther from the real ones: {against}")
        return found

    @property
    def remark(self) -> str:
        """What of the body is farther from the real robot than without grounding off π0; it decides nothing."""
        if OFF not in self.deviations:
            return ""
        grounded, bare = (self._errors(self.deviations[OFF][name][TICKS]) for name in (GROUNDED, BARE))
        body = {"pitch": "pitch_deg", "place": "forward_mm"}
        farther = [name for name, error in body.items() if grounded[error] > bare[error]]
        if not farther:
            return ""
        return f"after {TICKS} ticks the body's {' and '.join(farther)} off π0 is farther from the real one"

    @property
    def acceptable(self) -> bool:
        """Whether there is no problem."""
        return not self.problems

    def metrics(self) -> dict[str, Any]:
        """Return everything as a JSON document."""
        errors = {
            group: {
                name: {_span(ticks): self._errors(one) for ticks, one in by_ticks.items()}
                for name, by_ticks in sims.items()
            }
            for group, sims in self.deviations.items()
        }
        pi0 = {"episodes": self.episodes, "falls": self.falls, "value": float(np.mean(self.values))}
        return {
            "alpha": self.alpha,
            "errors": errors,
            "reachability": self.reach.metrics() if self.reach else None,
            "pi0": pi0,
            "acceptable": self.acceptable,
            "problems": self.problems,
            "remark": self.remark,
        }

    def by_joint(self) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
        """Return the error of each joint after `TICKS` ticks [deg], by group and simulator."""
        return {
            _named(group): {
                name: degrees_by_joint(by_ticks[TICKS].joints, self.joints) for name, by_ticks in sims.items()
            }
            for group, sims in self.deviations.items()
        }

    def rows(self) -> list[tuple[str, ...]]:
        """Return a table for people; its titles are `TITLES`."""
        return [
            (_named(group), name.replace("_", " "), *_cells(by_ticks[1]), *_cells(by_ticks[TICKS]))
            for group, simulators in self.deviations.items()
            for name, by_ticks in simulators.items()
        ]

    def _errors(self, one: Deviations) -> dict[str, Any]:
        return {
            "replays": len(one),
            "joints_deg": degrees(one.joints),
            "pitch_deg": degrees(one.pitch),
            "forward_mm": one.forward_mm,
            "by_joint_deg": degrees_by_joint(one.joints, self.joints),
        }


TITLES = (
    *("trajectories", "simulator", "joints 1 tick [°]", "pitch 1 tick [°]", "forward 1 tick [mm]"),
    *(f"joints {TICKS} ticks [°]", f"pitch {TICKS} ticks [°]", f"forward {TICKS} ticks [mm]"),
)


def allowed_falls(heldout: Batch) -> int:
    """Return how often π0 may fall in the grounded simulator: not surely more often than by its share in real."""
    share = float(heldout.metadata.get(FALLS, 0.0))
    return max(k for k in range(EPISODES + 1) if stats.binom.sf(k - 1, EPISODES, share) >= SURELY)


def check(scenario: Scenario, parameters: np.ndarray, heldout: Batch, seed: int) -> GroundingReport:
    """Measure a grounding: its replays as it is expected, π0 with its draws and noise.

    Args:
        scenario: The simulator with the task, the policy and a `LoadedTransformation`.
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
    assert isinstance(grounding, LoadedTransformation), "only learned groundings are checked so"
    lacking = tuple(dict.fromkeys(part for episode in heldout.episodes for part in missing(episode, layout)))
    env = scenario.world.make()
    deviations = {
        group: _compared(env, grounding.expected, of_policy(heldout, pi0=group == PI0), seed)
        for group in (PI0, OFF)
        if not lacking
    }
    reach = None if lacking else asked(env, grounding, heldout.episodes, seed)
    env.close()
    ran = pi0_in(scenario, parameters, derived_seed(seed, EPISODES))
    return GroundingReport(
        {group: found for group, found in deviations.items() if found},
        layout.joints,
        len(ran),
        sum(fell for _, fell in ran),
        np.array([value for value, _ in ran]),
        allowed_falls(heldout),
        grounding.alpha,
        reach,
        sum(one.ended_in_a_fall for one in of_policy(heldout, pi0=False)),
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


def asked(env: Any, grounding: LoadedTransformation, episodes: Sequence[Trajectory], seed: int) -> Reachability | None:
    """Return how much of what is predicted on real trajectories the simulator can do; None if that is no tick ahead."""
    starts = places(episodes, env.layout, ASKED, max(PAST, grounding.forward.history.span))
    return reachability(env, grounding, starts, seed) if starts and grounding.forward.horizon == 1 else None


def _compared(env: Any, grounding: Any, episodes: Sequence[Any], seed: int) -> dict[str, dict[int, Deviations]]:
    starts = places(episodes, env.layout, REPLAYS)
    if not starts:
        return {}
    return {
        GROUNDED: replayed(env, grounding, starts, seed),
        BARE: replayed(env, NoGrounding(), starts, seed),
        STILL: unmoved(env.layout, starts),
    }


def pi0_in(
    scenario: Scenario, parameters: np.ndarray, seed: int, *, patience: int = EPISODES
) -> list[tuple[float, bool]]:
    """Return value and fall of some episodes of π0, up to one fall more than `patience`."""
    env, done = scenario.make(), []
    for index in range(EPISODES):
        episode = rollout(scenario, env, parameters, derived_seed(seed, index))
        done.append((episode.value, episode.ended_in_a_fall))
        if sum(fell for _, fell in done) > patience:
            break
    env.close()
    return done


def _cells(one: Deviations) -> tuple[str, str, str]:
    return f"{degrees(one.joints):.2f}", f"{degrees(one.pitch):.2f}", f"{one.forward_mm:.1f}"


def _named(group: str) -> str:
    return "of π0" if group == PI0 else "off π0"


def _span(ticks: int) -> str:
    return "one_tick" if ticks == 1 else f"{ticks}_ticks"
