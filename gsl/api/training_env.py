"""The grounded simulator as a gymnasium environment, for training in a loop of the user's own."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from gsl.api.components import make_grounding, make_policy, make_task, make_world
from gsl.core.described import restore
from gsl.core.interfaces import SIM, Grounding, Policy, PolicyRun, Task, World
from gsl.core.layout import Layout
from gsl.core.validation import make
from gsl.errors import ArtifactError, ConfigError
from gsl.grounding.diagnosis_file import read_diagnosis
from gsl.grounding.effects import switch_on
from gsl.grounding.none import NoGrounding
from gsl.policies.outside import Outside
from gsl.policies.policy import size
from gsl.policies.sb3 import Sb3Policy
from gsl.policies.wired import Spaces, WiredEnv
from gsl.policies.wiring import Wiring, check_joints
from gsl.rollout.rl_env import GroundedSimulator
from gsl.rollout.rollout import Scenario
from gsl.storage.artifact import Artifact
from gsl.storage.references import load
from gsl.tasks.own_reward import OwnReward
from gsl.worlds.gymnasium import GymnasiumWorld

KINDS = ("iterate", "optimize", "diagnose")


def grounded_env(
    run: str | None = None,
    *,
    world: World | str | None = None,
    task: Task | str | None = None,
    policy: Policy | str | None = None,
    grounding: Grounding | str | None = None,
    wiring: Wiring | Mapping[str, Any] | None = None,
    envs: int | None = None,
    trust: str | Collection[str] = (),
) -> Any:
    """Return the grounded simulator as an environment that any trainer takes.

    Observations and actions are those of the environment that was wrapped, in its own units. Of a robot they are
    those of the policy's wiring; without one, the whole observation and desired joint positions [rad].

    Args:
        run: Of `gsl iterate`, `optimize` or `diagnose`: its simulator with its grounding, task and policy.
        world: A simulator in place of the run's.
        task: What is rewarded; that of the run, or the environment's own reward.
        policy: Whose wiring says what is observed and done, and where a robot starts.
        grounding: In place of the run's.
        wiring: Of a policy that is still to be trained, as in its yaml file.
        envs: How many side by side, as a `gymnasium.vector.VectorEnv`; none for a single environment.
        trust: Modules whose code the run's files may name.

    Raises:
        ConfigError: A part is missing or does not fit.
        ArtifactError: There is no such run.
    """
    for name, part, kind in (("world", world, World), ("task", task, Task), ("grounding", grounding, Grounding)):
        if not (part is None or isinstance(part, str)) and (isinstance(part, type) or not isinstance(part, kind)):
            raise ConfigError(name, f"is no {name}; gsl.make_{name} makes one", given=str(part))
    if not (envs is None or (isinstance(envs, int | np.integer) and envs >= 1)):
        raise ConfigError("envs", "is how many environments stand side by side, 1 at least", given=str(envs))
    trusted = (trust,) if isinstance(trust, str) else tuple(trust)
    wired = make(Wiring, wiring, where="wiring") if isinstance(wiring, Mapping) else wiring
    actor = policy if wired is None else _Untrained(wired)
    simulator, own, spaces = _simulator(run, world, task, actor, grounding, trusted)

    def env() -> gymnasium.Env:
        plain = simulator.env()
        return plain if own is None else WiredEnv(plain, own, simulator.layout, spaces)

    return env() if envs is None else gymnasium.vector.SyncVectorEnv(int(envs) * [env])


def _simulator(
    run: str | None,
    world: World | str | None,
    task: Task | str | None,
    policy: Policy | str | None,
    grounding: Grounding | str | None,
    trust: tuple[str, ...],
) -> tuple[GroundedSimulator, Wiring | None, Spaces | None]:
    made, settled = _of_run(run, trust)
    world = make_world(world) if isinstance(world, str) else world or made.get("world")
    task = make_task(task) if isinstance(task, str) else task or made.get("task")
    policy = make_policy(policy) if isinstance(policy, str) else policy or made.get("policy") or _Untrained()
    grounding = make_grounding(grounding) if isinstance(grounding, str) else grounding or made.get("grounding")
    if world is None:
        raise ConfigError("world", "is missing; name a run, or give a world of gsl.make_world")
    if task is None and not isinstance(world, GymnasiumWorld):
        raise ConfigError("task", "is missing; a robot has no reward of its own: task='walk', or one of gsl.make_task")
    policy = size(policy, world)
    scenario = Scenario(world, task or OwnReward(), policy, SIM, grounding or NoGrounding()).prepare(settled)
    simulator = GroundedSimulator(scenario, policy.initial)
    own = policy.wiring if isinstance(policy, Outside | _Untrained) else None
    if own is not None:
        check_joints(own, simulator.layout)
        return simulator, own, _spaces(policy, world)
    return (simulator, Wiring(), _spaces(policy, world)) if simulator.layout.states else (simulator, None, None)


def _of_run(run: str | None, trust: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the parts of a run by name, and what its search has settled."""
    if run is None:
        return {}, {}
    artifact = _artifact(run)
    parts = {
        name: artifact.config[name] for name in ("world", "task", "policy", "grounding") if name in artifact.config
    }
    made: dict[str, Any] = {name: restore(part, trust=trust, where=name) for name, part in parts.items()}
    if artifact.manifest.kind == "diagnose":
        sim = restore(artifact.config["sim"], trust=trust, where="sim")
        return {"world": switch_on(sim, read_diagnosis(str(artifact.folder), "diagnose"))}, {}
    return made, artifact.metrics


def _artifact(run: str) -> Artifact:
    problem: ArtifactError | None = None
    for kind in KINDS:
        try:
            artifact = load(run, kind)
        except ArtifactError as error:
            problem = problem or error
            continue
        if kind == "iterate":
            last = artifact.folder.parent / f"iteration_{int(artifact.metrics['iterations']):02d}"
            return load(str(last / "optimize"), "optimize")
        return artifact
    assert problem is not None, "some kind was tried"
    raise problem


def _spaces(policy: Policy, world: World) -> Spaces | None:
    """Return the spaces that a network was trained with, or those of the user's environment; None for the wiring's."""
    if isinstance(policy, Sb3Policy):
        model = policy.network().model
        return model.observation_space, model.action_space
    if isinstance(policy, Outside | _Untrained) and policy.wiring not in (None, Wiring()):
        return None
    if isinstance(world, GymnasiumWorld):
        inside = world.make().unwrapped_env
        if isinstance(inside.observation_space, gymnasium.spaces.Box):
            return inside.observation_space, inside.action_space
    return None


@dataclass(frozen=True)
class _Untrained:
    """A policy that does not exist yet: it says where a robot starts, its pose, and nothing else."""

    wiring: Wiring | None = None
    names = ()
    initial = np.zeros(0)
    scale = np.zeros(0)

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return the pose [rad], shape (n_joints,)."""
        return np.zeros(0) if layout.states else (self.wiring or Wiring()).stance(layout)

    def start(self, parameters: np.ndarray, layout: Layout) -> PolicyRun:
        """Refuse to act."""
        raise ConfigError("policy", "is missing")
