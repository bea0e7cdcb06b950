"""Fitting a multilayer perceptron with torch, which is needed nowhere else: Adam, minibatches, early stopping."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import torch

from gsl.core.scaling import scaling
from gsl.core.step_metrics import note_step
from gsl.models.config import ModelConfig
from gsl.models.free_run import Segments
from gsl.models.head import POINT, Head
from gsl.models.multi_step import MultiStep, answering, measure_travel, tensor
from gsl.models.network import Network, Samples, unscale

Loss = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]
LEAST_LOG_SD = -5.0  # in units of the targets' spread: where data are all but exact the likelihood has no end


def fit_mlp(
    training: Samples,
    validation: Samples,
    config: ModelConfig,
    *,
    seed: int,
    head: Head = POINT,
    pieces: tuple[Segments, Segments] | None = None,
) -> Network:
    """Return the network of the epoch with the least loss on `validation`; the same seed, the same weights.

    The loss is the squared error of a point, the negative log likelihood of a distribution; a Gaussian's fit weights
    each term by its variance to the power of `config.beta`. Given `pieces` of the same trajectories, a point's fit goes
    on with the multi-step loss on these.

    The caller's number of threads and torch's random state are as before afterwards.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return _fit(training, validation, config, head, pieces)
    finally:
        torch.set_num_threads(threads)


def _fit(
    training: Samples, validation: Samples, config: ModelConfig, head: Head, pieces: tuple[Segments, Segments] | None
) -> Network:
    input_scaling, output_scaling = scaling(training[0]), scaling(training[1])
    seen, unseen = (
        (tensor(input_scaling.apply(x)), tensor(output_scaling.apply(y))) for x, y in (training, validation)
    )
    network = _network((training[0].shape[1], *config.hidden, head.width(training[1].shape[1])))
    loss = _surprise(head) if head.draws else torch.nn.functional.mse_loss
    weighted = _surprise(head, config.beta) if head.likelihood == "gaussian" else loss
    _descend(
        network,
        len(seen[0]),
        config,
        lambda chosen: weighted(network(seen[0][chosen]), seen[1][chosen]),
        lambda: loss(network(unseen[0]), unseen[1]),
    )
    if pieces is not None:
        answer, scale = answering(network, input_scaling, output_scaling), measure_travel(pieces[0])
        fitted, judging = (MultiStep(part, scale) for part in pieces)
        _descend(network, len(fitted), config, partial(fitted.loss, answer), partial(judging.loss, answer))
    affine = [layer for layer in network if isinstance(layer, torch.nn.Linear)]
    layers = [(_array(layer.weight), _array(layer.bias)) for layer in affine]
    return unscale(layers, input_scaling, head.scaling(output_scaling))


def _descend(
    network: torch.nn.Sequential,
    samples: int,
    config: ModelConfig,
    descended: Callable[[torch.Tensor], torch.Tensor],
    judged: Callable[[], torch.Tensor],
) -> None:
    """Descend one loss, a minibatch of so many samples at a time, and keep the weights with the least of another.

    Args:
        network: Is left with these; as it was, if no epoch made it better.
        samples: Their number.
        config: Of the steps.
        descended: The loss of some samples, by index.
        judged: The loss that is looked at after each epoch.
    """
    adam = torch.optim.Adam(network.parameters(), lr=config.rate, weight_decay=config.decay)
    weights, without_progress = _weights(network), 0
    with torch.no_grad():
        best = np.nan_to_num(judged().item(), nan=np.inf)
    for epoch in range(config.epochs):
        for chosen in torch.split(torch.randperm(samples), config.batch):
            adam.zero_grad()
            descended(chosen).backward()  # type: ignore[no-untyped-call]
            adam.step()
        with torch.no_grad():
            loss = judged().item()
        note_step("network", epoch + 1, validation=loss)
        without_progress += 1
        if loss < best:
            best, weights, without_progress = loss, _weights(network), 0
        if without_progress == config.patience:
            break
    network.load_state_dict(weights)


def _weights(network: torch.nn.Sequential) -> dict[str, torch.Tensor]:
    return {name: value.clone() for name, value in network.state_dict().items()}


def _surprise(head: Head, beta: float = 0.0) -> Loss:
    """The negative log likelihood of scaled targets, per output, weighted by its variance to the power of `beta`."""
    k, logits = head.components, head.logits

    def loss(raw: torch.Tensor, targets: torch.Tensor) -> torch.Tensor:
        means, logs = raw[:, logits:].reshape(len(raw), 2, k, -1).unbind(1)
        normal = torch.distributions.Normal(means, logs.clamp(min=LEAST_LOG_SD).exp())
        each = normal.log_prob(targets[:, None])  # type: ignore[no-untyped-call]
        if beta:
            each = each * normal.scale.detach() ** (2.0 * beta)
        each = each.sum(dim=2)
        if logits:
            each = each + torch.log_softmax(raw[:, :logits], dim=1)
        return -torch.logsumexp(each, dim=1).mean() / targets.shape[1]

    return loss


def _network(widths: tuple[int, ...]) -> torch.nn.Sequential:
    layers: list[torch.nn.Module] = []
    for wide, narrow in zip(widths[:-1], widths[1:], strict=True):
        layers += [torch.nn.Linear(wide, narrow), torch.nn.Tanh()]
    return torch.nn.Sequential(*layers[:-1])


def _array(values: torch.Tensor) -> np.ndarray:
    array: np.ndarray = values.detach().double().numpy()
    return array
