"""Every trial of a comparison as a dot, one panel a pair of worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from gsl.core.interfaces import Grounding
from gsl.grounding.effects import DiagnosedEffects, innermost
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.servo import LearnedServo
from gsl.report.style import EFFECTS, GAT, SERVO, SGAT, UNINFORMED
from gsl_experiments.paper_cells import Drawn
from gsl_experiments.trial import Trial
from gsl_experiments.trial_dots import Dots, trial_dots_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def method_colour(grounding: Grounding) -> str:
    """Return the colour of a method's dots: what it learns from, and whether it draws."""
    if isinstance(innermost(grounding), LearnedServo):
        return SERVO
    if isinstance(grounding, DiagnosedEffects):
        return EFFECTS
    if not isinstance(grounding, ActionTransformation):
        return UNINFORMED
    return GAT if grounding.predicts == "point" else SGAT


def trials_figure(trials: Sequence[Trial], methods: Mapping[str, Grounding], drawn: Drawn, *, tolerant: bool) -> Figure:
    """Return the figure of every trial, hollow where it failed.

    Args:
        trials: All of them.
        methods: The groundings, by name.
        drawn: What is drawn of each trial.
        tolerant: Whether a policy may fall and be stable.
    """
    panels: dict[str, dict[str, Dots]] = {}
    further = any(trial.iteration > 1 for trial in trials)
    failures = drawn.failed or [trial.surely <= 0.0 if tolerant else trial.without for trial in trials]
    for cell in dict.fromkeys(trial.cell for trial in trials):
        every = zip(trials, drawn.values, failures, strict=True)
        shown, failed = zip(*((value, failure) for trial, value, failure in every if trial.cell == cell), strict=True)
        panel = f"{cell.simulator} as simulator, {cell.world} on the real side" if cell.simulator else cell.world
        name = f"{cell.method}, iteration {cell.iteration}" if further else cell.method
        panels.setdefault(panel, {})[name] = Dots(shown, failed, method_colour(methods[cell.method]))
    missed = drawn.missed or f"no {'sure' if tolerant else 'stable'} improvement{' by the iteration' * further}"
    return trial_dots_figure(panels, axis=drawn.axis, title=f"Every trial (hollow: {missed}), mean and 95 % interval")
