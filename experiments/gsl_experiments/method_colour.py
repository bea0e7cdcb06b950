"""The colour of a method's dots: what it learns from, and whether it draws."""

from __future__ import annotations

from gsl.core.interfaces import Grounding
from gsl.grounding.effects import DiagnosedEffects, innermost
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.servo import LearnedServo
from gsl.report.style import EFFECTS, GAT, SERVO, SGAT, UNINFORMED


def method_colour(grounding: Grounding) -> str:
    """Return it, as the style's figures have it."""
    if isinstance(innermost(grounding), LearnedServo):
        return SERVO
    if isinstance(grounding, DiagnosedEffects):
        return EFFECTS
    if not isinstance(grounding, ActionTransformation):
        return UNINFORMED
    return GAT if grounding.predicts == "point" else SGAT
