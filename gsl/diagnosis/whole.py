"""Whole trajectories replayed open loop, from the first measured state to the end of the log: a second opinion.

Windows start anew from what was measured; here errors may add up, as they do in whoever trains in the simulator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gsl.core.body import Robot
from gsl.diagnosis.records import Record, pieces
from gsl.diagnosis.replay import Effects, Simulator


def mean_errors(
    simulator: Simulator, effects: Effects, nuisances: np.ndarray, found: Sequence[Record], robot: Robot
) -> np.ndarray:
    """Return the mean absolute error of replays, shape (n_records, n_joints) [rad].

    It is NaN where a replay diverges, and of trajectories whose torque is never on.

    Args:
        simulator: What replays.
        effects: That are switched on.
        nuisances: Shape (7, n_joints).
        found: Trajectories in the air, each replayed from where its torque is first on to where it is switched off.
        robot: Theirs.
    """
    errors = []
    for one in map(driven, found):
        if not len(one):
            errors.append(np.full(one.position.shape[1], np.nan))
            continue
        whole = pieces([one], robot, simulator.period, warm_up=0, scored=len(one))
        told = simulator.told(effects, nuisances, whole)
        errors.append(np.abs(told - whole.real).mean(axis=(0, 1)))
    return np.array(errors)


def driven(one: Record) -> Record:
    """Return a trajectory from where its torque is first on to where it is switched off; maybe of no control period."""
    works = one.driven[: len(one)]
    first = int(np.argmax(works)) if works.any() else len(one)
    off = np.flatnonzero(~works[first:])
    last = first + int(off[0]) if len(off) else len(one)
    rows = slice(first, last + 1)
    return replace(
        one,
        targets=one.targets[first:last],
        position=one.position[rows],
        velocity=one.velocity[rows],
        sensors={key: values[rows] for key, values in one.sensors.items()},
    )
