"""Splitting trajectories, never transitions: neighbouring ticks are all but the same sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Split(NamedTuple):
    """Indices of trajectories, in order."""

    training: tuple[int, ...]
    heldout: tuple[int, ...]


def split(groups: Sequence[bool], share: float, rng: np.random.Generator) -> Split:
    """Hold out a share of the trajectories of either group.

    Of a group of two or more at least one is held out and one kept. Of all trajectories, if there are two or more, at
    least one is held out.

    Args:
        groups: Group of each trajectory, such as whether it is one of pi0.
        share: Of each group, in (0, 1).
        rng: Chooses.
    """
    members = [np.flatnonzero(np.array(groups, dtype=bool) == group) for group in (True, False)]
    chosen = [rng.permutation(part)[: _number(len(part), share)] for part in members]
    heldout = {int(index) for part in chosen for index in part}
    if not heldout and len(groups) > 1:
        heldout = {len(groups) - 1}
    return Split(tuple(index for index in range(len(groups)) if index not in heldout), tuple(sorted(heldout)))


def _number(size: int, share: float) -> int:
    return min(max(round(share * size), 1), size - 1) if size else 0
