"""What groundings make of the simulator before anything is searched: how its joints move, and how they yield."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar

from gsl.core.console import Console, Silent
from gsl.core.interfaces import REAL, SIM, Grounding, World
from gsl.core.layout import check_alike
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.grounding.effects import DiagnosedEffects, innermost
from gsl.grounding.gat import ActionTransformation, LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.grounding.servo import LearnedServo
from gsl.models.free_run import TICKS
from gsl.report.study_page import write_study_page
from gsl.rollout.rollout import Scenario
from gsl.stages.iterate import Iterate, check_trainable
from gsl.training.data import degrees, of_policy
from gsl.validation.check import ask_reachability
from gsl.validation.check_grounding import check_grounding
from gsl.validation.compliance import joint_groups
from gsl.validation.gate import Gate
from gsl.validation.replay import replay_starts
from gsl.worlds.bullet import BulletWorld
from gsl_experiments.compare import Compare
from gsl_experiments.effort import seconds
from gsl_experiments.gain_predictors import TRIALS, predictors, read_searches
from gsl_experiments.held_out import MEASURED, check_first_iteration, check_robot, collect_held_out, starts
from gsl_experiments.ledger import GOES_ON, Known, Ledger, list_earlier, recipe
from gsl_experiments.replay import Replay
from gsl_experiments.replays_table import FIGURE, TABLE, Shown
from gsl_experiments.sizes import First, PresetName, numbers, sizes_of, trials_of
from gsl_experiments.trials_picture import method_colour
from gsl_experiments.yielding import Loads

DATA = "replays.json"


@component
class Replays:
    """Trial k of every method has the same seed, and is judged on the same trajectories of its real world."""

    kind: ClassVar[str] = "reproduce"
    forced: ClassVar[str] = GOES_ON
    makes: ClassVar[tuple[str, ...]] = ("methods", "iterate.grounding")

    iterate: Annotated[Iterate, setting("what a trial is; its worlds and grounding are replaced")]
    worlds: Annotated[Mapping[str, World], setting("the real worlds, by name", min_length=1)]
    methods: Annotated[Mapping[str, Grounding], setting("the groundings, by name", min_length=1)]
    trials: Annotated[int, setting("trials of each method", ge=1)]
    gains: Annotated[
        str | tuple[str, ...] | None,
        setting("trials.json of searches with the same methods, or a [list] of them: which figure goes with gains?"),
    ] = None
    known: Known = None
    preset_name: PresetName = ""
    first: First = 1

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here, but for what is known."""
        return {**list_earlier(self.known, DATA), **list_earlier(self.gains, TRIALS, "gains")}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Build every grounding as a search would have it, replay, load, write the figures, the table and the picture.

        Raises:
            ConfigError: A method cannot be replayed, or there is more than one iteration.
        """
        self.check()
        study = Compare(self.iterate, self.worlds, self.methods, self.trials)
        home = folder.parent
        ledger = Ledger(home / DATA, list_earlier(self.known, DATA), Replay, console)
        keys = self.recipes
        ledger.announce({key: cell[2] for cell, key in keys.items()}, lambda: seconds(study, search=False))
        ledger.judge({key: {"trial": k, "world": world, "method": name} for (k, world, name), key in keys.items()})
        loads = {k: Loads(self.iterate.sim, self.iterate.seed + k - 1) for k, *_ in keys}
        for (number, world, method), key in keys.items():
            if not ledger.take(key):
                with console.part(f"{world}, {method}, trial {number}"):
                    replay = self._replay(home, number, world, method, loads[number], console)
                    ledger.add(key, [replay._asdict()])
        rows = [Replay(**row) for row in ledger.figures]
        self.tell(folder, rows, ledger.close(folder / DATA))
        return {"replays": len(rows)}

    def check(self) -> None:
        """Refuse methods that are drawn anew each time, worlds that do not go together, and further iterations.

        Raises:
            ConfigError: There is one.
        """
        for name, grounding in self.methods.items():
            inner = innermost(grounding)
            drawn = isinstance(inner, LearnedServo) and (inner.torque_noise or inner.noise or inner.ensemble)
            drawn = drawn or (isinstance(grounding, DiagnosedEffects) and grounding.draws)
            if drawn or not isinstance(inner, ActionTransformation | NoGrounding | LearnedServo):
                raise ConfigError(f"methods.{name}", "is drawn anew each time; replays are of what is expected")
            check_trainable(self.iterate, f"methods.{name}", grounding)
        for name, world in self.worlds.items():
            check_alike(self.iterate.sim.layout, world.layout)
            check_robot(world, f"worlds.{name}")
        check_first_iteration(self.iterate)

    @property
    def recipes(self) -> dict[tuple[int, str, str], str]:
        """By trial, world and method, in the order in which they are run."""
        return {
            (k, world, method): recipe(self.iterate, k, world, method, self.worlds[world], self.methods[method])
            for k, world, method in product(numbers(self.first, self.trials), self.worlds, self.methods)
        }

    def _replay(self, home: Path, number: int, world: str, method: str, loads: Loads, console: Console) -> Replay:
        seed, name, below = self.iterate.seed + number - 1, f"trial_{number:02d}", home / world
        chain = replace(self.iterate.chain, real=self.worlds[world], accept=True)
        held = collect_held_out(chain, below / "held_out" / name, seed, console)
        begins = starts(held, chain)
        grounding = chain.diagnose(below / "diagnosis" / name, self.methods[method], seed, console)
        data = {REAL: below / "data" / name, SIM: home / "sim" / "data" / name}
        own = isinstance(grounding, DiagnosedEffects)  # simulations that know the effects
        chain = replace(chain, shared={REAL: data[REAL]} if own else data)
        ready = chain.ready(below / method / name, grounding, None, seed, console)
        gate = Gate(chain.policy.initial, below / method / name, Silent(), accept=True, seed=seed)
        gate.folder.mkdir(parents=True, exist_ok=True)
        scenario, report = check_grounding(Scenario(chain.sim, chain.task, chain.policy, SIM, ready), gate)
        acting, reach = scenario.grounding, None
        env: Any = scenario.world.make()
        drawn = derive_seed(seed, "replays")
        if isinstance(acting, LoadedTransformation):
            acting = acting.deterministic
            reach = ask_reachability(env, acting, of_policy(held, pi0=False), drawn)
        after = replay_starts(env, acting, begins, drawn)
        env.close()
        console.phase("loading single joints in the air")
        yielding = loads.yielding(scenario.world, acting, self.worlds[world])
        return Replay(
            world,
            method,
            number,
            after_a_tick=degrees(after[1].joints),
            joints=degrees(after[TICKS].joints),
            pitch=degrees(after[TICKS].pitch),
            forward=after[TICKS].forward_mm,
            unreached=reach.share if reach else None,
            alpha=report.get("alpha"),
            replays=len(after[TICKS]),
            **yielding._asdict(),
        )

    def tell(self, folder: Path, rows: Sequence[Replay], made: str) -> None:
        """Write the table and the figure of all replays; `made` says who made them."""
        trials = trials_of(self.first, self.trials)
        servos = any(isinstance(innermost(method), LearnedServo) for method in self.methods.values())
        flown = f"effects{' and servos' * servos} from motions in the air"
        sizes = f"{sizes_of(self.preset_name)} {trials}; {self.iterate.budget.in_words}, {flown}."
        robot = self.iterate.sim.plant.robot if isinstance(self.iterate.sim, BulletWorld) else None
        colours = {name: method_colour(method) for name, method in self.methods.items()}
        shown = Shown(rows, tuple(self.worlds), colours, tuple(joint_groups(robot)) if robot else ())
        gains = list_earlier(self.gains, TRIALS, "gains").values()
        foretold = predictors(rows, read_searches(gains), self.iterate.seed)
        parts = filter(None, (shown.table(), MEASURED, *shown.about(), sizes, foretold, made))
        (folder / TABLE).write_text("\n\n".join(part.strip() for part in parts) + "\n", encoding="utf-8")
        write_study_page(folder, shown.answer, [TABLE], [shown.draw(folder / FIGURE)])
