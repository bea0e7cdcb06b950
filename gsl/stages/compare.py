"""Groundings against each other: paired trials of one iteration each, in several real worlds (the paper's Table 2)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

from gsl.core.setting import component, setting
from gsl.grounding.effects import innermost
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.grounding import Grounding
from gsl.stages.comparison import Trial, markdown, summaries
from gsl.stages.diagnosis_plan import flown
from gsl.stages.iterate import Iterate
from gsl.storage.documents import write_json
from gsl.worlds.world import World

TABLE, DATA = "table.md", "trials.json"


@component
class Compare:
    """Trial k of every method has the same seed; what is built is not built again, so a stopped study goes on.

    A grounding that its check would refuse is gone on with, and the table says how often that was.

    A search in a simulator that knows nothing of the real world (no grounding, action noise) is done once a trial and
    measured in every world: columns of such a method are not independent of each other. Methods with diagnosed effects
    share the diagnosis of their trial and world; each of them pays for it.
    """

    kind: ClassVar[str] = "compare"

    iterate: Annotated[Iterate, setting("what a trial is; its real world and grounding are replaced")]
    worlds: Annotated[Mapping[str, World], setting("the real worlds, by name")]
    methods: Annotated[Mapping[str, Grounding | ActionTransformation], setting("the groundings, by name")]
    trials: Annotated[int, setting("trials of each method", ge=1)]

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here."""
        return {}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        """Run all trials; write every trial's figures and the tables."""
        found = []
        for trial in self._trials(folder.parent, console):
            found.append(trial)
            console.status(f"{trial.world}, {trial.method}, trial {trial.number}: {trial.told}")
        write_json(folder / DATA, [trial._asdict() for trial in found])
        summary = summaries(found)
        (folder / TABLE).write_text(markdown(summary, found), encoding="utf-8")
        return {"trials": len(found), "summaries": [one._asdict() for one in summary]}

    def _trials(self, home: Path, console: Any) -> Iterator[Trial]:
        for number in range(1, self.trials + 1):
            for method in self.methods:
                for world in self.worlds:
                    yield self._trial(home, world, method, number, console)

    def _trial(self, home: Path, world: str, method: str, number: int, console: Any) -> Trial:
        seed, name = self.iterate.seed + number - 1, f"trial_{number:02d}"
        chain = replace(self.iterate.chain, real=self.worlds[world], accept=True)
        place, air = home / world / method / name, home / world / "diagnosis" / name
        grounding = chain.diagnosed(air, self.methods[method], seed, console)
        flight = flown(air, self.methods[method], grounding)
        collected = flight.episodes if flight else 0
        if isinstance(innermost(grounding), ActionTransformation):
            collected += self.iterate.budget.real_episodes + self.iterate.budget.real_neighbours
        ready = chain.ready(place, grounding, None, seed, console)
        out = place if collected else home / "sim" / method / name
        found = chain.search(out / "optimize", ready, None, seed, console)
        measured = chain.measure(place / "evaluate", found, seed, console)
        return Trial.of(world, method, number, found.metrics, measured.metrics, collected)
