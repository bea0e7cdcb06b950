"""Real trajectories around π0 that no model of a trial learns from, on which all its groundings are measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gsl.core.seeds import derived_seed
from gsl.core.trajectory import Batch
from gsl.stages.chain import Chain
from gsl.stages.collect import FILE, Collect
from gsl.stages.link import built
from gsl.storage.trajectories import read
from gsl.tasks.task import REAL
from gsl.worlds.external import asking

HELD_OUT = 12  # trajectories of neighbours, on which errors are measured
MEASURED = f"Joints are measured on {HELD_OUT} real trajectories off π0 more at most, the same for all of a trial."


def held_out(chain: Chain, place: Path, seed: int, console: Any) -> Batch:
    """Return them, collected at `place` if they are not there yet: one of π0, the others around it."""
    stage = Collect(
        world=asking(chain.real, place),
        task=chain.task,
        policy=chain.policy,
        role=REAL,
        episodes=1,
        neighbours=HELD_OUT,
        spread=chain.budget.spread,
        action_noise=chain.budget.real_action_noise,
        workers=chain.workers,
        seed=derived_seed(seed, "held out"),
    )
    return read(built(stage, place, console).folder / FILE)
