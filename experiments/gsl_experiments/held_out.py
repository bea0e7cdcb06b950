"""Real trajectories around π0 that no model of a trial learns from, on which all its groundings are measured."""

from __future__ import annotations

from pathlib import Path

from gsl.core.console import Console
from gsl.core.interfaces import REAL, World
from gsl.core.seeds import derive_seed
from gsl.core.trajectory import Batch
from gsl.errors import ConfigError, GslError
from gsl.models.free_run import TICKS
from gsl.stages.chain_rounds import Chain
from gsl.stages.collect import FILE, Collect
from gsl.stages.iterate import Iterate
from gsl.stages.link import build_link
from gsl.storage.trajectories import read
from gsl.training.data import of_policy
from gsl.validation.check import REPLAYS
from gsl.validation.replay import PAST, Place, places

HELD_OUT = 12  # trajectories of neighbours, on which errors are measured
MEASURED = f"Joints are measured on at most {HELD_OUT} further real trajectories off π0, the same for all of a trial."


def check_first_iteration(iterate: Iterate) -> None:
    """Refuse what is not the first iteration from π0 as it is, which such a study is of."""
    if iterate.iterations != 1:
        raise ConfigError("iterate.iterations", "this study is of the first", given=str(iterate.iterations))
    if iterate.pretrained:
        raise ConfigError("iterate.pretrained", "this study begins with π0 as it is", given="true")


def check_robot(world: World, where: str) -> None:
    """Refuse a real world that has no joints; `where` is the setting that it is."""
    if world.layout.states:
        raise ConfigError(where, "is no robot; replays begin in a robot's real states")


def collect_held_out(chain: Chain, place: Path, seed: int, console: Console) -> Batch:
    """Return them, collected at `place` if they are not there yet: one of π0, the others around it."""
    stage = Collect(
        world=chain.real,
        task=chain.task,
        policy=chain.policy,
        role=REAL,
        episodes=1,
        neighbours=HELD_OUT,
        spread=chain.budget.spread,
        action_noise=chain.budget.real_action_noise,
        workers=chain.workers,
        seed=derive_seed(seed, "held out"),
    )
    return read(build_link(stage, place, console).folder / FILE)


def starts(held: Batch, chain: Chain) -> list[Place]:
    """Return where replays off π0 begin.

    Raises:
        GslError: All of these trajectories are too short.
    """
    begins = places(of_policy(held, pi0=False), chain.sim.layout, REPLAYS)
    if not begins:
        problem = f"none of {HELD_OUT} real trajectories off π0 has the {PAST + TICKS} ticks of a replay"
        raise GslError(f"{problem}; take a smaller budget.spread, or a longer task")
    return begins
