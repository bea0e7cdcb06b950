"""An evaluation as rows for people: in simulation, on the real side, and how episodes ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.unit import Unit
from gsl.core.words import in_unit


def columns(outcomes: Sequence[str], unit: Unit) -> list[str]:
    """Return the titles of `cells`."""
    places = [in_unit(place, unit.name) for place in ("in simulation", "in real")]
    return ["policy", *places, "95 % interval", ends(unit), *outcomes]


def ends(unit: Unit) -> str:
    """Return the title over `ended`."""
    return "falls" if unit.falls else "episodes"


def format_ends(one: Mapping[str, Any], unit: Unit) -> str:
    """Return a cell for people: falls of episodes, or episodes alone."""
    return f"{one['falls']} of {one['episodes']}" if unit.falls else str(one["episodes"])


def cells(one: Mapping[str, Any], name: str, unit: Unit, outcomes: Sequence[str]) -> list[str]:
    """Return a row for people; a policy that stopped at its fall has no interval."""
    interval = unit.interval(one["interval"]) if np.isfinite(one["interval"]).all() and not one["falls"] else ""
    simulated = "" if one["value_sim"] is None else unit.bare(one["value_sim"])
    outcome = [f"{one['outcome'][name]:.1f}" if name in one["outcome"] else "" for name in outcomes]
    return [name, simulated, unit.bare(one["value"]), interval, format_ends(one, unit), *outcome]
