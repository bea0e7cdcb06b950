"""One round of grounded simulation learning as links: collect and train, search, measure; each an artifact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from gsl.core.console import Console
from gsl.core.interfaces import (
    REAL,
    SIM,
    Grounding,
    Preparable,
    Trainable,
)
from gsl.core.words import several
from gsl.errors import ConfigError
from gsl.grounding.diagnosis_file import read_diagnosis
from gsl.grounding.effects import DiagnosedEffects, evidence_of, innermost, switch_on, with_innermost
from gsl.grounding.gat import ActionTransformation, check_coverage
from gsl.grounding.none import NoGrounding
from gsl.grounding.preparation import check_own
from gsl.grounding.servo import LearnedServo
from gsl.stages.chain import Links
from gsl.stages.chain_training import train_own, train_transformation
from gsl.stages.evaluate import Evaluate
from gsl.stages.link import build_link
from gsl.stages.optimize import BEST, Optimize
from gsl.stages.values import Values
from gsl.storage.artifact import Artifact
from gsl.training.data import FEWEST, WHY
from gsl.training.states import refuse_robots
from gsl.validation.model_requirements import as_needed
from gsl.worlds.external import asking


class Round(NamedTuple):
    """What a round has made: the grounding with its models, the policies a search left, their measurement in real."""

    ready: Grounding
    policies: Artifact
    measured: Artifact


@dataclass(frozen=True)
class Chain(Links):
    """The links of a round."""

    def after(self, place: Path) -> Chain:
        """Return the links of the round after the one below `place`, which keep its real trajectories if so wanted."""
        data = self.shared.get(REAL, place) / "collect_real"
        return replace(self, earlier=(*self.earlier, str(data))) if self.aggregate else self

    def check(self, grounding: Grounding) -> None:
        """Refuse what could not be trained, before anything is asked of the real robot.

        Raises:
            ConfigError: Effects of a world that has none, models that cannot be, or too few episodes.
        """
        if isinstance(grounding, Preparable):
            grounding.check(self.sim)
        inner = innermost(grounding)
        if isinstance(inner, ActionTransformation):
            self._check_joints(inner)
            self._check_models(inner)
        if isinstance(inner, Trainable):
            check_own(inner)
        for role, count in {REAL: sum(self.budget.real), SIM: sum(self.budget.sim)}.items():
            if role in evidence_of(grounding) and count < FEWEST:
                problem = f"{several(count, 'episode')} with neighbours; {FEWEST} are the least for a model: {WHY}"
                raise ConfigError(f"budget.{role}_episodes", problem)

    def _check_models(self, grounding: ActionTransformation) -> None:
        """Refuse models that there cannot be."""
        states = self.sim.layout.states
        if states and grounding.residual:
            raise ConfigError("grounding.residual", "is for robots; f of an environment's states corrects nothing")
        if states and grounding.multi_step > 1:
            raise ConfigError("grounding.multi_step", "is for robots", given=str(grounding.multi_step))
        try:
            needed = as_needed(self.forward_model, grounding)
        except ConfigError as error:
            raise error.under("forward_model") from error
        if states:
            refuse_robots(needed, "forward_model")
            refuse_robots(self.inverse_model, "inverse_model")
        elif self.inverse_model.multi_step > 1:
            ticks = str(self.inverse_model.multi_step)
            raise ConfigError("inverse_model.multi_step", "is of a forward model", given=ticks)

    def _check_joints(self, grounding: ActionTransformation) -> None:
        """Refuse models that know different joints, and to ground one that they do not know."""
        layout = self.sim.layout
        if layout.states:
            return
        joints = self.forward_model.joints_of_interest(layout.joints, "forward_model")
        if joints != self.inverse_model.joints_of_interest(layout.joints, "inverse_model"):
            raise ConfigError("inverse_model.variables", "has to name the joints that forward_model.variables names")
        if isinstance(grounding.x, tuple):
            check_coverage(grounding.x, joints, "grounding.x")

    def round(
        self,
        place: Path,
        grounding: Grounding,
        previous: str | None,
        seed: int,
        console: Console,
        *,
        search: Path | None = None,
        only: str = "",
    ) -> Round:
        """Ground, optimise and measure below `place`, from the previous policy; a search that is shared, elsewhere."""
        ready = self.ready(place, grounding, previous, seed, console)
        policies = self.search((search or place) / "optimize", ready, previous, seed, console)
        return Round(ready, policies, self.measure(place / "evaluate", policies, seed, console, only=only))

    def pretrain(self, place: Path, seed: int, console: Console) -> str:
        """Improve the policy's start values in the plain simulator at `place`; return the file of the best."""
        return str(self.search(place, NoGrounding(), None, seed, console).folder / BEST)

    def diagnose(self, home: Path, grounding: Grounding, seed: int, console: Console) -> Grounding:
        """Return a grounding that has its diagnosis and its learned servo, made below `home` if it wants its own."""
        common: dict[str, Any] = {"workers": self.workers, "seed": seed, "console": console}
        if isinstance(grounding, DiagnosedEffects) and not grounding.effects:
            made = self.diagnosis.carry_out(self.real, self.sim, grounding.method, home, **common)
            grounding = replace(grounding, diagnosis=str(made.folder))
        inner = innermost(grounding)
        if isinstance(inner, LearnedServo):
            effects = grounding.load(read_diagnosis) if isinstance(grounding, DiagnosedEffects) else None
            made = self.diagnosis.servo(self.real, self.sim, effects, home, members=inner.members, **common)
            grounding = with_innermost(grounding, replace(inner, servo=str(made.folder)))
        return grounding

    def ready(self, home: Path, grounding: Grounding, previous: str | None, seed: int, console: Console) -> Grounding:
        """Return a grounding that has its models, trained below `home`; those inside of effects know their world."""
        if isinstance(grounding, DiagnosedEffects):
            inside = replace(self, sim=switch_on(self.sim, grounding.load(read_diagnosis)))
            return replace(grounding, inner=inside.ready(home, grounding.inner, previous, seed, console))
        if isinstance(grounding, ActionTransformation):
            return train_transformation(self, home, grounding, previous, seed, console)
        if isinstance(grounding, Trainable):
            return train_own(self, home, grounding, previous, seed, console)
        return grounding

    def values(self, out: Path, grounding: Grounding | None, settled: Mapping[str, Any], console: Console) -> Artifact:
        """Measure a fixed set of policies in the simulator with a grounding that is ready; without one, in real."""
        stage = Values(
            world=self.real if grounding is None else self.sim,
            task=self.task,
            policy=self.policy,
            grounding=grounding or NoGrounding(),
            found={key: settled[key] for key in ("alpha", "x", "width") if key in settled},
            workers=self.workers,
        )
        return build_link(stage, out, console)

    def search(self, out: Path, grounding: Grounding, previous: str | None, seed: int, console: Console) -> Artifact:
        """Optimise in the simulator with a grounding that is ready."""
        stage = Optimize(
            world=self.sim,
            task=self.task,
            policy=self.policy,
            grounding=grounding,
            optimizer=self.optimizer,
            rollouts=self.budget.rollouts,
            screening=self.budget.screening_episodes,
            objective=self.objective,
            quantile=self.quantile,
            initial=previous,
            accept=self.accept,
            workers=self.workers,
            seed=seed,
        )
        return build_link(stage, out, console)

    def measure(self, out: Path, policies: Artifact, seed: int, console: Console, only: str = "") -> Artifact:
        """Measure what a search found in the real world, or one file of it only."""
        stage = Evaluate(
            world=asking(self.real, out),
            task=self.task,
            policy=self.policy,
            policies=str(policies.folder / only),
            episodes=self.budget.episodes,
            check=self.budget.check,
            confirmation=self.budget.confirmation,
            tolerated=self.budget.tolerated,
            workers=self.workers,
            seed=seed,
        )
        return build_link(stage, out, console)
