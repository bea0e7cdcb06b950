"""All checks of the signals of a log that need no simulator, and the log with what can be mended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from gsl.core.trajectory import Trajectory
from gsl.storage.signals.base_frame import find_base_frames
from gsl.storage.signals.copies import find_copies
from gsl.storage.signals.finding import Finding, together
from gsl.storage.signals.glitches import find_glitches, mend
from gsl.storage.signals.stuck import find_stuck
from gsl.storage.signals.velocities import find_velocities
from gsl.storage.signals.wraps import find_turns, find_wraps, join


def check_signals(
    episodes: Sequence[Trajectory], joints: Sequence[str], levers: Mapping[str, float] = MappingProxyType({})
) -> list[Finding]:
    """Return what looks wrong with the signals of a log.

    Args:
        episodes: Trajectories of the same joints, in the contract's units.
        joints: Names, in order.
        levers: Metres in a unit of the joints that are known to slide.
    """
    wraps = find_wraps(episodes, joints, levers)
    whole = join_turns(episodes) if wraps else episodes
    checks = (find_glitches, find_copies, find_stuck, find_velocities)
    findings = [*wraps, *(finding for check in checks for finding in check(whole, joints))]
    return [*together(findings, joints), *find_base_frames(episodes)]


def join_turns(episodes: Sequence[Trajectory]) -> list[Trajectory]:
    """Return trajectories whose wrapping angles go on; velocities of these are derived anew."""
    turns = find_turns(episodes)
    made = []
    for episode in episodes:
        position, action, velocity = episode.position.copy(), episode.action.copy(), episode.velocity.copy()
        for (signal, k), turn in turns.items():
            if signal == "action":
                action[:, k] = join(action[:, k], turn)
        for (signal, k), turn in turns.items():
            if signal == "position":
                position[:, k] = join(position[:, k], turn)
                velocity[:, k] = np.gradient(position[:, k], episode.time)
                apart = action[:, k] - position[: len(episode), k]
                action[:, k] -= turn * np.round(apart / turn)  # a command means the nearest of all turns
        made.append(replace(episode, position=position, action=action, velocity=velocity))
    return made


def mend_signals(episodes: Sequence[Trajectory]) -> list[Trajectory]:
    """Return trajectories without the wraps and the one-sample glitches that `check_signals` reports."""
    return [
        replace(episode, position=mend(episode.position), action=mend(episode.action))
        for episode in join_turns(episodes)
    ]
