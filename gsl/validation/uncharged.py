"""A warning: nobody knows what a reward charges for an action, so that what is carried out is charged for."""

from __future__ import annotations

from typing import Any

import numpy as np

from gsl.core.console import Console
from gsl.worlds.control_cost import FREE, KEYS

_PRICE = "'{_target_: gsl.worlds.control_cost.Quadratic, weight: 0.1}'"


def is_uncharged(world: Any) -> bool:
    """Whether nobody knows what a world's reward charges for an action, so that a grounded or noisy one is charged."""
    if not world.layout.states or world.layout.choices or getattr(world, "control_cost", None) is not None:
        return False
    env = world.make()
    inside = type(env.unwrapped_env)
    env.reset(seed=0)
    info = env.step(np.zeros(len(world.layout.joints)))[-1]
    env.close()
    free = inside.__name__ in FREE and inside.__module__.startswith("gymnasium.")
    return not free and not any(key in info for key in KEYS)


def warn_uncharged(world: Any, console: Console, role: str, what: str) -> None:
    """Warn where the reward of a world that plays `role` may charge for `what` instead of the agent's action."""
    if is_uncharged(world):
        advice = f"{role}.control_cost={_PRICE} says what it charges, weight: 0 that it does not"
        alone = "world.control_cost in a command of one world"
        console.status(f"warning: the reward may charge for {what} instead of the agent's action; {advice} ({alone})")
