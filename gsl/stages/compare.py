"""Groundings against each other: paired trials of one iteration each, in several real worlds (the paper's Table 2)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

from gsl.core.setting import component, setting
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.grounding import Grounding
from gsl.stages.comparison import COLUMNS, Trial, markdown, rows, summaries
from gsl.stages.iterate import Iterate
from gsl.storage.artifact import Artifact
from gsl.storage.documents import write_json
from gsl.worlds.world import World

TABLE, DATA = "table.md", "trials.json"


@component
class Compare:
    """Trial k of every method has the same seed; what one has built is not built again, so a stopped study goes on.

    A search in a simulator that knows nothing of the real world (no grounding, action noise) is done once a trial and
    measured in every world: columns of such a method are not independent of each other.
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
        """Run all trials; write every trial's figures and the table."""
        found = []
        for trial in self._trials(console):
            found.append(trial)
            console.status(f"{trial.world}, {trial.method}, trial {trial.number}: {trial.told}")
        write_json(folder / DATA, [trial._asdict() for trial in found])
        summary = summaries(found)
        (folder / TABLE).write_text(markdown(summary, found), encoding="utf-8")
        console.table(f"{self.trials} trials of each method", COLUMNS, rows(summary))
        return {"trials": len(found), "summaries": [one._asdict() for one in summary]}

    def _trials(self, console: Any) -> Iterator[Trial]:
        for number in range(1, self.trials + 1):
            for method in self.methods:
                for world in self.worlds:
                    yield Trial.of(world, method, number, self._measured(world, method, number, console).metrics)

    def _measured(self, world: str, method: str, number: int, console: Any) -> Artifact:
        seed, runs = self.iterate.seed + number - 1, Path(self.iterate.home)
        chain = replace(self.iterate, real=self.worlds[world], grounding=self.methods[method], seed=seed, accept=True)
        home = runs / world / method / f"trial_{number:02d}"
        if chain.learned:
            found = chain.search(home / "optimize", chain.trained(home, None, seed, console), None, seed, console)
        else:
            shared = runs / "sim" / method / f"trial_{number:02d}"
            found = chain.search(shared / "optimize", chain.grounding, None, seed, console)
        return chain.measure(home / "evaluate", found, seed, console)
