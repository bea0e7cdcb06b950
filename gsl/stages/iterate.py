"""Grounded simulation learning (the paper's Algorithm 1): ground, optimise, evaluate, until nothing is gained."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from gsl.core.described import described
from gsl.core.setting import component, setting
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.grounding import Grounding
from gsl.grounding.none import NoGrounding
from gsl.models.config import ModelConfig
from gsl.optimizers.cma_es import CmaEs
from gsl.policies.policy import Policy
from gsl.stages.choices import FILE
from gsl.stages.collect import Collect
from gsl.stages.evaluate import Evaluate
from gsl.stages.iteration_report import write_curve, write_table, write_trace
from gsl.stages.optimize import Optimize
from gsl.stages.train_forward import HELDOUT, TrainForward
from gsl.stages.train_inverse import TrainInverse
from gsl.stages.training import of_policy
from gsl.storage.artifact import Artifact, Stage, build
from gsl.storage.models import read_forward_model, read_inverse_model
from gsl.storage.trajectories import read
from gsl.tasks.task import REAL, SIM, Task
from gsl.worlds.world import World

COLUMNS = (
    "iteration",
    "policy",
    "in simulation",
    "in real",
    "95 % interval",
    "falls",
    "gain over the last",
    "real episodes",
)


@component
class Budget:
    """How many episodes each part of an iteration gets."""

    real_episodes: Annotated[int, setting("real episodes of the policy, for the forward model", ge=1)]
    real_neighbours: Annotated[int, setting("real episodes of perturbed policies", ge=0)]
    sim_episodes: Annotated[int, setting("simulated episodes of the policy, for the inverse model", ge=1)]
    sim_neighbours: Annotated[int, setting("simulated episodes of perturbed policies", ge=0)]
    spread: Annotated[float, setting("size of the perturbations, in units of a parameter's scale", ge=0)]
    sim_action_noise: Annotated[float, setting("noise on simulated actions", unit="rad", ge=0)]
    rollouts: Annotated[int, setting("simulated episodes of each candidate", ge=1)]
    episodes: Annotated[int, setting("real episodes of each generation's best", ge=1)]
    confirmation: Annotated[int, setting("fresh real episodes of the chosen policy", ge=2)]


@component
class Iterate:
    """The whole chain; every link is an artifact of its own below `home`, and what is unchanged is not done again."""

    kind: ClassVar[str] = "iterate"

    sim: Annotated[World, setting("the simulator")]
    real: Annotated[World, setting("the real world, or what plays its part")]
    task: Annotated[Task, setting("what is to be maximised")]
    policy: Annotated[Policy, setting("what is to be improved")]
    forward_model: Annotated[ModelConfig, setting("how f is learned")]
    inverse_model: Annotated[ModelConfig, setting("how the simulator's inverse is learned")]
    inverse_method: Annotated[Literal["regression", "solve"], setting("what the inverse is (train-inverse --help)")]
    grounding: Annotated[Grounding | ActionTransformation, setting("what stands between action and simulator")]
    optimizer: Annotated[CmaEs, setting("what improves the parameters")]
    budget: Annotated[Budget, setting("episodes of each part")]
    home: Annotated[str, setting("folder of the iterations")]
    iterations: Annotated[int, setting("most iterations", ge=1)] = 1
    beside: Annotated[bool, setting("show the result without grounding beside it")] = False
    accept: Annotated[bool, setting("go on with a grounding that fails its check")] = False
    workers: Annotated[int, setting("processes; -1 for one a core")] = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here."""
        return {}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        """Run the iterations, write the policy they end with, the table and the plots."""
        done: list[Artifact] = []
        shown: list[tuple[str, ...]] = []
        ungrounded = None
        with console.live_table(f"grounded simulation learning [{self.task.unit}]", COLUMNS) as table:

            def show(label: str, evaluation: Artifact, *, first: bool = False) -> None:
                for row in self._rows(label, evaluation.metrics, first=first):
                    shown.append(row)
                    table.row(*row)

            for number in range(1, self.iterations + 1):
                previous = str(done[-1].folder) if done else None
                done.append(self._iteration(number, previous, console))
                show(str(number), done[-1], first=number == 1)
                if not _rose(done[-1]):
                    break
            if self.beside:
                ungrounded = self._ungrounded(console)
                show("no grounding", ungrounded)
        best = done[-1] if _rose(done[-1]) or len(done) == 1 else done[-2]
        (folder / FILE).write_bytes((best.folder / FILE).read_bytes())
        spent = sum(self._real_episodes(artifact) for artifact in done)
        write_table(folder, COLUMNS, shown)
        write_curve(folder, self, done, ungrounded)
        if self.learned:
            self._trace(folder)
        return {
            "iterations": len(done),
            "returned_iteration": 1 + done.index(best),
            "returned": best.metrics["returned"],
            "baseline": done[0].metrics["baseline"],
            "gain": best.metrics["gain"],
            "real_episodes": spent,
            "stopped_by_itself": not _rose(done[-1]),
            "ungrounded": None if ungrounded is None else ungrounded.metrics,
        }

    @property
    def learned(self) -> bool:
        """Whether the grounding has models to train."""
        return isinstance(self.grounding, ActionTransformation)

    def _iteration(self, number: int, previous: str | None, console: Any) -> Artifact:
        """Return the evaluation that ends one iteration."""
        home, seed = Path(self.home) / f"iteration_{number:02d}", self.seed + 1000 * (number - 1)
        grounding = self.trained(home, previous, seed, console) if self.learned else self.grounding
        found = self.search(home / "optimize", grounding, previous, seed, console)
        return self.measure(home / "evaluate", found, seed, console)

    def trained(self, home: Path, previous: str | None, seed: int, console: Any) -> ActionTransformation:
        """Collect in both worlds, train both models below `home`, and return the grounding that they make."""
        assert isinstance(self.grounding, ActionTransformation), "only learned groundings are trained"
        self._collected(home, previous, seed, console)
        forward = TrainForward(str(home / "collect_real"), self.forward_model, seed=seed)
        inverse = TrainInverse(str(home / "collect_sim"), self.inverse_model, method=self.inverse_method, seed=seed)
        models = {"forward_model": forward, "inverse_model": inverse}
        built = {role: _built(stage, home / stage.kind, console) for role, stage in models.items()}
        return replace(self.grounding, **{role: str(artifact.folder) for role, artifact in built.items()})

    def search(self, out: Path, grounding: Any, previous: str | None, seed: int, console: Any) -> Artifact:
        """Optimise in the simulator with a grounding that is ready."""
        stage = Optimize(
            world=self.sim,
            task=self.task,
            policy=self.policy,
            grounding=grounding,
            optimizer=self.optimizer,
            rollouts=self.budget.rollouts,
            initial=previous,
            accept=self.accept,
            workers=self.workers,
            seed=seed,
        )
        return _built(stage, out, console)

    def measure(self, out: Path, found: Artifact, seed: int, console: Any) -> Artifact:
        """Measure what a search found in the real world."""
        stage = Evaluate(
            world=self.real,
            task=self.task,
            policy=self.policy,
            policies=str(found.folder),
            episodes=self.budget.episodes,
            confirmation=self.budget.confirmation,
            workers=self.workers,
            seed=seed,
        )
        return _built(stage, out, console)

    def _collected(self, home: Path, previous: str | None, seed: int, console: Any) -> None:
        budget, common = self.budget, {"task": self.task, "policy": self.policy, "initial": previous, "seed": seed}
        common |= {"spread": budget.spread, "workers": self.workers}
        real = Collect(
            world=self.real, role=REAL, episodes=budget.real_episodes, neighbours=budget.real_neighbours, **common
        )
        sim = Collect(
            world=self.sim,
            role=SIM,
            episodes=budget.sim_episodes,
            neighbours=budget.sim_neighbours,
            action_noise=budget.sim_action_noise,
            **common,
        )
        for stage in (real, sim):
            _built(stage, home / f"collect_{stage.role}", console)

    def _ungrounded(self, console: Any) -> Artifact:
        home = Path(self.home) / "iteration_01"
        found = self.search(home / "optimize_none", NoGrounding(), None, self.seed, console)
        return self.measure(home / "evaluate_none", found, self.seed, console)

    def _trace(self, folder: Path) -> None:
        """Draw the first iteration's grounding on a real walk that its models have not seen."""
        home = Path(self.home) / "iteration_01"
        models = {"forward_model": str(home / "train_forward"), "inverse_model": str(home / "train_inverse")}
        alpha = json.loads((home / "optimize" / "metrics.json").read_text(encoding="utf-8"))["alpha"]
        grounding = replace(self.grounding, **models, alpha=alpha).load(read_forward_model, read_inverse_model)
        walks = of_policy(read(home / "train_forward" / HELDOUT), pi0=True)
        write_trace(folder, self.sim, grounding, max(walks, key=len))

    def _real_episodes(self, evaluation: Artifact) -> int:
        collected = (self.budget.real_episodes + self.budget.real_neighbours) if self.learned else 0
        return collected + evaluation.metrics["real_episodes"]

    def _rows(self, label: Any, metrics: Mapping[str, Any], *, first: bool) -> list[tuple[str, ...]]:
        before, after, gain = metrics["baseline"], metrics["returned"], metrics["gain"]
        simulated = metrics["returned_value_sim"]
        expected = "" if simulated is None else f"{self.task.shown * simulated:.1f}"
        zero = [("0", "π0", "", *self._measured(before), "", "")] if first else []
        share, spent = f"{100 * gain['share']:+.1f} %", str(metrics["real_episodes"])
        return [*zero, (str(label), metrics["best"], expected, *self._measured(after), share, spent)]

    def _measured(self, summary: Mapping[str, Any]) -> tuple[str, str, str]:
        low, high = (self.task.shown * bound for bound in summary["interval"])
        value = f"{self.task.shown * summary['value']:.1f}"
        return value, f"{low:.1f} to {high:.1f}", f"{summary['falls']} of {summary['episodes']}"


def _built(stage: Stage, out: Path, console: Any) -> Artifact:
    """Build one link of the chain; the iterations belong to this command, so what was built otherwise is replaced."""
    return build(
        stage, config=described(stage), out=out, command=f"gsl iterate ({stage.kind})", force=True, console=console
    )


def _rose(evaluation: Artifact) -> bool:
    """The paper's stop rule, with the interval: is v(pi_i) - v(pi_i-1) surely above 0?"""
    return evaluation.metrics["gain"]["interval"][0] > 0.0
