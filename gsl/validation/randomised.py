"""The check of randomised effects: how widely may they be drawn so that π0 keeps its feet?"""

from __future__ import annotations

from dataclasses import replace

from gsl.grounding.none import NoGrounding
from gsl.grounding.randomised import RandomisedEffects, randomise
from gsl.rollout.rollout import Scenario
from gsl.validation.check import EPISODES, largest_stable
from gsl.validation.gate import Gate, Passed, examine


@examine.register
def check_randomised(grounding: RandomisedEffects, scenario: Scenario, gate: Gate) -> Passed:
    """Settle the width; of what knows nothing of the real robot there is nothing else to check."""
    bare = replace(scenario, grounding=NoGrounding())
    worlds = {width: replace(bare, world=randomise(bare.world, grounding, width)) for width in grounding.widths}
    width = largest_stable(worlds, gate.parameters, gate.seed_of("width"))
    share = f"{100 * width:.0f} % of the documented ranges"
    gate.console.status(f"drawing from {share}")
    fell = sum(gate.walk(worlds[width], "width")) if width == min(worlds) else 0
    problems = [f"π0 falls in {fell} of {EPISODES} episodes that draw from {share}"] if fell else []
    gate.report({"width": width, "acceptable": not problems, "problems": problems})
    gate.judge(problems, "Lower grounding.width")
    return Passed(worlds[width], {"width": width, "grounding_acceptable": not problems})
