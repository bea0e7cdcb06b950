"""The gate before a search: a grounding that makes the simulator no better is refused, with the report that says so.

What is checked depends on the kind of grounding: `examine` is a generic function, and each kind's check stands in a
file of its own. A kind without one passes unchecked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gsl.core.console import Console
from gsl.core.interfaces import SIM, World
from gsl.core.seeds import derive_seed
from gsl.errors import Refused
from gsl.grounding.ane import ActionNoise
from gsl.grounding.none import NoGrounding
from gsl.grounding.random_choice import RandomChoice
from gsl.rollout.rollout import Scenario
from gsl.storage.documents import write_json
from gsl.validation.check import pi0_in
from gsl.validation.uncharged import warn_uncharged
from gsl.worlds.ensemble import EnsembleWorld

REPORT = "grounding.json"


class Passed(NamedTuple):
    """A scenario ready to act, and what to report of its grounding."""

    scenario: Scenario
    metrics: Mapping[str, Any]


@dataclass(frozen=True)
class Gate:
    """What a grounding has to pass on its way into a search.

    Attributes:
        parameters: Of π0, shape (n_parameters,).
        folder: Where its report goes.
        console: Where it is shown.
        accept: Whether it may pass in spite of problems.
        seed: Of all randomness.
    """

    parameters: np.ndarray
    folder: Path
    console: Console
    accept: bool
    seed: int

    def report(self, document: Mapping[str, Any]) -> None:
        """Write what was found of a grounding."""
        write_json(self.folder / REPORT, document)

    def seed_of(self, what: str) -> int:
        """Return the seed of a part of a check."""
        return derive_seed(self.seed, what)

    def walk(self, scenario: Scenario, what: str = "check") -> list[bool]:
        """Let π0 act in some episodes; return in which of them it falls."""
        return [fell for _, fell in pi0_in(scenario, self.parameters, self.seed_of(what))]

    def check_falls(self, scenario: Scenario, where: str, advice: str) -> Mapping[str, Any]:
        """Let a scenario pass in which π0 keeps its feet; there is nothing else to check of it.

        Args:
            scenario: Ready to act.
            where: Completes "π0 falls in 2 of 4 episodes ...".
            advice: What to do otherwise.

        Raises:
            Refused: π0 falls and `accept` is not set.
        """
        fell = self.walk(scenario)
        problems = [f"π0 falls in {sum(fell)} of {len(fell)} episodes {where}"] if any(fell) else []
        self.report({"acceptable": not problems, "problems": problems})
        self.judge(problems, advice)
        return {"grounding_acceptable": not problems}

    def judge(self, problems: Sequence[str], advice: str) -> None:
        """Refuse a grounding with problems, or only warn of them where it is accepted.

        Raises:
            Refused: There is one, and `accept` is not set.
        """
        if not problems:
            return
        problem = "; ".join(problems)
        if not self.accept:
            raise Refused(problem, advice)
        self.console.status(f"warning: {problem}")

    def show_members(self, world: World) -> None:
        """Show that the search is in several simulators, if it is."""
        if isinstance(world, EnsembleWorld):
            self.console.status(f"every episode of the search is in one of {len(world.members)} simulators")


@singledispatch
def examine(grounding: Any, scenario: Scenario, gate: Gate) -> Passed:
    """Check a grounding by its kind: `grounding` is the scenario's own. Of an unknown kind only π0's falls are."""
    if not isinstance(grounding, NoGrounding):
        warn_uncharged(scenario.world, gate.console, SIM, "the grounded action")
    ready = scenario.prepare()
    if isinstance(grounding, NoGrounding | ActionNoise | RandomChoice):
        return Passed(ready, {})
    kind = type(grounding).__name__
    gate.console.status(f"{kind} is no grounding of gsl's: only the falls of π0 in it are checked")
    return Passed(ready, gate.check_falls(ready, "of the grounded simulator", f"Let {kind} change less"))
