"""What is known of a grounding before anything is optimised in it, and whether that speaks against it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gsl.models.free_run import TICKS
from gsl.training.data import degrees, degrees_by_joint
from gsl.validation.reachability import Reachability
from gsl.validation.replay import Deviations

PI0, OFF = "pi0", "off_pi0"
GROUNDED, BARE, STILL = "grounded", "ungrounded", "no_change"


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
        problems = self._farther() if self.deviations else []
        if self.falls > self.allowed:
            problems.append(f"π0 falls in {self.falls} of {self.episodes} episodes of the grounded simulator")
        return tuple(problems)

    def _farther(self) -> list[str]:
        group = OFF if OFF in self.deviations else PI0
        errors = {name: degrees(self.deviations[group][name][TICKS].joints) for name in (GROUNDED, BARE)}
        cut = f"held out, but fallen or stopped too early: {self.cut}; " if self.cut else ""
        nothing = f"off π0 nothing was held out to measure it on ({cut}collect neighbours)"
        problems = [] if group == OFF else [nothing]
        if errors[GROUNDED] > errors[BARE]:
            against = f"{errors[GROUNDED]:.2f}°, without grounding {errors[BARE]:.2f}°"
            problems.append(
                f"after {TICKS} ticks the joints {_name_group(group)} are farther from the real ones: {against}"
            )
        return problems

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
                name: {_span(ticks): self._errors(deviations) for ticks, deviations in by_ticks.items()}
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
            "lacking": self.lacking,
        }

    def by_joint(self) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
        """Return the error of each joint after `TICKS` ticks [deg], by group and simulator."""
        return {
            _name_group(group): {
                name: degrees_by_joint(by_ticks[TICKS].joints, self.joints) for name, by_ticks in sims.items()
            }
            for group, sims in self.deviations.items()
        }

    def rows(self) -> list[tuple[str, ...]]:
        """Return a table for people; its titles are `TITLES`."""
        return [
            (_name_group(group), name.replace("_", " "), *_cells(by_ticks[1]), *_cells(by_ticks[TICKS]))
            for group, simulators in self.deviations.items()
            for name, by_ticks in simulators.items()
        ]

    def _errors(self, deviations: Deviations) -> dict[str, Any]:
        return {
            "replays": len(deviations),
            "joints_deg": degrees(deviations.joints),
            "pitch_deg": degrees(deviations.pitch),
            "forward_mm": deviations.forward_mm,
            "by_joint_deg": degrees_by_joint(deviations.joints, self.joints),
        }


TITLES = (
    *("trajectories", "simulator", "joints 1 tick [°]", "pitch 1 tick [°]", "forward 1 tick [mm]"),
    *(f"joints {TICKS} ticks [°]", f"pitch {TICKS} ticks [°]", f"forward {TICKS} ticks [mm]"),
)


def _cells(deviations: Deviations) -> tuple[str, str, str]:
    return f"{degrees(deviations.joints):.2f}", f"{degrees(deviations.pitch):.2f}", f"{deviations.forward_mm:.1f}"


def _name_group(group: str) -> str:
    return "of π0" if group == PI0 else "off π0"


def _span(ticks: int) -> str:
    return "one_tick" if ticks == 1 else f"{ticks}_ticks"
