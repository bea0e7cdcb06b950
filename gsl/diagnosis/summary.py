"""The summary: what a diagnosis found, in a sentence or two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gsl.diagnosis.verdict import Verdict

SURE, EVEN = 0.9, 0.5  # probability of every cause from which on they are the causes, and probable ones
WORDS = {
    "no_gap": "The simulator and the robot agree as far as noise and a per-joint calibration can tell.",
    "unknown": "There is a gap that no effect of the library explains.",
}


def summary(verdict: Verdict, causes: Sequence[Mapping[str, Any]], shrunk: Mapping[str, Any]) -> str:
    """Return what was found in a sentence or two.

    Args:
        verdict: What the selection allows to say.
        causes: What is told of each cause: effect, scope and probability.
        shrunk: From `shrinkage`.
    """
    if verdict.word in WORDS and not causes:
        return WORDS[verdict.word]
    *most, last = [f"{one['effect'].replace('_', ' ')}{_of(one['scope'])}" for one in causes]
    named = f"{', '.join(most)} and {last}" if most else last
    if verdict.word == "inseparable":
        groups = "; ".join(" or ".join(group) for group in verdict.inseparable).replace("_", " ")
        return f"The gap looks like {named}, but this log cannot tell apart: {groups}."
    caused = f"{doubt(causes)} caused".lstrip()
    if shrunk["fraction"] is None:
        return f"The gap is {caused} by {named}."
    gone, alone = shrunk["fraction"], max(0.0, shrunk["calibration_fraction"])
    share = "what" if gone - alone >= 0.5 * (1.0 - alone) else "a part of what"
    return (
        f"A calibration of each joint removes {100.0 * alone:.0f} % of the gap on held-out data; {share} it leaves is "
        f"{caused} by {named}; together they remove {100.0 * gone:.0f} %."
    )


def doubt(causes: Sequence[Mapping[str, Any]]) -> str:
    """Return what the least sure cause needs said: nothing, probably or possibly."""
    least = min((one["probability"] for one in causes), default=1.0)
    return "" if least >= SURE else "probably" if least >= EVEN else "possibly"


def _of(scope: str) -> str:
    return "" if not scope else f" of {'all joints' if scope == 'all' else scope}"
