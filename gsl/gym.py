"""gsl's worlds as gymnasium ids: `gymnasium.make("gsl.gym:gsl/nao_worn-v0")`, or `import gsl.gym` before `make`.

An id is a world's yaml file; keywords are its settings. The reward is the world's own. A robot has none, so that it is
0: a task (`gsl.make_task`) judges the steps.
"""

from __future__ import annotations

from typing import Any

import gymnasium

from gsl.api import make_world
from gsl.core.configuration import list_worlds

NAMESPACE = "gsl"
LEFT_OUT = ("robot", "urdf", "learned", "gymnasium")  # need something named before they are a world


def make(name: str, **settings: Any) -> gymnasium.Env:
    """Return the environment of a world; arguments as those of `gsl.make_world`."""
    return make_world(name, **settings).make()


def register() -> list[str]:
    """Register every world of ours, and return the ids."""
    names = sorted(list_worlds() - set(LEFT_OUT))
    for name in names:
        gymnasium.register(
            f"{NAMESPACE}/{name}-v0", entry_point="gsl.gym:make", kwargs={"name": name}, disable_env_checker=True
        )
    return [f"{NAMESPACE}/{name}-v0" for name in names]


register()
