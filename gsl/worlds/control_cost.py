"""Control cost: what a reward charges for an action, which is the agent's, never the one a grounding made of it.

MuJoCo's environments tell it in `info["reward_ctrl"]`, or `reward_quadctrl`, as -w |u|², u in the actuators' own units;
from one step w is known, and so what another action would have cost. Others can name a function; for the rest nothing
can be corrected.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Protocol, runtime_checkable

import numpy as np

from gsl.core.setting import component, setting
from gsl.errors import GslError

KEYS = ("reward_ctrl", "reward_quadctrl")
FREE = ("InvertedPendulumEnv", "InvertedDoublePendulumEnv")  # of gymnasium: charge nothing, and say nothing
SMALL = 1e-6  # share of a full action's square, below which a step tells no price
SAME = 0.01  # relative difference of two steps' prices that are one


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
    """Takes the price of a transformed or noisy action out of rewards, and puts that of the agent's action in.

    Args:
        given: What an action costs, none for what the environment's info tells.
        low: Ends of the actuators' ranges, shape (n_actions,).
        high: The other ends.
    """

    def __init__(self, cost: ControlCost | None, low: np.ndarray, high: np.ndarray) -> None:
        self._cost, self._weight = cost, np.nan
        self._middle, self._half = (high + low) / 2.0, (high - low) / 2.0

    def correct(self, reward: float, agent: np.ndarray, charged: np.ndarray, info: Mapping[str, Any]) -> float:
        """Return the reward with the agent's action charged.

        Args:
            reward: With the price of `charged` in it.
            agent: The agent's action, shape (n_actions,).
            charged: Another one, shape (n_actions,).
            info: Of the environment's step, with what was carried out.

        Raises:
            GslError: The environment tells a price that is no number, or not -w |u|² with one w of 0 or more.
        """
        out, into = np.clip(charged, -1.0, 1.0), np.clip(agent, -1.0, 1.0)
        if self._cost is not None:
            return reward + self._cost.cost(out) - self._cost.cost(into)
        return reward + self._weight_in(info) * (self._squares(out) - self._squares(into))

    def _weight_in(self, info: Mapping[str, Any]) -> float:
        """Return w, as far as it is known."""
        key = next((key for key in KEYS if key in info), None)
        if key is None:
            return 0.0
        squares = self._squares(info["carried_out"])
        if squares > SMALL * self._squares(np.ones_like(self._half)):
            price: Any = info[key]
            weight = -float(price) / squares if isinstance(price, (float, int, np.number)) else np.nan
            if not 0.0 <= weight < np.inf or abs(weight - self._weight) > SAME * max(weight, self._weight):
                problem = f"the environment's info['{key}'] is no -w |u|² of its action u"
                raise GslError(f"{problem}; say what an action costs by control_cost=, weight 0 for nothing")
            self._weight = weight
        return 0.0 if np.isnan(self._weight) else self._weight

    def _squares(self, action: np.ndarray) -> float:
        return float(np.square(self._middle + self._half * action).sum())
