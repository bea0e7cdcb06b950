"""A duration in words."""

from __future__ import annotations

from gsl.core.words import several


def duration_told(duration: float) -> str:
    """Return words for a duration [s]."""
    minutes = max(1, round(duration / 60.0))
    return f"about {several(minutes, 'minute')}" if minutes < 90 else f"about {minutes / 60.0:.1f} hours"
