"""Learning a servo from a log in the air: numbers, then lags and network, judged and tested on held-out motions."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis.experiment import Experiment
from gsl.diagnosis.records import Pieces, pieces
from gsl.diagnosis.residual import Comparison
from gsl.models.servo import ServoModel, neutral, without_group
from gsl.training.frozen import freeze
from gsl.training.servo_members import ITERATIONS, Member, further
from gsl.training.servo_network import Progress, fit_network
from gsl.training.servo_numbers import fit_numbers
from gsl.worlds.held import Held, Windows, shares

WARM_UP, SCORED = 0.1, 0.4  # of a window to fit [s]: short, so that errors stay small enough to be frozen
WINDOWS = 160  # that are fitted, at most
MOST = 300  # iterations of the networks' fit
SAMPLES = 1000  # of a bootstrap over motions


@dataclass(frozen=True)
class Split:
    """Which windows of an experiment are for what; each an array of indices.

    Attributes:
        train: Fitted.
        judge: Choose when to stop.
        test: Are looked at once, for the report.
    """

    train: np.ndarray
    judge: np.ndarray
    test: np.ndarray


@dataclass(frozen=True)
class LearnedServo:
    """What was learned, and how far it is from the log before and after.

    Attributes:
        model: The servo.
        before, after: Gap of the test windows in noise floors, by group and `all`.
        worse: Groups whose law was dropped because it made held-out replays significantly worse.
        way: Of the optimisation.
        windows: How many were fitted, judged and tested.
        further: Further members of an ensemble.
    """

    model: ServoModel
    before: Mapping[str, float]
    after: Mapping[str, float]
    worse: tuple[str, ...]
    way: tuple[Progress, ...]
    windows: tuple[int, int, int]
    further: tuple[Member, ...] = ()


def split(exp: Experiment, *, labelled: bool) -> Split:
    """Divide a log: held-out motions judge and test in turn; where labels chose them, all test and others judge.

    Args:
        exp: The log.
        labelled: Whether the held-out windows were chosen by labels.
    """
    part = exp.train if labelled else exp.held_out
    names = np.unique(exp.pieces.record[part])
    every = 4 if labelled else 2
    chosen = np.isin(exp.pieces.record[part], names[::every])
    judge = part[chosen] if len(names) >= every else part[::every]
    rest = np.setdiff1d(part, judge)
    return Split(rest, judge, exp.held_out) if labelled else Split(exp.train, judge, rest)


def learn_servo(
    exp: Experiment, plant: Plant, step: float, *, labelled: bool, seed: int, threads: int, members: int = 1
) -> LearnedServo:
    """Learn the servo of a log on top of a plant.

    Args:
        exp: The log, of a robot in the air.
        plant: The robot with what is known of its servos.
        step: Physics period of the simulator that it is for [s].
        labelled: Whether the held-out motions were chosen by labels.
        seed: Of the first weights.
        threads: That replay side by side.
        members: Of an ensemble, the servo included.
    """
    parts, start = split(exp, labelled=labelled), neutral(plant, np.random.default_rng(seed))
    fitted = _fitted_windows(exp, parts)
    floor = np.hypot(exp.comparison.floor, exp.comparison.sway)
    with ThreadPoolExecutor(threads) as pool:

        def replay(plant: Plant, some: Pieces) -> np.ndarray:
            held, slices = Held.of(plant, step, exp.period), shares(len(some), threads)
            blocks = [Windows(*(part[one] for part in some.windows)) for one in slices]
            return np.concatenate(list(pool.map(held.replay, blocks)))[..., : len(floor)]

        def residuals(model: ServoModel, index: np.ndarray) -> np.ndarray:
            some = exp.pieces.chosen(index)
            return exp.comparison.residual(replay(model.on(plant), some), some)

        def level(model: ServoModel) -> float:
            return _level(residuals(model, parts.judge), exp.comparison)

        plain = Comparison(floor, np.zeros(len(floor), dtype=bool), np.zeros(len(floor)))
        numbers = fit_numbers(plant, start, lambda one: plain.residual(replay(one, fitted), fitted))
        data = freeze(plant, fitted, floor, exp.period)

        def fit(begun: ServoModel, some: np.ndarray, iterations: int) -> tuple[ServoModel, list[Progress]]:
            return fit_network(
                plant, begun, data, some, step, exp.period, judge=level, iterations=iterations, threads=threads
            )

        model, way = fit(numbers, np.arange(len(fitted)), MOST)
        before = residuals(start, parts.test)
        worse = _worse(exp, parts.test, before, residuals(model, parts.test), model)
        for name in worse:
            model = without_group(model, name)
        after = residuals(model, parts.test)
        others = further(
            members - 1,
            numbers,
            worse,
            lambda begun, some: fit(begun, some, ITERATIONS)[0],
            lambda one: _level(residuals(one, parts.test), exp.comparison),
            plant=plant,
            samples=fitted.samples,
            seed=seed,
        )
        more = tuple(others)
    sizes = len(fitted), len(parts.judge), len(parts.test)
    gaps = [_by_group(z, exp.comparison, model) for z in (before, after)]
    return LearnedServo(model, gaps[0], gaps[1], worse, tuple(way), sizes, more)


def _fitted_windows(exp: Experiment, parts: Split) -> Pieces:
    """Return short windows of the motions that are fitted; of a single motion those that the experiment has."""
    if not exp.by_record:
        return exp.pieces.chosen(parts.train)
    warm_up, scored = (max(1, round(part / exp.period)) for part in (WARM_UP, SCORED))
    short = pieces(exp.records, exp.robot, exp.period, warm_up=warm_up, scored=scored)
    index = np.flatnonzero(np.isin(short.record, exp.pieces.record[parts.train]))
    spread = np.unique(np.linspace(0, len(index) - 1, min(WINDOWS, len(index))).round().astype(int))
    return short.chosen(index[spread])


def _level(z: np.ndarray, how: Comparison) -> float:
    """Return the root mean square of residuals [floors]."""
    used = how.used(z.shape[1])
    return float(np.sqrt((z**2).sum() / (used.sum() * len(z))))


def _by_group(z: np.ndarray, how: Comparison, model: ServoModel) -> dict[str, float]:
    used, square = how.used(z.shape[1]), (z**2).sum(axis=(0, 1))
    masks = {name: model.group[: len(used)] == g for g, name in enumerate(model.groups)}
    masks = {"all": np.ones(len(used), dtype=bool)} | {name: mask for name, mask in masks.items() if mask.any()}
    return {name: float(np.sqrt(square[mask].sum() / (used[mask].sum() * len(z)))) for name, mask in masks.items()}


def _worse(
    exp: Experiment, test: np.ndarray, before: np.ndarray, after: np.ndarray, model: ServoModel
) -> tuple[str, ...]:
    """Return the groups whose squared residuals rise, significantly at 95 % by a bootstrap over motions."""
    sample, rng = exp.pieces.chosen(test).samples, np.random.default_rng(0)
    rise = ((after**2) - (before**2)).sum(axis=1)
    sums = np.array([rise[sample == k].sum(axis=0) for k in np.unique(sample)])
    drawn = sums[rng.integers(0, len(sums), (SAMPLES, len(sums)))].sum(axis=1)
    group = model.group[: rise.shape[1]]
    return tuple(
        name
        for g, name in enumerate(model.groups)
        if (group == g).any() and np.quantile(drawn[:, group == g].sum(axis=1), 0.025) > 0.0
    )


def document(learned: LearnedServo) -> dict[str, Any]:
    """Return what metrics say of a learned servo."""
    fitted, judged, tested = learned.windows
    return {
        "floors_before": learned.before["all"],
        "floors_after": learned.after["all"],
        "groups": {
            name: {"floors_before": learned.before[name], "floors_after": value, "kept": name not in learned.worse}
            for name, value in learned.after.items()
            if name != "all"
        },
        "windows": {"fitted": fitted, "judged": judged, "tested": tested},
        "iterations": len(learned.way),
        "members": [learned.after["all"], *(one.floors for one in learned.further)],
    }
