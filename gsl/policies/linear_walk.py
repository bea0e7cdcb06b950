"""A linear walk (the paper's section 6.3): left joints follow gyroscope and a sine wave, right ones their reflection.

    left = w . (gyro_x, gyro_y, sin(c t)) + b,    right = b - w . (gyro_x, gyro_y, sin(c t))

with the right joints' angles in the mirror, and psi clamped to b as in the paper: 8 joints, 33 parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import numpy as np

from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError

INPUTS = ("gyro_x", "gyro_y", "sine")
SCALES = np.array([0.03, 0.03, 0.1])  # of the weights: [rad] per [rad/s], twice, and [rad]
OFFSET_SCALE, FREQUENCY_SCALE = 0.05, 2.0  # [rad], [rad/s]


@component
class LinearWalk:
    """Stepping in place, with feet that hardly leave the ground, from which a search has to find a walk."""

    pairs: Annotated[
        Mapping[str, tuple[str, float] | None],
        setting("left joints, each with its right one and the sign of the mirror; none for a joint of both sides"),
    ]
    stance: Annotated[Mapping[str, float], setting("offsets of the left joints of π0; others are 0", unit="rad")]
    stepping: Annotated[Mapping[str, float], setting("sine weights of the left joints of π0; others are 0", unit="rad")]
    frequency: Annotated[float, setting("of the sine wave of π0", unit="rad/s", gt=0)] = 12.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order: weights joint by joint, offsets, frequency."""
        weights = [f"{joint}_from_{source}" for joint in self.pairs for source in INPUTS]
        return (*weights, *(f"{joint}_offset" for joint in self.pairs), "frequency")

    @property
    def initial(self) -> np.ndarray:
        """The parameters of π0."""
        weights = [(0.0, 0.0, self.stepping.get(joint, 0.0)) for joint in self.pairs]
        return np.r_[np.ravel(weights), [self.stance.get(joint, 0.0) for joint in self.pairs], self.frequency]

    @property
    def scale(self) -> np.ndarray:
        """Size of a step in each parameter that is as bold as in any other."""
        n = len(self.pairs)
        return np.r_[np.tile(SCALES, n), np.full(n, OFFSET_SCALE), FREQUENCY_SCALE]

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return where an episode starts, at the offsets [rad], shape (n_joints,).

        Raises:
            ConfigError: if the world has no joint of a name.
        """
        return self.start(parameters, layout).rest

    def start(self, parameters: np.ndarray, layout: Layout) -> LinearWalkRun:
        """Return the policy at the beginning of an episode.

        Raises:
            ConfigError: if the world has no joint of a name.
        """
        for joint in (*self.pairs, *(right for pair in self.pairs.values() if pair for right in pair[:1])):
            if joint not in layout.joints:
                raise ConfigError(
                    "policy.pairs", f"no joint called '{joint}'{did_you_mean(joint, layout.joints, listed=True)}"
                )
        return LinearWalkRun(self, np.asarray(parameters, dtype=float), layout)


class LinearWalkRun:
    """The linear walk in one episode."""

    def __init__(self, policy: LinearWalk, parameters: np.ndarray, layout: Layout) -> None:
        n, pairs = len(policy.pairs), list(policy.pairs.items())
        weights, offsets = parameters[: 3 * n].reshape(n, 3), parameters[3 * n : 4 * n]
        self._frequency, self._period, self._gyro = parameters[-1], layout.control_period, layout["gyro"].start
        self._weights, self.rest = np.zeros((len(layout.joints), 3)), np.zeros(len(layout.joints))
        for row, (left, pair) in enumerate(pairs):
            sides = [(left, 1.0, 1.0), *([(pair[0], pair[1], -pair[1])] if pair else [])]
            for joint, mirror, swing in sides:
                index = layout.joints.index(joint)
                self.rest[index], self._weights[index] = mirror * offsets[row], swing * weights[row]
        self._time = 0.0

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return desired joint positions [rad], shape (n_joints,)."""
        sine = np.sin(self._frequency * self._time)
        self._time += self._period
        action: np.ndarray = self.rest + self._weights @ np.array([*observation[self._gyro : self._gyro + 2], sine])
        return action
