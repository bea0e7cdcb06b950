"""An evaluation as rows for people: in simulation, on the real side, and how episodes ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.unit import Unit
from gsl.core.words import in_unit

BEGUN = {"pi0": "π0", "start": "where it began"}  # names in files of what a search begins with


def outcomes_beside(rows: Sequence[Mapping[str, Any]], unit: Unit) -> list[str]:
    """Return the outcomes that rows have, but for one that is their value under another name."""
    names = dict.fromkeys(name for row in rows for name in row["outcome"])

    def differs(name: str, row: Mapping[str, Any]) -> bool:
        return name in row["outcome"] and f"{row['outcome'][name]:.1f}" != unit.bare(row["value"])

    return [name for name in names if any(differs(name, row) for row in rows)]


def columns(outcomes: Sequence[str], unit: Unit) -> list[str]:
    """Return the titles of `cells`."""
    places = [in_unit(place, unit.name) for place in ("in simulation", "on the real side")]
    return ["policy", *places, "95 % interval", ends(unit), *outcomes]


def name_policy(name: str) -> str:
    """Return what people call a policy, whatever its name in files."""
    return BEGUN.get(name, name)


def ends(unit: Unit) -> str:
    """Return the title over `ended`."""
    return "falls" if unit.falls else "episodes"


def format_ends(row: Mapping[str, Any], unit: Unit) -> str:
    """Return a cell for people: falls of episodes, or episodes alone."""
    return f"{row['falls']} of {row['episodes']}" if unit.falls else str(row["episodes"])


def cells(row: Mapping[str, Any], name: str, unit: Unit, outcomes: Sequence[str]) -> list[str]:
    """Return a row for people; a policy that stopped at its fall has no interval."""
    interval = unit.interval(row["interval"]) if np.isfinite(row["interval"]).all() and not row["falls"] else ""
    simulated = "" if row["value_sim"] is None else unit.bare(row["value_sim"])
    outcome = [f"{row['outcome'][name]:.1f}" if name in row["outcome"] else "" for name in outcomes]
    return [name, simulated, unit.bare(row["value"]), interval, format_ends(row, unit), *outcome]
