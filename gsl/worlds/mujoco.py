"""MuJoCo's environments: heavier and lighter bodies, which the paper's section 8.2 calls real; remarks on models."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError

ALL = "all"
_log = logging.getLogger("gsl")


@contextmanager
def without_remarks() -> Iterator[None]:
    """Have MuJoCo's remarks on a model that is loaded in the log, not on the terminal and in a file of its own.

    Those of gymnasium's own models are nothing that a user could mend. Without MuJoCo in the process it does nothing.
    """
    mujoco = sys.modules.get("mujoco")
    if mujoco is None:
        yield
        return
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda remark: _log.info("MuJoCo: %s", remark))
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def change_masses(env: Any, factors: Mapping[str, float]) -> None:
    """Multiply masses, and inertias with them.

    Args:
        env: A gymnasium environment of MuJoCo's.
        factors: By name of the body, or of `all`.

    Raises:
        ConfigError: It is no MuJoCo environment, has no such body, or a factor is not above 0.
    """
    inside = env.unwrapped
    if not (hasattr(inside, "model") and hasattr(inside.model, "body_mass")):
        raise ConfigError("mass", "is for MuJoCo environments; this one has no model.body_mass")
    import mujoco

    model = inside.model
    bodies = {model.body(index).name: index for index in range(1, model.nbody)}
    named = [name for name in bodies if name]
    for name, factor in factors.items():
        if name != ALL and name not in named:
            raise ConfigError(f"mass.{name}", f"there is no such body{did_you_mean(name, named, listed=True)}")
        if not factor > 0.0:
            raise ConfigError(f"mass.{name}", "must be above 0", given=f"{factor}")
        which = slice(1, None) if name == ALL else bodies[name]
        model.body_mass[which] *= factor
        model.body_inertia[which] *= factor
    mujoco.mj_setConst(model, inside.data)
