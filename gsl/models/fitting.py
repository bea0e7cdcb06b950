"""Fitting a multilayer perceptron with torch, which is needed nowhere else: Adam, minibatches, early stopping."""

from __future__ import annotations

import numpy as np
import torch

from gsl.core.scaling import scaling
from gsl.models.config import ModelConfig
from gsl.models.network import Network, Samples, unscaled

Pair = tuple[torch.Tensor, torch.Tensor]


def fit_mlp(training: Samples, validation: Samples, config: ModelConfig, *, seed: int) -> Network:
    """Return the network of the epoch with the least squared error on `validation`; the same seed, the same weights.

    The caller's number of threads and torch's random state are as before afterwards.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return _fitted(training, validation, config)
    finally:
        torch.set_num_threads(threads)


def _fitted(training: Samples, validation: Samples, config: ModelConfig) -> Network:
    given, wanted = scaling(training[0]), scaling(training[1])
    known, unseen = ((_tensor(given.apply(x)), _tensor(wanted.apply(y))) for x, y in (training, validation))
    network = _network((training[0].shape[1], *config.hidden, training[1].shape[1]))
    _descend(network, known, unseen, config)
    affine = [layer for layer in network if isinstance(layer, torch.nn.Linear)]
    layers = [(_array(layer.weight), _array(layer.bias)) for layer in affine]
    return unscaled(layers, given, wanted)


def _descend(network: torch.nn.Sequential, training: Pair, validation: Pair, config: ModelConfig) -> None:
    """Leave the network with the weights of its best epoch."""
    adam = torch.optim.Adam(network.parameters(), lr=config.rate, weight_decay=config.decay)
    best, weights, without_progress = np.inf, {}, 0
    for _ in range(config.epochs):
        for chosen in torch.split(torch.randperm(len(training[0])), config.batch):
            adam.zero_grad()
            _loss(network, training[0][chosen], training[1][chosen]).backward()  # type: ignore[no-untyped-call]
            adam.step()
        with torch.no_grad():
            loss = _loss(network, *validation).item()
        without_progress += 1
        if loss < best:
            best, without_progress = loss, 0
            weights = {name: value.clone() for name, value in network.state_dict().items()}
        if without_progress == config.patience:
            break
    network.load_state_dict(weights or network.state_dict())


def _loss(network: torch.nn.Sequential, inputs: torch.Tensor, targets: torch.Tensor) -> torch.Tensor:
    return torch.nn.functional.mse_loss(network(inputs), targets)


def _network(widths: tuple[int, ...]) -> torch.nn.Sequential:
    layers: list[torch.nn.Module] = []
    for wide, narrow in zip(widths[:-1], widths[1:], strict=True):
        layers += [torch.nn.Linear(wide, narrow), torch.nn.Tanh()]
    return torch.nn.Sequential(*layers[:-1])


def _tensor(values: np.ndarray) -> torch.Tensor:
    return torch.as_tensor(values, dtype=torch.float32)


def _array(values: torch.Tensor) -> np.ndarray:
    array: np.ndarray = values.detach().double().numpy()
    return array
