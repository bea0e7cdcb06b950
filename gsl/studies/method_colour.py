"""The colour of a method's dots: what it learns from, and whether it draws."""

from __future__ import annotations

from gsl.grounding.effects import DiagnosedEffects
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.grounding import Grounding
from gsl.report.style import EFFECTS, GAT, SGAT, UNINFORMED


def method_colour(grounding: Grounding | ActionTransformation) -> str:
    """Return it, as the style's figures have it."""
    if isinstance(grounding, DiagnosedEffects):
        return EFFECTS
    if not isinstance(grounding, ActionTransformation):
        return UNINFORMED
    return GAT if grounding.predicts == "point" else SGAT
