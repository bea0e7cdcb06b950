"""Joints whose measurements are exchanged: a position that follows another joint's command and not its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gsl.core.series import likeness
from gsl.core.trajectory import Trajectory

FOLLOWS, UNLIKE = 0.9, 0.5  # correlations above and below which a position follows a command, or does not
AS_FAR = 0.33  # of the command that it follows: a joint that is dragged along moves less
AGAINST = 3  # times as many episodes that say so as say the contrary


def find_exchanges(found: Sequence[Trajectory], moves: float) -> dict[int, int]:
    """Return for each joint whose position is another's that other joint; episodes of like commands say nothing.

    Args:
        found: Trajectories of the same joints.
        moves: Range of a command below which it does not move [rad].
    """
    told = {}
    for joint in range(found[0].action.shape[1]):
        own = [_likeness(one, joint, joint, moves) for one in found]
        unlike = [one for one, alike in zip(found, own, strict=True) if alike < UNLIKE]
        votes = np.zeros(found[0].action.shape[1], dtype=int)
        for other in set(range(len(votes))) - {joint}:
            votes[other] = sum(
                _likeness(one, other, joint, moves) > FOLLOWS and _likeness(one, other, other, moves) < FOLLOWS
                for one in unlike
            )  # where the other joint follows its own command as well, two commands are nearly equal, or one is a copy
        best = int(np.argmax(votes))
        like = [one for one, alike in zip(found, own, strict=True) if alike > FOLLOWS] if votes[best] else []
        contrary = sum(_likeness(one, best, joint, moves) < UNLIKE for one in like)
        if votes[best] and votes[best] >= AGAINST * contrary:
            told[joint] = best
    return told


def _likeness(one: Trajectory, command: int, measured: int, moves: float) -> float:
    """Return how much like a joint's command a position is; 0 where the command rests or it moves much less far."""
    action, position = one.action[:, command], one.position[:-1, measured]
    if np.ptp(action) < moves or (command != measured and np.std(position) < AS_FAR * np.std(action)):
        return 0.0
    return likeness(action, position, one.time[:-1])
