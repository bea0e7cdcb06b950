"""Trust region policy optimisation (Schulman et al. 2015) through `sb3-contrib` (the paper's section 8.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated, Any

import numpy as np

from gsl.core.interfaces import Policy, Simulator
from gsl.core.interruption import hold_interrupts
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.policies.mlp import Mlp, vector_of


@component
class Trpo:
    """Learns an `mlp` policy; the best mean action is kept, exploration and critic are not.

    From start values it normalises observations and folds that into the first layer; a policy that was learned before
    has this in it. Rewards are normalised for the critic alone.
    """

    steps: Annotated[int, setting("steps in the simulator, in all", ge=1)]
    generations: Annotated[int, setting("how often the policy is kept", ge=1)] = 1
    rollout: Annotated[int, setting("steps between updates, of all environments together", ge=2)] = 2048
    envs: Annotated[int, setting("environments side by side: one pass of the network acts in all", ge=1)] = 8
    batch: Annotated[int, setting("samples in a step of the critic", ge=2)] = 128
    discount: Annotated[float, setting("of later rewards", gt=0, le=1)] = 0.99
    gae: Annotated[float, setting("lambda of the generalised advantage estimate", ge=0, le=1)] = 0.95
    kl: Annotated[float, setting("trust region, Kullback-Leibler divergence of an update", gt=0)] = 0.01
    damping: Annotated[float, setting("of the conjugate gradients", gt=0)] = 0.1
    conjugate: Annotated[int, setting("most steps of the conjugate gradients", ge=1)] = 15
    critic_rate: Annotated[float, setting("step of the critic's Adam", gt=0)] = 1e-3
    critic_updates: Annotated[int, setting("passes of the critic over a rollout", ge=1)] = 10
    exploration: Annotated[float, setting("first standard deviation of the actions, range -1 to 1", gt=0)] = 0.5

    def __post_init__(self) -> None:
        """Refuse batches, or environments, that leave a part of a rollout."""
        for name, parts in (("batch", self.batch), ("envs", self.envs)):
            if self.rollout % parts:
                raise ConfigError(f"optimizer.{name}", f"must divide the rollout of {self.rollout}", given=str(parts))

    @property
    def steps_taken(self) -> int:
        """Steps that it takes: whole rollouts, in every generation."""
        each = max(self.steps // self.generations, 1)
        return self.generations * -(-each // self.rollout) * self.rollout

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
            ConfigError: The policy is no network, or the libraries are not installed.
        """
        if not isinstance(policy, Mlp):
            raise ConfigError("optimizer", "TRPO improves a policy=mlp; cma_es is for the others")
        try:
            with hold_interrupts():
                import sb3_contrib
                import torch
                from stable_baselines3.common.logger import Logger
                from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
        except ImportError as error:
            raise ConfigError("optimizer", f"TRPO needs gsl[rl]: pip install 'gsl[rl]' ({error})") from error
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        env = VecNormalize(DummyVecEnv([simulator.env] * self.envs), norm_obs=bold, gamma=self.discount)

        def step(*_: Any) -> bool:
            advance(self.envs)
            return True  # goes on

        try:
            model = sb3_contrib.TRPO(
                "MlpPolicy",
                env,
                learning_rate=self.critic_rate,
                n_steps=self.rollout // self.envs,
                batch_size=self.batch,
                gamma=self.discount,
                gae_lambda=self.gae,
                target_kl=self.kl,
                cg_damping=self.damping,
                cg_max_steps=self.conjugate,
                n_critic_updates=self.critic_updates,
                seed=seed,
                device="cpu",
                policy_kwargs={
                    "net_arch": {"pi": list(policy.hidden), "vf": list(policy.hidden or (64, 64))},
                    **({} if policy.sizes[2] else {"log_std_init": float(np.log(self.exploration))}),
                },
            )
            model.set_logger(Logger(None, []))  # the library's own would leave a folder behind
            if not bold:
                _put_layers(model, policy.layers(parameters))
            for _ in range(self.generations):
                model.learn(max(self.steps // self.generations, 1), step, reset_num_timesteps=False)
                yield vector_of(_fold(_take_layers(model), env.obs_rms if bold else None, float(env.epsilon)))
        finally:
            env.close()
            torch.set_num_threads(threads)


def _affine(model: Any) -> list[Any]:
    """Return the actor's layers that have weights, in order."""
    hidden = [layer for layer in model.policy.mlp_extractor.policy_net if hasattr(layer, "weight")]
    return [*hidden, model.policy.action_net]


def _put_layers(model: Any, layers: list[tuple[np.ndarray, np.ndarray]]) -> None:
    for layer, (weight, bias) in zip(_affine(model), layers, strict=True):
        layer.weight.data.copy_(layer.weight.new_tensor(weight))
        layer.bias.data.copy_(layer.bias.new_tensor(bias))


def _take_layers(model: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    parts = [(layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in _affine(model)]
    return [(weight.astype(float), bias.astype(float)) for weight, bias in parts]


def _fold(
    layers: list[tuple[np.ndarray, np.ndarray]], seen: Any, epsilon: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the layers for observations as they are, given those for normalised ones."""
    if seen is None:
        return layers
    (weight, bias), *rest = layers
    sd = np.sqrt(seen.var + epsilon)
    return [(weight / sd, bias - weight @ (seen.mean / sd)), *rest]
