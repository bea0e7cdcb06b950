"""A linear policy on the positions of a few joints now and one step ago (the paper's section 6.2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import numpy as np

from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError

WEIGHT_SCALE = 0.2


@component
class Linear:
    """a_t = W (x_t, x_{t-1}) + b for the named joints; the others stay where they start.

    With two joints W is (2, 4) and b (2,): ten parameters. π0 has W = 0 and b at the start posture: it does not move.
    """

    start_at: Annotated[Mapping[str, float], setting("start posture; what is not named is at 0", unit="rad")]
    joints: Annotated[tuple[str, ...], setting("joints the policy moves")] = ("LShoulderPitch", "RShoulderPitch")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        inputs = [f"{joint}{when}" for when in ("_now", "_before") for joint in self.joints]
        weights = [f"{joint}_from_{source}" for joint in self.joints for source in inputs]
        return (*weights, *(f"{joint}_offset" for joint in self.joints))

    @property
    def initial(self) -> np.ndarray:
        """The parameters of π0."""
        offsets = [self.start_at.get(joint, 0.0) for joint in self.joints]
        return np.r_[np.zeros(len(self.names) - len(offsets)), offsets]

    @property
    def scale(self) -> np.ndarray:
        """Size of a step in each parameter that is as bold as in any other: weights act on angles of 1 to 2 rad."""
        return np.array([1.0 if name.endswith("_offset") else WEIGHT_SCALE for name in self.names])

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return where an episode starts [rad], shape (n_joints,).

        Raises:
            ConfigError: if the world has no joint of a name.
        """
        for joint in (*self.joints, *self.start_at):
            if joint not in layout.joints:
                raise ConfigError(
                    "policy", f"no joint called '{joint}'{did_you_mean(joint, layout.joints, listed=True)}"
                )
        return np.array([self.start_at.get(joint, 0.0) for joint in layout.joints])

    def start(self, parameters: np.ndarray, layout: Layout) -> LinearRun:
        """Return the policy at the beginning of an episode."""
        return LinearRun(self, np.asarray(parameters, dtype=float), layout)


class LinearRun:
    """A linear policy in one episode."""

    def __init__(self, policy: Linear, parameters: np.ndarray, layout: Layout) -> None:
        n = len(policy.joints)
        self._weights, self._offset = parameters[: 2 * n * n].reshape(n, 2 * n), parameters[2 * n * n :]
        self._moved = [layout.joints.index(joint) for joint in policy.joints]
        self._positions = layout["position"]
        self._rest = policy.posture(parameters, layout)
        self._before: np.ndarray | None = None

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return desired joint positions [rad], shape (n_joints,)."""
        now = observation[self._positions][self._moved]
        before = now if self._before is None else self._before
        self._before = now
        action = self._rest.copy()
        action[self._moved] = self._weights @ np.r_[now, before] + self._offset
        return action
