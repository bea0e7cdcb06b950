"""Control cost: what a reward charges for an action, which is the agent's, never the one a grounding made of it.

MuJoCo's environments tell it in `info["reward_ctrl"]` as -w |u|², u in the actuators' own units; from one step w is
known, and so what the agent's own action would have cost. Others can name a function; for the rest nothing can be
corrected.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Protocol, runtime_checkable

import numpy as np

from gsl.core.setting import component, setting

KEY = "reward_ctrl"


@runtime_checkable
class ControlCost(Protocol):
    """What an action costs."""

    def cost(self, action: np.ndarray) -> float:
        """Return what the reward lacks because of an action, shape (n_actions,), from -1 to 1."""


@component
class Quadratic:
    """weight · |a|²."""

    weight: Annotated[float, setting("price of a full action of one actuator", ge=0)]

    def cost(self, action: np.ndarray) -> float:
        """Return the cost."""
        return self.weight * float(np.square(action).sum())


class Charged:
    """Takes the price of a transformed action out of rewards, and puts that of the agent's action in.

    Args:
        given: What an action costs, none for what the environment's info tells.
        low: Ends of the actuators' ranges, shape (n_actions,).
        high: The other ends.
    """

    def __init__(self, given: ControlCost | None, low: np.ndarray, high: np.ndarray) -> None:
        self._cost, self._weight = given, 0.0
        self._middle, self._half = (high + low) / 2.0, (high - low) / 2.0

    def corrected(self, reward: float, agent: np.ndarray, info: Mapping[str, Any]) -> float:
        """Return the reward with the agent's action charged.

        Args:
            reward: Of the environment.
            agent: The agent's action, shape (n_actions,).
            info: Of the environment's step, with what was carried out.
        """
        sent, meant = info["carried_out"], np.clip(agent, -1.0, 1.0)
        if self._cost is not None:
            return reward + self._cost.cost(sent) - self._cost.cost(meant)
        if KEY not in info:
            return reward
        squares = self._squares(sent)
        if squares > 0.0:
            self._weight = max(0.0, -float(info[KEY]) / squares)
        return reward + self._weight * (squares - self._squares(meant))

    def _squares(self, action: np.ndarray) -> float:
        return float(np.square(self._middle + self._half * action).sum())
