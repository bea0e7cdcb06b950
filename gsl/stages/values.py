"""Values of a fixed set of policies in one world: how a simulator, grounded or not, ranks what the real world ranks."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.console import Console
from gsl.core.interfaces import REAL, Grounding, Policy, Task, World
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.core.statistics import rank_correlation
from gsl.grounding.preparation import parents_of
from gsl.policies.policy import neighbour
from gsl.rollout.parallel import Job, Workers, episodes
from gsl.rollout.rollout import Scenario
from gsl.storage.artifact import Artifact
from gsl.storage.documents import write_json

FILE = "values.json"


@component
class Values:
    """One episode of each of `count` policies: the start parameters, each moved by a Gaussian of `spread`.

    A fall is worth 0, as in the real world.
    """

    kind: ClassVar[str] = "values"

    world: Annotated[World, setting("where they are measured")]
    task: Annotated[Task, setting("what is measured")]
    policy: Annotated[Policy, setting("family of the policies")]
    grounding: Annotated[Grounding, setting("what stands between action and world")]
    found: Annotated[Mapping[str, Any], setting("what a search settled of the grounding: alpha, x, width")]
    count: Annotated[int, setting("policies", ge=3)] = 40
    spread: Annotated[float, setting("of the policies, in units of a parameter's scale", gt=0)] = 0.12
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def parents(self) -> Mapping[str, Path]:
        """Return what the grounding is made of."""
        return parents_of(self.grounding)

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the values."""
        scenario = Scenario(self.world, self.task, self.policy, REAL, self.grounding).prepare(self.found)
        rng = np.random.default_rng(derive_seed(self.seed, self.kind))
        thetas = [neighbour(self.policy, self.policy.initial, self.spread, rng) for _ in range(self.count)]
        jobs = [Job(theta, derive_seed(self.seed, self.kind, index)) for index, theta in enumerate(thetas)]
        with console.progress(len(jobs), "measuring a fixed set of policies") as progress:
            done = episodes(scenario, jobs, workers=self.workers, progress=progress)
        write_json(folder / FILE, [episode.value for episode in done])
        return {"policies": self.count, "falls": sum(episode.fell for episode in done)}


def rank(simulated: Artifact, real: Artifact) -> float | None:
    """Return Spearman's correlation of two artifacts of the same policies, None if one of them ranks nothing."""
    values = [
        np.array(json.loads((artifact.folder / FILE).read_text(encoding="utf-8"))) for artifact in (simulated, real)
    ]
    correlation = rank_correlation(*values)
    return None if np.isnan(correlation) else correlation
