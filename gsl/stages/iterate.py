"""Grounded simulation learning (the paper's Algorithm 1): ground, optimise, evaluate, until nothing is gained."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from gsl.core.console import Console
from gsl.core.interfaces import REAL, SIM, Grounding, Learner, Policy, Search, Task, Trainable, World
from gsl.core.layout import check_alike
from gsl.core.seeds import seed_of_round
from gsl.core.setting import component, setting
from gsl.core.words import in_unit
from gsl.errors import ConfigError, Refused
from gsl.grounding.effects import evidence_of, innermost, is_learned
from gsl.grounding.none import NoGrounding
from gsl.grounding.preparation import MAKER, without_margins
from gsl.models.config import ModelConfig
from gsl.optimizers.objective import Objective, Quantile, check_objective
from gsl.policies.policy import size_to_search
from gsl.report.iteration import Rounds, write_curve, write_table
from gsl.report.iteration_page import Seen, read_check, write_iteration_page
from gsl.report.run_page import Change
from gsl.rollout.parallel import Workers
from gsl.rollout.rollout import Scenario, start_policy
from gsl.stages.chain import Budget
from gsl.stages.chain_rounds import Chain
from gsl.stages.diagnosis_plan import EXCITATION, DiagnosisPlan, flown
from gsl.stages.effort import foresee
from gsl.stages.train_forward import TrainForward
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.policies import write_policies
from gsl.storage.policy_choice import FILE, policies, record, records, vector
from gsl.storage.trajectories import DATA, read
from gsl.training.data import HELDOUT, of_policy
from gsl.validation.compliance_transfer import SECTION, with_real
from gsl.validation.gate import REPORT
from gsl.validation.iteration_pictures import centre, draw_flight, draw_walk_and_joint, show_steps
from gsl.worlds.external import ExternalRobot
from gsl.worlds.gymnasium import try_out

FIRST = "iteration_01"


@component
class Iterate:
    """The whole chain; every link is an artifact of its own beside this one, and what is unchanged is not done anew.

    A later iteration whose grounding is refused ends it with the policy of the one before.

    With diagnosed effects an excitation in the air comes before the first iteration, and all of them take place in the
    simulator that its diagnosis leaves; without a cause that is the calibrated one.
    """

    kind: ClassVar[str] = "iterate"
    makes: ClassVar[tuple[str, ...]] = ("grounding",)

    sim: Annotated[World, setting("the simulator")]
    real: Annotated[World, setting("the real world, or what plays its part")]
    task: Annotated[Task, setting("what is to be maximised")]
    policy: Annotated[Policy, setting("what is to be improved")]
    forward_model: Annotated[ModelConfig, setting("how f is learned")]
    inverse_model: Annotated[ModelConfig, setting("how the simulator's inverse is learned")]
    inverse_method: Annotated[Literal["regression", "solve"], setting("what the inverse is (train-inverse --help)")]
    grounding: Annotated[Grounding, setting("what stands between action and simulator")]
    optimizer: Annotated[Search | Learner, setting("what improves the parameters")]
    budget: Annotated[Budget, setting("episodes of each part")]
    diagnosis: Annotated[DiagnosisPlan, setting("how grounding=effects finds the effects")]
    objective: Objective = "mean"
    quantile: Quantile = 0.25
    iterations: Annotated[int, setting("most iterations", ge=1)] = 1
    pretrained: Annotated[bool, setting("improve π0 in the plain simulator before the first iteration")] = False
    beside: Annotated[bool, setting("show the result without grounding beside it")] = False
    accept: Annotated[bool, setting("go on with a grounding that fails its check")] = False
    aggregate: Annotated[bool, setting("f learns from the real trajectories of all iterations so far")] = False
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def __post_init__(self) -> None:
        """Tell the policy its world; refuse two worlds that no policy could act in both of."""
        if isinstance(self.sim, ExternalRobot):
            raise ConfigError("sim", "is a real robot, which cannot play the simulator's part")
        check_objective(self.objective, self.optimizer)
        object.__setattr__(self, "policy", size_to_search(self.policy, self.sim))
        layout = self.sim.layout
        check_alike(layout, self.real.layout)
        for name, model in {"forward_model": self.forward_model, "inverse_model": self.inverse_model}.items():
            if layout.states:
                model.of_interest(layout.states, name)
            else:
                model.joints_of_interest(layout.joints, name)

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here."""
        return {}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Run the iterations, write the policy they end with, the table and the plots."""
        check_aggregate(self, [self.grounding], "aggregate")
        self.chain.check(self.grounding)
        try_out({"sim": self.sim, "real": self.real})
        for world in (self.sim, self.real):
            start_policy(self.policy, self.policy.initial, world.layout)
        home, rounds, first = folder.parent, Rounds(self.task), self.grounding
        parts, message = foresee(self)
        if message:
            console.status(message)
        title = in_unit("grounded simulation learning", self.task.unit)
        with console.plan("stage", parts), console.live_table(title, rounds.columns) as table:
            start = self.chain.pretrain(home / "pretrained", self.seed, console) if self.pretrained else None
            grounding = self._diagnose(home, rounds, console)
            chain = self.chain
            for number in range(1, self.iterations + 1):
                place = home / f"iteration_{number:02d}"
                try:
                    done = chain.round(
                        place, grounding, rounds.last or start, seed_of_round(self.seed, number), console
                    )
                except Refused as refusal:
                    if number == 1:
                        raise
                    table.row(*rounds.add_refusal(refusal.why, self._real_episodes))
                    console.status(f"warning: {refusal}")
                    break
                chain = chain.after(place)
                first = done.ready if number == 1 else first
                for row in rounds.add(done.measured, self._real_episodes):
                    table.row(*row)
                if not rounds.rising:
                    break
            if self.beside:
                for row in rounds.add_beside(self._run_ungrounded(home, start, console)):
                    table.row(*row)
        returned = Path(rounds.last) / FILE if rounds.last else Path(start) if start else None
        if returned is None:
            write_policies(
                folder / FILE, policies(self.policy, self.task, [record(self.policy, "pi0", self.policy.initial)])
            )
        else:
            (folder / FILE).write_bytes(returned.read_bytes())
        yielding = with_real(home / FIRST / "optimize" / REPORT, self.real, self.seed)
        remarks = [yielding.sentence] if yielding else []
        write_table(folder, rounds, remarks)
        write_curve(folder, rounds)
        best = vector(self.policy, records(self.policy, str(folder / FILE))[-1])
        seen = self._draw(folder, home, first, best)
        change = Change(self.policy.names, self.policy.initial.tolist(), best.tolist(), self.policy.scale.tolist())
        check = read_check(home / FIRST / "optimize" / REPORT)
        if yielding:
            check = {**(check or {}), SECTION: {"groups": yielding.metrics()}}  # the real side is in it as well
        write_iteration_page(folder, rounds, seen, change, check, remarks)
        if yielding:
            console.status(yielding.sentence)
        return {**rounds.metrics(), SECTION: yielding.metrics() if yielding else None}

    @property
    def chain(self) -> Chain:
        """The links of a round."""
        return Chain(
            sim=self.sim,
            real=self.real,
            task=self.task,
            policy=self.policy,
            forward_model=self.forward_model,
            inverse_model=self.inverse_model,
            inverse_method=self.inverse_method,
            optimizer=self.optimizer,
            budget=self.budget,
            diagnosis=self.diagnosis,
            accept=self.accept,
            workers=self.workers,
            aggregate=self.aggregate,
            objective=self.objective,
            quantile=self.quantile,
        )

    @property
    def _real_episodes(self) -> int:
        return sum(self.budget.real) if REAL in evidence_of(self.grounding) else 0

    def _diagnose(self, home: Path, rounds: Rounds, console: Console) -> Grounding:
        """Return the grounding with its diagnosis: an excitation knows no policy, so that one serves all iterations."""
        grounding = self.chain.diagnose(home / FIRST, self.grounding, self.seed, console)
        if flight := flown(home / FIRST, self.grounding, grounding):
            rounds.add_diagnosis(flight)
            for finding in flight.findings:
                console.status(finding)
        return grounding

    def _run_ungrounded(self, home: Path, start: str | None, console: Console) -> Artifact:
        place = home / FIRST
        search = self.chain.search(place / "optimize_none", NoGrounding(), start, self.seed, console)
        return self.chain.measure(place / "evaluate_none", search, self.seed, console)

    def _draw(self, folder: Path, home: Path, first: Grounding, returned: np.ndarray) -> Seen:
        """Draw what the first iteration's grounding makes of real motions that nothing was learned from, and a walk."""
        place = home / FIRST
        search = Artifact(place / "optimize", manifest.read(place / "optimize"))
        scenario = Scenario(self.sim, self.task, self.policy, SIM, without_margins(first)).prepare(search.metrics)
        real = Scenario(self.real, self.task, self.policy, REAL, NoGrounding()).prepare()
        maker = MAKER if isinstance(innermost(first), Trainable) else TrainForward.kind
        if (place / maker / HELDOUT).is_file():
            heldout = read(place / maker / HELDOUT)
            walk = max(of_policy(heldout, pi0=True) or heldout.episodes, key=len)
            return draw_walk_and_joint(folder, scenario, real, walk, returned, self.seed)
        if (place / EXCITATION).is_dir():
            log = read(place / EXCITATION / DATA)
            return draw_flight(folder, self.sim, scenario, real, log, returned, self.seed)
        if centre(scenario.world) is None:
            return Seen()
        return Seen(walks=show_steps(real, scenario, returned, self.seed, "in simulation"))


def check_aggregate(iterate: Iterate, groundings: Iterable[Grounding], name: str) -> None:
    """Refuse to keep real trajectories for an f that is fitted once, or never.

    Raises:
        ConfigError: Under the name of the setting.
    """
    if iterate.aggregate and not (any(map(is_learned, groundings)) and iterate.iterations > 1):
        problem = "is for a grounding that learns from real trajectories, in two iterations or more"
        raise ConfigError(name, problem, given="true")


def check_trainable(iterate: Iterate, name: str, grounding: Grounding) -> None:
    """Refuse what iterations could not train, before anything is asked of the real robot.

    Args:
        iterate: The setting `iterate` of a study.
        name: Of the setting that the grounding is there.
        grounding: In the place of its own.

    Raises:
        ConfigError: Under the study's names of settings; see `Chain.check`.
    """
    try:
        iterate.chain.check(grounding)
    except ConfigError as error:
        whose, _, below = error.setting.partition(".")
        where = f"{name}.{below}" if whose == "grounding" else f"iterate.{error.setting}"
        raise ConfigError(where, error.problem, given=error.given) from error
