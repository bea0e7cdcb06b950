"""What the links of a chain have in common: worlds, task, policy, models, optimiser, and numbers of episodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from gsl.core.interfaces import (
    Learner,
    Policy,
    Search,
    Task,
    World,
)
from gsl.core.setting import component, setting
from gsl.models.config import ModelConfig
from gsl.optimizers.objective import Objective, Quantile
from gsl.stages.diagnosis_plan import DiagnosisPlan
from gsl.stages.evaluate import check_tolerated
from gsl.validation.screening import Screening


@component
class Budget:
    """How many episodes each part of an iteration gets."""

    real_episodes: Annotated[int, setting("real episodes of the policy, for the forward model", ge=1)]
    real_neighbours: Annotated[int, setting("real episodes of perturbed policies", ge=0)]
    sim_episodes: Annotated[int, setting("simulated episodes of the policy, for the inverse model", ge=1)]
    sim_neighbours: Annotated[int, setting("simulated episodes of perturbed policies", ge=0)]
    spread: Annotated[float, setting("size of the perturbations, in units of a parameter's scale", ge=0)]
    sim_action_noise: Annotated[float, setting("noise on simulated actions", unit="rad", ge=0)]
    real_action_noise: Annotated[float, setting("noise on real actions of neighbours and π0", unit="rad", ge=0)]
    rollouts: Annotated[int, setting("simulated episodes of each candidate", ge=1)]
    episodes: Annotated[int, setting("real episodes of each generation's best", ge=1)]
    check: Annotated[int, setting("real episodes the fastest stable policy has to walk without a fall", ge=1)]
    confirmation: Annotated[int, setting("fresh real episodes of the chosen policy", ge=2)]
    tolerated: Annotated[float, setting("share of falls up to which a policy counts as stable", ge=0, le=1)] = 0.0
    screening: Screening = 0

    def __post_init__(self) -> None:
        """Refuse a single episode as the check of a policy that may fall."""
        check_tolerated(self.tolerated, self.check)

    @property
    def screening_episodes(self) -> int:
        """Simulated episodes of a winner before the robot tries it; none where falls are tolerated."""
        return 0 if self.tolerated else self.screening

    @property
    def real(self) -> tuple[int, int]:
        """Real episodes of the policy and of its neighbours that models learn from."""
        return self.real_episodes, self.real_neighbours

    @property
    def in_words(self) -> str:
        """The same in words."""
        return f"{self.real_episodes} real episodes of a policy and {self.real_neighbours} around it to learn from"

    @property
    def sim(self) -> tuple[int, int]:
        """The same of the simulator."""
        return self.sim_episodes, self.sim_neighbours


@dataclass(frozen=True)
class Links:
    """What the links of a round have in common."""

    sim: World
    real: World
    task: Task
    policy: Policy
    forward_model: ModelConfig
    inverse_model: ModelConfig
    inverse_method: Literal["regression", "solve"]
    optimizer: Search | Learner
    budget: Budget
    diagnosis: DiagnosisPlan
    accept: bool
    workers: int
    aggregate: bool
    earlier: tuple[str, ...] = ()  # real trajectories from which f learns as well
    objective: Objective = "mean"
    quantile: Quantile = 0.25
    shared: Mapping[str, Path] = field(default_factory=dict)  # by role, where groundings keep what they have in common
