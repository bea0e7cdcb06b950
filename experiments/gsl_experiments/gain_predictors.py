"""Which figure of a grounded simulator goes with what searches in it are worth: replay error, or how its legs yield?"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import rankdata

from gsl.report.markdown import table
from gsl_experiments.ledger_file import read
from gsl_experiments.replay import Replay
from gsl_experiments.trial import Trial

TRIALS = "trials.json"
STANDS = "legs"  # the group whose compliance decides whether a robot falls
FEWEST = 3  # methods of a world that can be ranked
DRAWS = 9_999  # of the permutation test: the least p-value is 0.0001
FIGURES = {"small replay error": "moving", "compliance transferred, legs": "yielding"}
OUTCOMES = {"gain": "gain", "share of stable winners": "stable"}
HEAD = "## What goes with gains and falls"


class Point(NamedTuple):
    """A method in a real world, means over its trials.

    Attributes:
        world, method: What was tried.
        moving: Joints' replay error after 0.2 s, less than 0: the greater the better [deg].
        yielding: `Replay.nearness` of the legs.
        gain: Of the policy that a search in it returned [%].
        stable: Share of the generations' winners that stayed up on the real side.
    """

    world: str
    method: str
    moving: float
    yielding: float
    gain: float
    stable: float


def read_searches(files: Iterable[Path]) -> list[Trial]:
    """Return the trials of first iterations that some files hold, each once.

    Raises:
        ArtifactError: One of them holds something else.
    """
    rows = {key: made for file in files for key, made in read(file, Trial).items()}
    own = ({name: row[name] for name in Trial._fields if name in row} for made in rows.values() for row in made)
    trials = map(Trial.read, own)
    return [trial for trial in trials if trial.iteration == 1]


def points(rows: Sequence[Replay], trials: Sequence[Trial]) -> dict[str, list[Point]]:
    """Return by world the methods of which both studies have trials; of replays, those whose compliance was measured.

    Worlds with less than `FEWEST` of them are left out.
    """
    measured: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for row in rows:
        if (near := row.nearness(STANDS)) is not None:
            measured.setdefault((row.world, row.method), []).append((row.joints, near))
    by_world: dict[str, list[Point]] = {}
    for (world, method), own in measured.items():
        searches = [trial for trial in trials if (trial.world, trial.method) == (world, method)]
        gains = [trial.plausible_improvement for trial in searches if trial.plausible_improvement is not None]
        winners = sum(trial.winners for trial in searches)
        if gains and winners:
            error, near = np.mean(own, axis=0).tolist()
            stable = sum(trial.stable for trial in searches) / winners
            point = Point(world, method, -error, near, math.fsum(gains) / len(gains), stable)
            by_world.setdefault(world, []).append(point)
    return {world: own for world, own in by_world.items() if len(own) >= FEWEST}


def rank_correlations(
    first: Mapping[str, Sequence[float]], second: Mapping[str, Sequence[float]], rng: np.random.Generator
) -> tuple[dict[str, float], float]:
    """Return Spearman's rho within each world, and the two-sided p-value of their mean.

    The test permutes `second` among the methods of each world. Worlds in which one of the two does not vary have NaN
    and do not count.

    Args:
        first: Values of the methods, by world, each of shape (n,).
        second: The same.
        rng: Draws the permutations.
    """
    scores = {world: (_standard(first[world]), _standard(second[world])) for world in first}
    rho = {world: float(a @ b) for world, (a, b) in scores.items()}
    varying = [pair for world, pair in scores.items() if np.isfinite(rho[world])]
    if not varying:
        return rho, np.nan
    observed = np.mean([a @ b for a, b in varying])
    drawn = np.mean([rng.permuted(np.tile(b, (DRAWS, 1)), axis=1) @ a for a, b in varying], axis=0)
    as_large = int(np.sum(np.abs(drawn) >= abs(observed) - 1e-12))
    return rho, (1 + as_large) / (1 + DRAWS)


def predictors(rows: Sequence[Replay], trials: Sequence[Trial], seed: int) -> str:
    """Return as a section which figure goes with gains and falls; nothing where too few methods are shared."""
    worlds = points(rows, trials)
    if not worlds:
        return ""
    shown = []
    for outcome, of in OUTCOMES.items():
        for figure, name in FIGURES.items():
            first, second = (
                {world: [getattr(point, part) for point in own] for world, own in worlds.items()} for part in (name, of)
            )
            rho, p = rank_correlations(first, second, np.random.default_rng(seed))
            mean = float(np.nanmean(list(rho.values()))) if np.isfinite(p) else np.nan
            cells = [_format(value, "+.2f") for value in (*rho.values(), mean)]
            shown.append((outcome, figure, *cells, _format(p, ".4f" if p < 0.01 else ".2f")))
    titles = ("goes with", "figure of the simulator", *worlds, "mean", "p")
    named = "; ".join(f"{world}: {', '.join(point.method for point in own)}" for world, own in worlds.items())
    count = sum(map(len, worlds.values()))
    about = (
        "Spearman's rank correlation over methods, within each real world; p is two-sided, by permuting the outcomes "
        f"within worlds, uncorrected. {count} points ({named}), each a mean over trials. The figure of the legs "
        "is the mean of what is closed joint by joint in stiffness and in strength, as far as these differ."
    )
    return f"{HEAD}\n\n{table(titles, shown)}\n{about}"


def _standard(values: Sequence[float]) -> np.ndarray:
    """Return ranks with mean 0 and norm 1, NaN where they do not vary, shape (n,)."""
    ranks = rankdata(values) - 0.5 * (len(values) + 1)
    norm = np.linalg.norm(ranks)
    scaled: np.ndarray = ranks / norm if norm > 0.0 else np.full(len(ranks), np.nan)
    return scaled


def _format(value: float, form: str) -> str:
    return f"{value:{form}}" if np.isfinite(value) else "-"
