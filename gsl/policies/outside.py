"""A policy that gsl did not make: a network of some format with its wiring. A format derives from `Outside`.

Its parameters are an offset of each action, 0 in π0. A network of any format has them: they shift the bias of its last
layer by scale · bias, and mean a trim of a joint [rad], or of an environment's action in halves of its range. So every
such policy has neighbours that a grounding can learn from, and a search can trim it without its weights. Where
actions are choices there are none. A format whose weights can be changed has these as parameters instead (sb3.py).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Protocol, Self

import numpy as np

from gsl.core.budget import NETWORK_BYTES, check_file
from gsl.core.console import Console
from gsl.core.interfaces import Policy
from gsl.core.layout import Layout
from gsl.core.setting import setting
from gsl.errors import ConfigError
from gsl.policies.wired import Answer, WiredRun
from gsl.policies.wiring import Wiring
from gsl.policies.wiring_audit import audit

OFFSET = 0.25  # scale of an offset: a quarter of a radian, or of half a range, is bold for a trained policy

File = Annotated[str, setting("of the network", min_length=1)]
Joints = Annotated[tuple[str, ...], setting("of its actions; by default the world's")]


class Ports(NamedTuple):
    """How many numbers a network takes and returns, None where it does not say; its outputs' ends, if it has some."""

    inputs: int | None
    outputs: int | None
    ends: tuple[np.ndarray, np.ndarray] | None = None


class Network(Protocol):
    """A network that was read from a file."""

    @property
    def ports(self) -> Ports:
        """What it takes and returns."""

    def begin(self) -> Answer:
        """Return it at the beginning of an episode: a memory is empty."""


class Outside(ABC):
    """What policies of all formats have in common."""

    wiring: Wiring
    joints: tuple[str, ...]

    @property
    @abstractmethod
    def name(self) -> str:
        """What errors call the network."""

    @abstractmethod
    def network(self) -> Network:
        """Read the network, once a process.

        Raises:
            ConfigError: It is not there, or cannot be read.
        """

    def size_for(self, layout: Layout) -> Self:
        """Return the policy for a world, its wiring audited.

        Raises:
            ConfigError: The wiring does not fit the world or the network.
        """
        for finding in audit(self.wiring, self.network().ports, layout):
            finding.insist()
        return replace(self, joints=() if layout.choices else layout.joints)  # type: ignore[type-var]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return tuple(f"offset.{joint}" for joint in self.joints)

    @property
    def initial(self) -> np.ndarray:
        """The parameters of π0."""
        return np.zeros(len(self.joints))

    @property
    def scale(self) -> np.ndarray:
        """Size of a step in each parameter that is as bold as in any other."""
        return np.full(len(self.joints), OFFSET)

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return the default pose [rad], shape (n_joints,); nothing for an environment, which has its own start."""
        return np.zeros(0) if layout.states else self.wiring.stance(layout)

    def start(self, parameters: np.ndarray, layout: Layout) -> WiredRun:
        """Return the policy at the beginning of an episode."""
        offset = np.asarray(parameters, dtype=float)
        return WiredRun(self.wiring, layout, self.network().begin(), offset if offset.any() else None, self.name)


def warn_of_wiring(policy: Policy, layout: Layout, console: Console) -> None:
    """Say what looks wrong in the wiring of a policy that gsl did not make, and may be meant."""
    if isinstance(policy, Outside):
        for finding in audit(policy.wiring, policy.network().ports, layout):
            if finding.setting:
                console.status(f"warning: {finding.setting}: {finding.line}")


class OutsideFile(Outside):
    """What policies have in common that are read from a file."""

    file: str

    @property
    def name(self) -> str:
        """What errors call the network."""
        return self.file

    @property
    def read_files(self) -> Mapping[str, Path]:
        """What it is read from, by the setting that names each."""
        return {"file": Path(self.file)}


def policy_file(name: str) -> Path:
    """Return the file of a network.

    Raises:
        ConfigError: There is none.
        InputError: It is too large.
    """
    path = Path(name)
    if not path.is_file():
        raise ConfigError("policy.file", "is no file; name the network's file as seen from here", given=name)
    check_file(path, NETWORK_BYTES)
    return path


def read_once(reader: Any, name: str) -> Any:
    """Return what a reader makes of a file, read once a process and again after a change of it."""
    path = policy_file(name)
    return _read(reader, path, (path.resolve(), path.stat().st_mtime_ns))


@lru_cache(maxsize=4)
def _read(reader: Any, path: Path, which: tuple[Path, int]) -> Any:
    return reader(path)
