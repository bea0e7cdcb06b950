"""Goes on with a policy of Stable-Baselines3 by the algorithm that made it: PPO, SAC, TD3, A2C, TRPO and others."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any

import gymnasium
import numpy as np

from gsl.core.interfaces import Policy, Simulator
from gsl.core.interruption import hold_interrupts
from gsl.core.setting import component, setting
from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError
from gsl.policies.sb3 import Sb3Policy, action_weights, flat_weights, load, put_weights, read_algorithm
from gsl.policies.wired import WiredEnv


@component
class Sb3:
    """Loads the file, critics and all, puts in the weights of the start, and learns in the grounded simulator.

    Observations stay normalised as in the policy's own file of VecNormalize; its statistics do not move.
    """

    steps: Annotated[int, setting("steps in the simulator, in all", ge=1)]
    generations: Annotated[int, setting("how often the policy is kept", ge=1)] = 1
    envs: Annotated[int, setting("environments side by side", ge=1)] = 1
    settings: Annotated[
        Mapping[str, Any], setting("of the algorithm, in place of the file's, such as learning_rate")
    ] = field(default_factory=dict)

    @property
    def steps_taken(self) -> int:
        """Steps that it is asked to take; an algorithm may round them up to whole rollouts."""
        return self.generations * max(self.steps // self.generations, 1)

    def learn(
        self,
        simulator: Simulator,
        policy: Policy,
        parameters: np.ndarray,
        seed: int,
        *,
        bold: bool,
        advance: Callable[[int], None],
    ) -> Iterator[np.ndarray]:
        """Yield the policy after each generation, see `Learner`.

        Raises:
            ConfigError: The policy is none of Stable-Baselines3, or a setting is none of its algorithm.
        """
        if not isinstance(policy, Sb3Policy):
            raise ConfigError("optimizer", "goes on with a policy=sb3; trpo is for mlp, cma_es for the others")
        with hold_interrupts():
            import torch
            from stable_baselines3.common.logger import Logger
            from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
        self._check_settings(Path(policy.file))
        trained = policy.network().model
        spaces = trained.observation_space, trained.action_space
        layout = simulator.layout

        def make_env() -> gymnasium.Env:
            return WiredEnv(simulator.env(), policy.wiring, layout, spaces)

        env: Any = DummyVecEnv(self.envs * [make_env])
        if policy.normalise:
            env = VecNormalize.load(policy.normalise, env)
            env.training = False
        threads, left = torch.get_num_threads(), [self.steps_taken]
        torch.set_num_threads(1)

        def count(*_: Any) -> bool:
            step = min(self.envs, left[0])
            left[0] -= step
            advance(step)
            return True  # goes on

        try:
            model = load(
                Path(policy.file), policy.algorithm or read_algorithm(Path(policy.file)), env=env, **self.settings
            )
            model.set_logger(Logger(None, []))  # the library's own would leave a folder behind
            model.set_random_seed(seed)
            weights = action_weights(model.policy)
            put_weights(weights, parameters)
            if hasattr(model, "actor_target"):
                model.actor_target.load_state_dict(model.actor.state_dict())
            for _ in range(self.generations):
                model.learn(max(self.steps // self.generations, 1), count, reset_num_timesteps=False)
                yield flat_weights(weights)
        finally:
            env.close()
            torch.set_num_threads(threads)

    def _check_settings(self, path: Path) -> None:
        with zipfile.ZipFile(path) as file:
            names = json.loads(file.read("data"))
        for name in self.settings:
            if name not in names:
                problem = f"this algorithm has no such setting{did_you_mean(name, names)}"
                raise ConfigError(f"optimizer.settings.{name}", problem)
