"""A policy of Stable-Baselines3 and its contributions, as their zip; what is pickled in it is code that runs.

Its parameters are the weights that the action depends on, so that `optimizer=sb3` can go on from it. Exploration and
critics are none of these: they stay as they are in the file.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np

from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.policies.outside import File, Joints, OutsideFile, Ports, read_once
from gsl.policies.wired import Answer, WiredRun
from gsl.policies.wiring import Wiring

Algorithm = Literal["PPO", "A2C", "SAC", "TD3", "DDPG", "DQN", "TRPO", "TQC", "ARS"]
_CONTRIB = ("TRPO", "TQC", "ARS")
# Entries of the file's `data` that only one algorithm has, the most special first.
_TELLING: Mapping[str, Algorithm] = {
    "cg_max_steps": "TRPO", "top_quantiles_to_drop_per_net": "TQC", "delta_std": "ARS", "clip_range": "PPO",
    "ent_coef_optimizer": "SAC", "target_entropy": "SAC", "policy_delay": "TD3", "exploration_fraction": "DQN",
    "ent_coef": "A2C",
}  # fmt: skip


@component
class Sb3Policy(OutsideFile):
    """Acts deterministically, as `predict(observation, deterministic=True)` does."""

    file: File
    algorithm: Annotated[Algorithm | None, setting("that made it; none for what the file tells")] = None
    normalise: Annotated[str | None, setting("file of VecNormalize, if observations were normalised")] = None
    wiring: Annotated[Wiring, setting("what it observes, and what its outputs do")] = field(default_factory=Wiring)
    joints: Joints = ()

    @property
    def read_files(self) -> Mapping[str, Path]:
        """What it is read from."""
        return {**super().read_files, **({"normalise": Path(self.normalise)} if self.normalise else {})}

    def network(self) -> Sb3Network:
        """Read the zip, once a process."""
        reader = _Reader(self.algorithm, self.normalise)
        network: Sb3Network = read_once(reader, self.file)
        return network

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order: the weights that the action depends on."""
        return self.network().names

    @property
    def initial(self) -> np.ndarray:
        """The weights in the file."""
        return self.network().initial

    @property
    def scale(self) -> np.ndarray:
        """Size of a step in each parameter that is as bold as in any other: weights of wide layers are small."""
        return self.network().scale

    def start(self, parameters: np.ndarray, layout: Layout) -> WiredRun:
        """Return the policy at the beginning of an episode."""
        network = self.network()
        network.put(np.asarray(parameters, dtype=float))
        return WiredRun(self.wiring, layout, network.begin(), None, self.file)


class Weight(NamedTuple):
    """A tensor that the action depends on, by its name in the policy."""

    name: str
    tensor: Any


@dataclass(frozen=True)
class _Reader:
    algorithm: str | None
    normalise: str | None

    def __call__(self, path: Path) -> Sb3Network:
        algorithm = self.algorithm or read_algorithm(path)
        return Sb3Network(load(path, algorithm), Path(self.normalise) if self.normalise else None)


class Sb3Network:
    """A policy that was read; `put` gives it other weights.

    Args:
        model: The algorithm with its policy.
        normalise: File of the statistics that observations are normalised by.
    """

    def __init__(self, model: Any, normalise: Path | None) -> None:
        self.model, self._statistics = model, None if normalise is None else read_statistics(normalise)
        self._last = self.initial

    @property
    def ports(self) -> Ports:
        """The sizes of the spaces that it was trained with."""
        seen, acts = self.model.observation_space, self.model.action_space
        if not seen.shape or len(seen.shape) != 1:
            raise ConfigError("policy.file", f"observes {seen}; gsl has vectors", given=type(self.model).__name__)
        if not hasattr(acts, "low"):
            return Ports(seen.shape[0], int(getattr(acts, "n", 0)) or None)
        return Ports(seen.shape[0], acts.shape[0], (acts.low, acts.high))

    @cached_property
    def weights(self) -> tuple[Weight, ...]:
        """What the action depends on: the parameters that it has a gradient by."""
        return action_weights(self.model.policy)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all numbers in the weights, in order."""
        return tuple(f"{name}.{k}" for name, tensor in self.weights for k in range(tensor.numel()))

    @cached_property
    def initial(self) -> np.ndarray:
        """The weights as they were read, shape (n_parameters,)."""
        return flat_weights(self.weights)

    @cached_property
    def scale(self) -> np.ndarray:
        """One over the root of how many numbers a weight is summed with, shape (n_parameters,)."""
        wide = [tensor.shape[-1] if tensor.dim() > 1 else max(tensor.numel(), 1) for _, tensor in self.weights]
        sizes = [np.full(weight.tensor.numel(), n**-0.5) for weight, n in zip(self.weights, wide, strict=True)]
        return np.concatenate(sizes) if sizes else np.zeros(0)

    def put(self, parameters: np.ndarray) -> None:
        """Take other weights, shape (n_parameters,)."""
        if not np.array_equal(parameters, self._last):
            put_weights(self.weights, parameters)
            self._last = parameters.copy()

    def begin(self) -> Answer:
        """Return it; it has no memory."""
        return self._answer

    def _answer(self, observation: np.ndarray) -> np.ndarray:
        seen = observation if self._statistics is None else self._statistics(observation)
        action, _ = self.model.policy.predict(seen.astype(np.float32), deterministic=True)
        return np.atleast_1d(np.asarray(action, dtype=float))


def read_algorithm(path: Path) -> str:
    """Return the algorithm that wrote a file, without running what is in it.

    Raises:
        ConfigError: It is no such file, or does not tell.
    """
    try:
        with zipfile.ZipFile(path) as file:
            entries = json.loads(file.read("data"))
    except (zipfile.BadZipFile, KeyError, ValueError, OSError) as error:
        problem = f"is no policy of Stable-Baselines3 ({type(error).__name__}); write it with model.save(file)"
        raise ConfigError("policy.file", problem, given=str(path)) from error
    for entry, algorithm in _TELLING.items():
        if entry in entries:
            return algorithm
    names = ", ".join(get_args(Algorithm))
    raise ConfigError("policy.algorithm", f"the file does not tell; say which: {names}", given=str(path))


def load(path: Path, algorithm: str, **more: Any) -> Any:
    """Return the algorithm of a file, its policy in it.

    Raises:
        ConfigError: The libraries are not installed, or the file is of another algorithm or version.
    """
    library = "sb3_contrib" if algorithm in _CONTRIB else "stable_baselines3"
    try:
        import importlib

        kind = getattr(importlib.import_module(library), algorithm)
    except ImportError as error:
        raise ConfigError("policy", f"policy=sb3 needs gsl[rl]: pip install 'gsl[rl]' ({error})") from error
    try:
        return kind.load(str(path), device="cpu", **more)
    except Exception as error:  # whatever the pickles of another version raise
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise ConfigError("policy.file", f"cannot be read as {algorithm}: {reason}", given=str(path)) from error


def read_statistics(path: Path) -> Any:
    """Return the function that normalises an observation as a file of VecNormalize does.

    Raises:
        ConfigError: It is no such file.
    """
    import pickle

    try:
        kept = pickle.loads(path.read_bytes())  # noqa: S301  the user has trusted stable_baselines3's pickles
        mean, sd = kept.obs_rms.mean, np.sqrt(kept.obs_rms.var + kept.epsilon)
        limit, used = kept.clip_obs, kept.norm_obs
    except Exception as error:
        problem = f"is no file of VecNormalize ({type(error).__name__}: {error}); write it with env.save(file)"
        raise ConfigError("policy.normalise", problem, given=str(path)) from error
    return (lambda seen: np.clip((seen - mean) / sd, -limit, limit)) if used else np.asarray


def action_weights(policy: Any) -> tuple[Weight, ...]:
    """Return what the deterministic action of a policy depends on, in the policy's order."""
    import torch

    policy.set_training_mode(False)
    size = policy.observation_space.shape
    seen = torch.zeros((1, *size))
    policy.zero_grad()
    if hasattr(policy, "get_distribution"):
        spread = policy.get_distribution(seen).distribution
        outputs = spread.logits if hasattr(spread, "logits") else spread.mean
    elif hasattr(policy, "q_net"):
        outputs = policy.q_net(seen)
    else:
        outputs = policy._predict(seen, deterministic=True)
    outputs.sum().backward()
    named = [Weight(name, tensor) for name, tensor in policy.named_parameters() if tensor.grad is not None]
    policy.zero_grad()
    return tuple(named)


def flat_weights(weights: tuple[Weight, ...]) -> np.ndarray:
    """Return weights as parameters, shape (n_parameters,)."""
    parts = [tensor.detach().numpy().astype(float).ravel() for _, tensor in weights]
    return np.concatenate(parts) if parts else np.zeros(0)


def put_weights(weights: tuple[Weight, ...], parameters: np.ndarray) -> None:
    """Write parameters, shape (n_parameters,), into weights."""
    start = 0
    for _, tensor in weights:
        end = start + tensor.numel()
        tensor.data.copy_(tensor.new_tensor(parameters[start:end].reshape(tensor.shape)))
        start = end
