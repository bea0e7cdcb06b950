"""gsl: grounded simulation learning, from a few real trajectories to a policy that works on the robot.

What `gsl.NAME` offers from Python stands in gsl/api.py; it is loaded when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gsl.version import __version__ as __version__

if TYPE_CHECKING:
    from gsl.api import (
        Result,
        Verdict,
        diagnose,
        grounded_env,
        make_grounding,
        make_policy,
        make_task,
        make_world,
        read_trajectories,
        roll_out,
        run,
        write_trajectories,
    )

__all__ = [
    "Result",
    "Verdict",
    "diagnose",
    "grounded_env",
    "make_grounding",
    "make_policy",
    "make_task",
    "make_world",
    "read_trajectories",
    "roll_out",
    "run",
    "write_trajectories",
]


def __getattr__(name: str) -> Any:
    """Load the interface for Python when one of its names is used."""
    if name not in __all__:
        raise AttributeError(f"module 'gsl' has no attribute {name!r}")
    from gsl import api

    return getattr(api, name)


def __dir__() -> list[str]:
    """Name what there is, for completion."""
    return [*globals(), *__all__]
