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
    """Return the mean absolute error of replays, shape (n_records, n_joints) [rad]; NaN where one diverges.

    Args:
        simulator: What replays.
        effects: That are switched on.
        nuisances: Shape (7, n_joints).
        found: Trajectories in the air, each replayed up to where its torque is switched off.
        robot: Theirs.
    """
    errors = []
    for one in map(_driven, found):
        whole = pieces([one], robot, simulator.period, warm_up=0, scored=len(one))
        told = simulator.told(effects, nuisances, whole)
        errors.append(np.abs(told - whole.real).mean(axis=(0, 1)))
    return np.array(errors)


def _driven(one: Record) -> Record:
    """Return a trajectory up to where its torque is switched off."""
    works = np.asarray(one.sensors.get("enabled", np.ones(len(one) + 1)), dtype=bool)
    ticks = len(one) if works.all() else int(np.argmin(works))
    columns = {key: values[: ticks + 1] for key, values in one.sensors.items()}
    return replace(
        one,
        targets=one.targets[:ticks],
        position=one.position[: ticks + 1],
        velocity=one.velocity[: ticks + 1],
        sensors=columns,
    )
