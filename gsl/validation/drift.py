"""Drift: how far policies have moved from the data that a grounding learned from; there it is guesswork."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gsl.core.checkpoint import read_checkpoint
from gsl.core.region import Region
from gsl.core.seeds import derive_seed
from gsl.core.trajectory import Trajectory
from gsl.core.transitions import transitions, usable
from gsl.errors import ArtifactError
from gsl.grounding.gat import LoadedTransformation
from gsl.rollout.rollout import Scenario, rollout
from gsl.storage.checkpoints import write_checkpoint

FILE, KIND = "region.safetensors", "region"


def write_region(folder: Path, region: Region) -> None:
    """Write where the forward model's data lie beside it."""
    write_checkpoint(
        folder / FILE,
        {"mean": region.mean, "whitening": region.whitening, "bound": np.array([region.bound])},
        {"kind": KIND},
    )


def read_region(folder: Path) -> Region:
    """Read where the forward model's data lie.

    Raises:
        ArtifactError: The file is missing or damaged.
    """
    arrays, _ = read_checkpoint(folder / FILE, kind=KIND)
    try:
        return Region(arrays["mean"], arrays["whitening"], float(arrays["bound"][0]))
    except (LookupError, TypeError, ValueError) as error:
        raise ArtifactError(folder / FILE, f"lacks a part ({error}); train the model again") from error


def drifts(scenario: Scenario, region: Region, policies: Mapping[str, np.ndarray], seed: int) -> dict[str, float]:
    """Return the share of ticks that each policy spends outside the data, in an episode without draws and noise.

    Args:
        scenario: With a `LoadedTransformation`.
        region: Where its data lie, as windows of its forward model.
        policies: Parameters by policy, each of shape (n_parameters,).
        seed: Of the episodes.
    """
    grounding = scenario.grounding
    assert isinstance(grounding, LoadedTransformation), "only learned groundings have data"
    scenario = replace(scenario, grounding=grounding.deterministic)
    env, shares, columns = scenario.make(), {}, scenario.world.layout.numbers(grounding.forward.joints)
    for index, (name, parameters) in enumerate(policies.items()):
        walked = rollout(scenario, env, parameters, derive_seed(seed, index)).only(columns)
        shares[name] = outside(grounding, region, [walked])
    env.close()
    return shares


def outside(grounding: LoadedTransformation, region: Region, episodes: Sequence[Trajectory]) -> float:
    """Return the share of the ticks of episodes, of the known joints, that lie outside; 1 if none fills a window."""
    history = grounding.forward.history
    long = [episode for episode in episodes if usable(episode) > history.span]
    return region.outside(transitions(long, history, 1, carried_out=False).windows) if long else 1.0
