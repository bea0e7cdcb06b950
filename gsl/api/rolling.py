"""Trajectories of a policy in a world, without an artifact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np

from gsl.api.components import make_policy, make_task
from gsl.core.console import Silent
from gsl.core.described import describe
from gsl.core.interfaces import Grounding, Policy, Task, World
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch
from gsl.core.validation import make
from gsl.effects.effect import keep_own
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.policies.policy import size
from gsl.rollout.parallel import Job, Workers, trajectories
from gsl.rollout.rollout import Scenario
from gsl.worlds.slides import list_slides

PI0 = "pi0"


@component
class _Rolling:
    """How trajectories are rolled out."""

    episodes: Annotated[int, setting("how many", ge=1)]
    role: Annotated[Literal["sim", "real"], setting("part that the world plays")]
    workers: Workers
    seed: Annotated[int, setting("of all randomness", ge=0)]


@keep_own()
def roll_out(
    world: World,
    task: Task | None = None,
    policy: Policy | None = None,
    parameters: Sequence[float] | None = None,
    *,
    grounding: Grounding | None = None,
    episodes: int = 1,
    role: str = "sim",
    workers: int = 1,
    seed: int = 1,
) -> Batch:
    """Return trajectories of a policy in a world.

    Args:
        world: From `make_world`.
        task: By default the walk.
        policy: By default the walk engine.
        parameters: Of the policy, shape (n_parameters,); by default π0's.
        grounding: What stands between the actions and the world; by default nothing.
        episodes: How many.
        role: `sim` or `real`, the part that the world plays.
        workers: Processes; -1 for one a core.
        seed: Of all randomness.

    Raises:
        ConfigError: An argument is of another kind than it has to be.
    """
    how = make(_Rolling, {"episodes": episodes, "role": role, "workers": workers, "seed": seed})
    task, family = task or make_task("walk"), policy or make_policy("walk_engine")
    grounding = grounding or NoGrounding()
    for argument, kind in ((world, World), (task, Task), (family, Policy), (grounding, Grounding)):
        if isinstance(argument, type) or not isinstance(argument, kind):
            name = kind.__name__.lower()
            raise ConfigError(name, f"is no {name}; gsl.make_{name} makes one", given=str(argument))
    family = size(family, world)
    chosen = family.initial if parameters is None else _numbers(parameters, family)
    scenario = Scenario(world, task, family, how.role, grounding).prepare()
    jobs = [Job(chosen, derive_seed(how.seed, "rollout", k)) for k in range(how.episodes)]
    with Silent().progress(how.episodes, "rolling out") as progress:
        done = trajectories(scenario, jobs, workers=how.workers, progress=progress)
    layout, label = world.layout, PI0 if parameters is None else "given"
    about = {
        "robot": getattr(world, "robot", getattr(world, "env_id", "")),
        "role": how.role,
        "source": "gsl.roll_out",
        "seed": how.seed,
        "world": describe(world),
        "policy": describe(family),
        "grounding": f"{type(grounding).__module__}.{type(grounding).__qualname__}",
        "action_noise": 0.0,
        **({"slides": slides} if (slides := list_slides(world)) else {}),
        **({"cells": layout.cells, "choices": layout.choices} if layout.states else {}),
        "episodes": [{"policy": label, "parameters": chosen.tolist()} for _ in jobs],
    }
    return Batch(tuple(done), layout.joints, layout.control_period, about)


def _numbers(parameters: Any, policy: Policy) -> np.ndarray:
    count = len(policy.initial)
    try:
        numbers = np.asarray(parameters, dtype=float)
    except (TypeError, ValueError) as error:
        raise ConfigError("parameters", f"are {count} numbers", given=str(parameters)) from error
    if numbers.shape != (count,):
        raise ConfigError("parameters", f"are {count} numbers", given=f"shape {numbers.shape}")
    return numbers
