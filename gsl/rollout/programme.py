"""What a stage plays for a policy with a programme: its own menu, or the command file that it names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from gsl.core.interfaces import Policy
from gsl.core.layout import Layout
from gsl.errors import ArtifactError
from gsl.policies.excitation import Excitation
from gsl.policies.programme import Playback
from gsl.robots.catalogue import robot
from gsl.storage.commands import read_commands
from gsl.storage.references import resolve


def command_file(policy: Policy) -> Mapping[str, Path]:
    """Return the command file that is played, if there is one, by the dotted name of its setting."""
    named = policy.file if isinstance(policy, Excitation) else None
    return {} if named is None else {"policy.file": resolve(named)}


def playing(policy: Policy, layout: Layout) -> Policy:
    """Return what acts in place of a policy that names a command file; any other policy acts itself.

    Raises:
        ConfigError: An excitation is for another robot than the world's.
        ArtifactError: The file is for another robot or control rate, or asks for what the robot's limits do not allow.
    """
    if not isinstance(policy, Excitation):
        return policy
    policy.posture(policy.initial, layout)
    for path in command_file(policy).values():
        commands = read_commands(path, robot(policy.robot))
        if abs(commands.control_period - layout.control_period) > 1e-9:
            ours, theirs = (f"{period:g} s" for period in (layout.control_period, commands.control_period))
            raise ArtifactError(path, f"control_period is {theirs}, but the world's is {ours}; say world.period=...")
        names, actions = zip(*commands.episodes, strict=True)
        return Playback(names, actions)
    return policy
