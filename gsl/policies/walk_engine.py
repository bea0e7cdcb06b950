"""A walk engine in the manner of UNSW's Walk2014 (Hengst 2014): two inverted pendulums, stepped by foot pressure.

Coronal: lifting the feet in turn makes the body rock by itself. Sagittal: the stance foot moves back under the hip at
constant speed, the swing foot returns. A new step begins when the centre of pressure changes sides. Written from a
description of the method; parameters and start values are those of the paper's Table 1.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.policies import gait

TABLE_1 = {
    "com_offset": 0.01,  # ankles behind the hips [m]
    "base_walk_period": 0.23,  # of one step [s]
    "walk_hip_height": 0.23,  # [m]
    "max_forward": 0.3,  # [m/s]
    "max_left": 0.2,  # [m/s]
    "max_turn": 0.87,  # [rad/s]
    "max_forward_change": 0.15,  # a step [m/s]
    "max_left_change": 0.2,  # a step [m/s]
    "max_turn_change": 0.8,  # a step [rad/s]
    "base_leg_lift": 0.012,  # [m]
    "arm_swing": 6.0,  # shoulder pitch per foot offset [rad/m]
    "pendulum_height": 300.0,  # [mm], inert
    "forward_extra_foot_height": 0.01,  # lift per stride
    "left_extra_foot_height": 0.02,  # lift per stride
    "start_lift_divisor": 3.5,
}


@component
class WalkEngine:
    """The walk engine with what it is asked to do; a request beyond a `max_...` parameter is clipped to it."""

    forward: Annotated[float, setting("forward speed asked for", unit="m/s")] = 1.0
    left: Annotated[float, setting("sideways speed asked for, left positive", unit="m/s")] = 0.0
    turn: Annotated[float, setting("turning speed asked for, left positive", unit="rad/s")] = 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return tuple(TABLE_1)

    @property
    def initial(self) -> np.ndarray:
        """The parameters of π0, shape (15,)."""
        return np.array(list(TABLE_1.values()))

    @property
    def scale(self) -> np.ndarray:
        """Size of a step in each parameter that is as bold as in any other, shape (15,)."""
        return np.abs(self.initial)

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return where an episode starts: crouched, feet under the hips [rad], shape (15,)."""
        return gait.crouch(parameters)

    def start(self, parameters: np.ndarray, layout: Layout) -> WalkEngineRun:
        """Return the engine at the beginning of an episode."""
        return WalkEngineRun(self, np.asarray(parameters, dtype=float), layout)


class WalkEngineRun:
    """The walk engine in one episode."""

    def __init__(self, engine: WalkEngine, parameters: np.ndarray, layout: Layout) -> None:
        self._values, self._period = parameters, layout.control_period
        self._request = np.array([engine.forward, engine.left, engine.turn])
        self._pitch_rate, self._feet = layout["gyro"].start + 1, layout["foot_force"]
        self._state, self._sensed = gait.first_state(), np.zeros(3)

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return desired joint positions [rad], shape (15,)."""
        self._sensed[0], self._sensed[1:] = observation[self._pitch_rate], observation[self._feet]
        return gait.step(self._values, self._state, self._request, self._sensed, self._period)
