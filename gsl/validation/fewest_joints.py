"""The state variables of interest (the paper's section 10.2): the fewest joints whose grounding does as well as any."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gsl.errors import InputError
from gsl.grounding.gat import LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.models.free_run import TICKS
from gsl.validation.replay import Place, replay_starts


def fewest(env: Any, grounding: LoadedTransformation, starts: Sequence[Place], seed: int) -> tuple[str, ...]:
    """Return the joints to ground, in the robot's order; none where grounding brings the simulator no nearer.

    Joints are ranked by what grounding all of them gains in each. Of the sets of the first k, the smallest one is taken
    whose replays are within a standard error of those of the best.

    Args:
        env: The simulator.
        grounding: Of all joints that its models know.
        starts: On validation trajectories, which do not judge the grounding; a linear f has learned from them, too.
        seed: Of all randomness.

    Raises:
        InputError: There is nothing to replay.
    """
    if not starts:
        raise InputError("no validation trajectory is long enough to choose joints on; say grounding.x=all")
    joints = grounding.forward.joints
    grounding, bare = grounding.deterministic, _squares(env, NoGrounding(), starts, seed)
    gained = (bare - _squares(env, grounding, starts, seed)).mean(axis=0)[env.layout.numbers(joints)]
    order = [joints[k] for k in np.argsort(-gained)]
    sets = [tuple(order[:k]) for k in range(len(order) + 1)]
    errors = [bare.sum(axis=1)]
    errors += [_squares(env, replace(grounding, x=chosen), starts, seed).sum(axis=1) for chosen in sets[1:]]
    best = errors[int(np.argmin([error.mean() for error in errors]))]
    fits = (k for k, error in enumerate(errors) if (error - best).mean() <= (error - best).std() / np.sqrt(len(starts)))
    chosen = set(sets[next(fits)])
    return tuple(joint for joint in joints if joint in chosen)


def _squares(env: Any, grounding: NoGrounding | LoadedTransformation, starts: Sequence[Place], seed: int) -> np.ndarray:
    """Return squared deviations of the joints after `TICKS` [rad²], shape (replays, n_joints)."""
    squares: np.ndarray = replay_starts(env, grounding, starts, seed)[TICKS].joints ** 2
    return squares
