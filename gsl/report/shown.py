"""Positions of joints as people read them: degrees of a joint that turns, millimetres of one that slides."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np


class Scale(NamedTuple):
    """What a position is multiplied by to be shown, and the unit that it has then."""

    factor: float
    unit: str


DEGREES, MILLIMETRES = Scale(180.0 / np.pi, "°"), Scale(1e3, "mm")


def scale_of(joint: str, slides: Collection[str]) -> Scale:
    """Return how the positions of a joint are shown, given the names of those that slide."""
    return MILLIMETRES if joint in slides else DEGREES
