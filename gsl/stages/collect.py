"""Collect trajectories of a policy, and of its neighbours, in a world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from gsl.core.console import Console
from gsl.core.described import describe
from gsl.core.interfaces import SIM, Policy, Task, World
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch, Trajectory
from gsl.core.unit import Unit
from gsl.core.words import several
from gsl.errors import ConfigError
from gsl.grounding.random_choice import exploration
from gsl.policies.outside import warn_of_wiring
from gsl.policies.policy import neighbour, size
from gsl.policies.programme import Piece, Programmed
from gsl.real_robot.errand import Errand, Order, answer_parents, ask
from gsl.report.collection_page import write_collection_page
from gsl.rollout.parallel import Job, Workers, trajectories
from gsl.rollout.programme import command_file, playing
from gsl.rollout.rollout import Scenario
from gsl.storage.policy_choice import PolicyChoice
from gsl.storage.trajectories import write
from gsl.validation.iteration_pictures import read_footfalls
from gsl.worlds.external import ExternalRobot
from gsl.worlds.slides import list_slides

FILE = "trajectories.parquet"


@component
class Collect:
    """`episodes` of the policy itself, then `neighbours` episodes of one perturbed policy each.

    A policy with a programme (programme.py) plays that instead, whatever the two numbers are.
    """

    kind: ClassVar[str] = "collect"

    world: Annotated[World, setting("where to collect")]
    task: Annotated[Task, setting("what ends an episode, and its reward")]
    policy: Annotated[Policy, setting("what acts")]
    role: Annotated[Literal["real", "sim"], setting("whose part the world plays")]
    episodes: Annotated[int, setting("episodes of the policy itself", ge=1)]
    neighbours: Annotated[int, setting("episodes of perturbed policies", ge=0)] = 0
    spread: Annotated[float, setting("size of the perturbation, in units of a parameter's scale", ge=0)] = 0.07
    action_noise: Annotated[
        float, setting("Gaussian noise on every action; where actions are choices, the chance of a random one", ge=0)
    ] = 0.0
    initial: Annotated[str | None, setting("policies file or artifact of the policy; none for its start values")] = None
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def __post_init__(self) -> None:
        """Tell the policy its world."""
        object.__setattr__(self, "policy", size(self.policy, self.world))
        if self.role == SIM and isinstance(self.world, ExternalRobot):
            raise ConfigError("world", "is a real robot, which cannot play the simulator's part")
        if self.world.layout.choices and self.action_noise > 1.0:
            noise = f"{self.action_noise:g}"
            raise ConfigError("action_noise", "is the chance of a random choice here, 1 at most", given=noise)

    def parents(self) -> Mapping[str, Path]:
        """Return the artifact that the parameters come from, the file that is played, a robot's answer, if any."""
        chosen = PolicyChoice(self.policy, self.initial).parents("initial")
        return {**chosen, **command_file(self.policy), **answer_parents(self.world)}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write one parquet file."""
        layout = self.world.layout
        warn_of_wiring(self.policy, layout, console)
        policy = playing(self.policy, layout)
        scenario = Scenario(self.world, self.task, policy, self.role, exploration(self.action_noise, layout))
        pieces = policy.programme if isinstance(policy, Programmed) else self._pieces()
        episodes = self._play(scenario, pieces, console)
        about = {
            "robot": getattr(self.world, "robot", getattr(self.world, "env_id", "")),
            "role": self.role,
            "source": "gsl collect",
            "seed": self.seed,
            "world": describe(self.world),
            "policy": describe(self.policy),
            "action_noise": self.action_noise,
            **({"slides": slides} if (slides := list_slides(self.world)) else {}),
            **({"cells": layout.cells, "choices": layout.choices} if layout.states else {}),
            "episodes": [
                {"policy": piece.label, "parameters": piece.parameters.tolist(), **piece.about} for piece in pieces
            ],
        }
        batch = Batch(_alike(episodes), layout.joints, layout.control_period, about)
        write(folder / FILE, batch)
        self._write_page(folder, batch, 0 if isinstance(policy, Programmed) else self.episodes)
        steps, own = sum(map(len, episodes)), [episode.value for episode in episodes[: self.episodes]]
        return {
            "episodes": len(pieces),
            "real_episodes": len(pieces) if self.role == "real" else 0,
            "steps": steps,
            "seconds": steps * layout.control_period,
            "falls": sum(episode.ended_in_a_fall for episode in episodes),
            "action_noise": self.action_noise,
            "value": None if isinstance(policy, Programmed) else float(np.mean(own)),
        }

    def _write_page(self, folder: Path, batch: Batch, own: int) -> None:
        walk = read_footfalls("the first episode", batch.episodes[0])
        unit, noisy = Unit.of(self.task), bool(self.action_noise)
        write_collection_page(folder, batch, own, unit, noisy=noisy, walk=walk, slides=batch.metadata.get("slides", ()))

    def _play(self, scenario: Scenario, pieces: Sequence[Piece], console: Console) -> list[Trajectory]:
        """Return the episodes, of a robot somewhere else from its answer."""
        seeds = [derive_seed(self.seed, self.kind, self.role, index) for index in range(len(pieces))]
        jobs = [Job(piece.parameters, seed) for piece, seed in zip(pieces, seeds, strict=True)]
        if not isinstance(self.world, ExternalRobot):
            with console.progress(len(jobs), f"collecting in the {self.role} world") as progress:
                return trajectories(scenario, jobs, workers=self.workers, progress=progress)
        orders = [Order(piece.label, job) for piece, job in zip(pieces, jobs, strict=True)]
        errand = Errand(
            "", f"Trajectories to learn from: {several(len(jobs), 'episode')}.", until_fall=False, logs=True
        )
        verdicts = ask(scenario, orders, errand, workers=self.workers, console=console)
        return [verdict.trajectory for verdict in verdicts if verdict is not None and verdict.trajectory is not None]

    def _pieces(self) -> tuple[Piece, ...]:
        """Return the episodes of the policy itself, then those of its neighbours."""
        parameters = PolicyChoice(self.policy, self.initial).parameters()
        rng = np.random.default_rng(derive_seed(self.seed, self.kind, self.role))
        near = [neighbour(self.policy, parameters, self.spread, rng) for _ in range(self.neighbours)]
        itself = [Piece("pi0", parameters, {})] * self.episodes
        return (*itself, *(Piece(f"neighbour_{index + 1:02d}", theta, {}) for index, theta in enumerate(near)))


def _alike(episodes: list[Trajectory]) -> tuple[Trajectory, ...]:
    """Let all episodes say what was carried out, if one does."""
    if all(episode.grounded_action is None for episode in episodes):
        return tuple(episodes)
    return tuple(
        episode if episode.grounded_action is not None else replace(episode, grounded_action=episode.action)
        for episode in episodes
    )
