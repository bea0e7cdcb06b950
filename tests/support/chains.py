"""Links of a chain without the rest of it: for questions that no whole iteration has to be run for."""

from __future__ import annotations

from pathlib import Path

from gsl.commandline.composer import compose
from gsl.commandline.config import prepare, resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.core.console import Silent
from gsl.core.interfaces import Grounding
from gsl.stages.iterate import Iterate
from gsl.storage.artifact import Artifact


def read_iterate(*words: str) -> Iterate:
    """Return the iteration that `gsl iterate` with these words would run."""
    with open_hydra(None):
        stage = prepare(resolve(compose("iterate", list(words))))[0]
    assert isinstance(stage, Iterate)
    return stage


def train(iterate: Iterate, place: Path) -> Grounding:
    """Collect and train below a place as the first round does, and return the grounding, which is ready."""
    return iterate.chain.ready(place, iterate.grounding, None, iterate.seed, Silent())


def search(iterate: Iterate, place: Path) -> Artifact:
    """Check the grounding and optimise in it besides."""
    return iterate.chain.search(place / "optimize", train(iterate, place), None, iterate.seed, Silent())
