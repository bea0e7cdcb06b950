"""What a chain lets a grounding learn from: trajectories of both worlds, collected below its place, and the models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from gsl.core.console import Console
from gsl.core.interfaces import REAL, SIM, Grounding, Trainable
from gsl.grounding.gat import ActionTransformation
from gsl.stages.chain import Links
from gsl.stages.collect import Collect
from gsl.stages.link import build_link
from gsl.stages.train_forward import TrainForward
from gsl.stages.train_grounding import TrainGrounding
from gsl.stages.train_inverse import TrainInverse
from gsl.training.inverse import Method
from gsl.validation.model_requirements import as_needed, extra_ticks, looking_ahead
from gsl.worlds.external import asking


def train_own(
    chain: Links, home: Path, grounding: Trainable, previous: str | None, seed: int, console: Console
) -> Grounding:
    """Collect what a grounding needs, let it learn below `home`, and return it with its model."""
    data = collect(chain, home, previous, seed, console, roles=grounding.needs)
    real, sim = (str(data[role]) if role in data else None for role in (REAL, SIM))
    stage = TrainGrounding(grounding, real, sim, seed=seed, earlier=chain.earlier if real else ())
    made = build_link(stage, home / stage.kind, console)
    settings: Any = grounding  # a frozen dataclass, as every component
    trained: Grounding = replace(settings, model=str(made.folder))
    return trained


def collect(
    chain: Links, home: Path, previous: str | None, seed: int, console: Console, *, roles: Sequence[str] = (REAL, SIM)
) -> dict[str, Path]:
    """Collect trajectories of a policy and its neighbours, below `home` or where they are shared, by role."""
    budget, data = chain.budget, dict[str, Path]()
    counts: dict[Literal["real", "sim"], tuple[int, int]] = {REAL: budget.real, SIM: budget.sim}
    for role, (episodes, neighbours) in counts.items():
        if role not in roles:
            continue
        data[role] = chain.shared.get(role, home) / f"collect_{role}"
        stage = Collect(
            world=asking(chain.real, data[role]) if role == REAL else chain.sim,
            task=chain.task,
            policy=chain.policy,
            role=role,
            episodes=episodes,
            neighbours=neighbours,
            spread=budget.spread,
            action_noise=budget.real_action_noise if role == REAL else budget.sim_action_noise,
            initial=previous,
            workers=chain.workers,
            seed=seed,
        )
        build_link(stage, data[role], console)
    return data


def train_transformation(
    chain: Links, home: Path, grounding: ActionTransformation, previous: str | None, seed: int, console: Console
) -> ActionTransformation:
    """Collect in both worlds, train both models below `home`, and return the grounding that they make."""
    data = collect(chain, home, previous, seed, console)
    method: Method = "solve" if grounding.residual else chain.inverse_method
    extra = extra_ticks(chain.sim)
    inverse_model = looking_ahead(chain.inverse_model, extra)
    needed, base = as_needed(chain.forward_model, grounding), None
    if extra:
        without = ", and f is not fitted to its own answers" if needed.multi_step > 1 else ""
        looking = f"models look {inverse_model.horizon} ticks ahead{without}"
        console.status(f"actions show late in the simulator: {looking}")
    inverse = TrainInverse(str(data[SIM]), inverse_model, method=method, seed=seed)
    alike = method == chain.inverse_method
    f_inverse = build_link(inverse, (data[SIM].parent if alike else home) / inverse.kind, console)
    needed = looking_ahead(needed, extra)
    if grounding.residual:
        needed = replace(needed, history=f_inverse.metrics["history"], horizon=inverse_model.horizon)
        base = str(f_inverse.folder)
    forward = TrainForward(str(data[REAL]), needed, base, seed=seed, earlier=chain.earlier)
    f = build_link(forward, home / forward.kind, console)
    return replace(grounding, forward_model=str(f.folder), inverse_model=str(f_inverse.folder))
