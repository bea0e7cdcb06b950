"""What groundings make of the simulator before anything is searched: how far it is from real trajectories off π0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from gsl.core.layout import check_alike
from gsl.core.seeds import derived_seed
from gsl.core.setting import component, setting
from gsl.core.statistics import mean_interval
from gsl.errors import ConfigError
from gsl.grounding.effects import DiagnosedEffects, innermost
from gsl.grounding.gat import ActionTransformation, LoadedTransformation
from gsl.grounding.grounding import Grounding
from gsl.grounding.none import NoGrounding
from gsl.models.free_run import TICKS
from gsl.report.markdown import table
from gsl.report.trial_dots import Dots, trial_dots
from gsl.stages.grounding_check import asked
from gsl.stages.grounding_gate import Gate
from gsl.stages.grounding_replay import replayed
from gsl.stages.iterate import Iterate, check_trainable
from gsl.stages.rollout import Scenario
from gsl.stages.training import degrees, of_policy
from gsl.studies.compare import Compare
from gsl.studies.comparison_table import finely, told_difference
from gsl.studies.effort import seconds
from gsl.studies.held_out import MEASURED, check_first_iteration, check_robot, held_out, starts
from gsl.studies.ledger import GOES_ON, Known, Ledger, known_parents, recipe
from gsl.studies.method_colour import method_colour
from gsl.studies.sizes import First, PresetName, numbers, sizes_of, trials_of
from gsl.tasks.task import REAL, SIM
from gsl.worlds.world import World

TABLE, DATA, FIGURE = "table.md", "replays.json", "replays.png"
TITLES = (
    *("real world", "grounding", "joints after 0.2 s [°]", "95 % interval", "after a tick [°]"),
    *("pitch [°]", "forward [mm]", "out of reach [%]"),
)
MOTIONS = ", effects from motions in the air"
MEANS = {"after_a_tick": ".2f", "pitch": ".2f", "forward": ".1f"}


class Silent:
    """Hears what the gate says of its own check, which is of other trajectories than the study's."""

    def status(self, text: str) -> None:
        """Say nothing."""

    def table(self, *parts: Any) -> None:
        """Show nothing."""


class Replay(NamedTuple):
    """One method, once, in one real world: root mean square errors over replays of real actions off π0.

    Attributes:
        world, method, trial: What was tried.
        after_a_tick: Of the joints [deg].
        joints, pitch: After 0.2 s [deg].
        forward: Of the body's place after 0.2 s [mm].
        unreached: Share of steps and joints in which no action of the simulator does what f predicts; None where
            nothing is predicted a tick ahead.
        alpha: How far the grounding goes, None where it is no transformation.
        replays: Their number.
    """

    world: str
    method: str
    trial: int
    after_a_tick: float
    joints: float
    pitch: float
    forward: float
    unreached: float | None
    alpha: float | None
    replays: int

    @property
    def contradiction(self) -> str:
        """What cannot be, of figures that a file told."""
        if not self.trial > 0 < self.replays:
            return f"trial {self.trial}, replays {self.replays}"
        errors = self.after_a_tick, self.joints, self.pitch, self.forward
        shares = (self.unreached or 0.0, self.alpha or 0.0)
        if min(errors) < 0.0 or not all(0.0 <= share <= 1.0 for share in shares):
            return f"errors {errors}, unreached {self.unreached}, alpha {self.alpha}"
        return ""


@component
class Replays:
    """Trial k of every method has the same seed, and is judged on the same trajectories of its real world."""

    kind: ClassVar[str] = "reproduce"
    forced: ClassVar[str] = GOES_ON

    iterate: Annotated[Iterate, setting("what a trial is; its worlds and grounding are replaced")]
    worlds: Annotated[Mapping[str, World], setting("the real worlds, by name", min_length=1)]
    methods: Annotated[Mapping[str, Grounding | ActionTransformation], setting("the groundings, by name", min_length=1)]
    trials: Annotated[int, setting("trials of each method", ge=1)]
    known: Known = None
    preset_name: PresetName = ""
    first: First = 1

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here, but for what is known."""
        return known_parents(self.known, DATA)

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        """Build every grounding as a search would have it, replay, and write the figures, the table and the picture.

        Raises:
            ConfigError: A method cannot be replayed, or there is more than one iteration.
        """
        self._check()
        study = Compare(self.iterate, self.worlds, self.methods, self.trials)
        home = folder.parent
        ledger = Ledger(home / DATA, self.parents(), Replay, console)
        keys = self.recipes
        ledger.announce({key: cell[2] for cell, key in keys.items()}, lambda: seconds(study, search=False))
        ledger.judge({key: {"trial": k, "world": world, "method": name} for (k, world, name), key in keys.items()})
        for (number, world, method), key in keys.items():
            if not ledger.take(key):
                with console.part(f"{world}, {method}, trial {number}"):
                    ledger.add(key, [self._replay(home, number, world, method, console)._asdict()])
        rows = [Replay(**row) for row in ledger.figures]
        self.tell(folder, rows, ledger.close(folder / DATA))
        return {"replays": len(rows)}

    def _check(self) -> None:
        for name, grounding in self.methods.items():
            if not isinstance(innermost(grounding), ActionTransformation | NoGrounding):
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

    def _replay(self, home: Path, number: int, world: str, method: str, console: Any) -> Replay:
        seed, name, below = self.iterate.seed + number - 1, f"trial_{number:02d}", home / world
        chain = replace(self.iterate.chain, real=self.worlds[world], accept=True)
        held = held_out(chain, below / "held_out" / name, seed, console)
        begins = starts(held, chain)
        grounding = chain.diagnosed(below / "diagnosis" / name, self.methods[method], seed, console)
        data = {REAL: below / "data" / name, SIM: home / "sim" / "data" / name}
        own = isinstance(grounding, DiagnosedEffects)  # simulations that know the effects
        chain = replace(chain, shared={REAL: data[REAL]} if own else data)
        ready = chain.ready(below / method / name, grounding, None, seed, console)
        gate = Gate(chain.policy.initial, below / method / name, Silent(), accept=True, seed=seed)
        gate.folder.mkdir(parents=True, exist_ok=True)
        scenario, found = gate.passed(Scenario(chain.sim, chain.task, chain.policy, SIM, ready))
        acting, reach = scenario.grounding, None
        env: Any = scenario.world.make()
        drawn = derived_seed(seed, "replays")
        if isinstance(acting, LoadedTransformation):
            acting = acting.expected
            reach = asked(env, acting, of_policy(held, pi0=False), drawn)
        after = replayed(env, acting, begins, drawn)
        env.close()
        return Replay(
            world,
            method,
            number,
            after_a_tick=degrees(after[1].joints),
            joints=degrees(after[TICKS].joints),
            pitch=degrees(after[TICKS].pitch),
            forward=after[TICKS].forward_mm,
            unreached=reach.share if reach else None,
            alpha=found.get("alpha"),
            replays=len(after[TICKS]),
        )

    def tell(self, folder: Path, rows: Sequence[Replay], made: str) -> None:
        """Write the table and the figure of all replays; `made` says who made them."""
        first, shown, panels = next(iter(self.methods)), [], dict[str, dict[str, Dots]]()
        for world, method in product(self.worlds, self.methods):
            own, bare = ([one for one in rows if (one.world, one.method) == (world, name)] for name in (method, first))
            joints = mean_interval([one.joints for one in own])
            nearer = mean_interval([one.joints - other.joints for one, other in zip(own, bare, strict=True)])
            reach = [100.0 * one.unreached for one in own if one.unreached is not None]
            means = [f"{np.mean([getattr(one, name) for one in own]):{form}}" for name, form in MEANS.items()]
            few = f" ({len(reach)} of {len(own)} trials)" if 0 < len(reach) < len(own) else ""
            last = f"{np.mean(reach):.0f}{few}" if reach else ""
            than = "" if method == first else told_difference(nearer, fine=True)
            shown.append((world, method, f"{joints.mean:.2f}", finely(joints), than, *means, last))
            dots = Dots([one.joints for one in own], [False] * len(own), method_colour(self.methods[method]))
            panels.setdefault(world, {})[method] = dots
        titles = (*TITLES[:4], f"minus {first} (95 %, paired)", *TITLES[4:])
        trials = trials_of(self.first, self.trials)
        sizes = f"{sizes_of(self.preset_name)} {trials}; {self.iterate.budget.learned}{MOTIONS}."
        below = "\n\n".join([MEASURED, sizes, made])
        (folder / TABLE).write_text(f"{table(titles, shown)}\n{below}\n", encoding="utf-8")
        trial_dots(folder / FIGURE, panels, axis=TITLES[2], title="How far simulators are from real joints, each trial")
