"""Learning a servo from a log in the air: numbers first, then lags and network, judged and tested on held-out motions.

A group of joints takes a step only if held-out motions say so: numbers, which are few, if these come nearer, a network
if they come nearer by a good share, significantly. Half of them also say when to stop, the others are for the report.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis.experiment import Experiment
from gsl.diagnosis.records import Pieces, pieces
from gsl.diagnosis.residual import Comparison, loss
from gsl.errors import InputError
from gsl.models.servo import ServoModel, neutral, with_group, without_group
from gsl.training.frozen import freeze
from gsl.training.servo_members import ITERATIONS, Member, further
from gsl.training.servo_network import Alike, Progress, fit_network
from gsl.training.servo_numbers import fit_numbers
from gsl.training.servo_replays import Replays
from gsl.worlds.servo_state import COMMANDS

SHORT = (0.1, 0.4)  # warm-up and scored part of a window for a network [s]: errors stay small enough to be frozen
LONG = (0.4, 1.6)  # the same for numbers: what a log does not show at first, such as friction's state, is forgotten
WINDOWS = 160  # that are fitted, at most
MOST = 300  # iterations of the network's fit
SAMPLES = 1000  # of a bootstrap over motions
CHANCE = 0.025  # of a bootstrap, on either side
LIKELY = 0.9  # share of bootstraps in which numbers have to help: they are few, and each means something
WORTH = 0.1  # of the cost that a network has to take: for less it is not let loose on motions that nobody has logged
WIDE = 10.0  # noise floors that a joint moves in a window, at least, to show what drives it: noise alone spans 6
LEAST_MOVING = 4  # windows in which a joint moves so far, at least


@dataclass(frozen=True)
class Split:
    """Which windows of an experiment are for what; each an array of indices.

    Attributes:
        train: Fitted.
        judge: Choose when to stop.
        test: Are for the report; with the judge they also say whether a group takes a step (`_Bench.kept`).
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
    of_motions = np.isin(exp.pieces.record[part], names[::every])
    judge = part[of_motions] if len(names) >= every else part[::every]
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
        threads: That replay side by side; the result does not depend on them.
        members: Of an ensemble, the servo included.

    Raises:
        InputError: The log shows too little motion to learn from.
    """
    _check_motion(exp)
    parts, start = split(exp, labelled=labelled), neutral(plant, np.random.default_rng(seed))
    with ThreadPoolExecutor(threads) as pool:
        bench = _Bench(exp, Replays(plant, step, exp.period, threads, pool), start)
        held = np.concatenate([parts.judge, parts.test])
        numbers = bench.kept(held, start, bench.numbers(parts.train), LIKELY, 0.0)
        some = _windows(exp, parts.train, SHORT)

        def fit(begun: ServoModel, index: np.ndarray, iterations: int) -> tuple[ServoModel, list[Progress]]:
            chosen = some.chosen(index)
            alike = [
                Alike(known, freeze(known, chosen.chosen(part), bench.floor, exp.period))
                for known, part in bench.replays.known(chosen)
            ]
            return fit_network(
                plant, begun, alike, step, exp.period, pool,
                judge=lambda model: bench.level(parts.judge, model), longest=bench.longest, iterations=iterations,
            )  # fmt: skip

        network, way = fit(numbers, np.arange(len(some)), MOST)
        model = bench.kept(held, numbers, network, 1.0 - CHANCE, WORTH)
        change = bench.change(parts.test, start, model)
        worse = tuple(name for name, share in change.items() if np.quantile(share, CHANCE) > 0.0)
        for name in worse:
            model = without_group(model, name)
        levels = [bench.by_group(parts.test, one) for one in (start, model)]
        others = further(
            members - 1, numbers, worse,
            lambda begun, index: fit(begun, index, ITERATIONS)[0], lambda one: bench.level(parts.test, one),
            plant=plant, samples=some.samples, seed=seed,
        )  # fmt: skip
        sizes = len(some), len(parts.judge), len(parts.test)
        return LearnedServo(model, levels[0], levels[1], worse, tuple(way), sizes, tuple(others))


@dataclass(frozen=True)
class _Bench:
    """A log on which servos are compared, in windows of a second; `start` changes nothing."""

    exp: Experiment
    replays: Replays
    start: ServoModel

    @property
    def floor(self) -> np.ndarray:
        """Of joints whose phase a fit takes as it comes, whether they shake or not [rad], shape (n_joints,)."""
        return np.hypot(self.exp.comparison.floor, self.exp.comparison.sway)

    @property
    def longest(self) -> float:
        """Delay of a target that servos remember [s]."""
        return (COMMANDS - 1) * self.exp.period

    def numbers(self, index: np.ndarray) -> ServoModel:
        """Return the start with numbers fitted to the motions of some windows."""
        some, floor = _windows(self.exp, index, LONG), self.floor
        plain = Comparison(floor, np.zeros(len(floor), dtype=bool), np.zeros(len(floor)))

        def residual(model: ServoModel) -> np.ndarray:
            return plain.residual(self.replays.replay(model, some), some)

        return fit_numbers(self.replays.plant, self.start, residual, longest=self.longest)

    def residuals(self, index: np.ndarray, model: ServoModel) -> np.ndarray:
        """Return residuals of some windows [floors], shape (W, scored, n_joints)."""
        some = self.exp.pieces.chosen(index)
        return self.exp.comparison.residual(self.replays.replay(model, some), some)

    def level(self, index: np.ndarray, model: ServoModel) -> float:
        """Return the root mean square of residuals [floors]."""
        return self.by_group(index, model)["all"]

    def by_group(self, index: np.ndarray, model: ServoModel) -> dict[str, float]:
        """Return the root mean square of residuals by group, and of `all` [floors]."""
        z, group = self.residuals(index, model), self.start.group[: len(self.floor)]
        used, square = self.exp.comparison.used(z.shape[1]), (z**2).sum(axis=(0, 1))
        masks = {name: group == g for g, name in enumerate(model.groups)}
        masks = {"all": np.ones(len(used), dtype=bool)} | {name: mask for name, mask in masks.items() if mask.any()}
        return {name: float(np.sqrt(square[mask].sum() / (used[mask].sum() * len(z)))) for name, mask in masks.items()}

    def change(self, index: np.ndarray, old: ServoModel, new: ServoModel) -> dict[str, np.ndarray]:
        """Return the relative change of the robust cost in bootstraps over motions, by group, shape (SAMPLES,) each."""
        sample, rng = self.exp.pieces.chosen(index).samples, np.random.default_rng(0)
        costs = [loss(self.residuals(index, one)).sum(axis=1) for one in (old, new)]
        sums = np.array([[cost[sample == k].sum(axis=0) for k in np.unique(sample)] for cost in costs])
        before, after = sums[:, rng.integers(0, sums.shape[1], (SAMPLES, sums.shape[1]))].sum(axis=2)
        group = self.start.group[: before.shape[1]]
        return {
            name: after[:, group == g].sum(axis=1) / before[:, group == g].sum(axis=1) - 1.0
            for g, name in enumerate(old.groups)
            if (group == g).any()
        }

    def kept(self, index: np.ndarray, old: ServoModel, new: ServoModel, sure: float, worth: float) -> ServoModel:
        """Return the new servo, and the old one in groups whose cost does not fall by a share.

        Args:
            index: Of windows that the new one was not fitted to.
            old: What it shall be better than.
            new: The new one.
            sure: Share of the bootstraps in which the cost has to fall.
            worth: Share of the cost by which it has to.
        """
        for name, share in self.change(index, old, new).items():
            if np.quantile(share, sure) >= -worth:
                new = with_group(new, old, name)
        return new


def _check_motion(exp: Experiment) -> None:
    """Refuse a log that shows nothing of its servos.

    Raises:
        InputError: Hardly a joint moves.
    """
    moved = np.ptp(exp.pieces.real[..., : len(exp.joints)], axis=1)
    least = WIDE * np.maximum(exp.noise.sd[: len(exp.joints)], exp.robot.encoder_step)
    if (moved > least).any(axis=1).sum() < LEAST_MOVING:
        raise InputError(
            f"the log's joints hardly move: by {1e3 * moved.max():.3g} mrad in a second at most, and less than "
            f"{WIDE:g} noise floors ({1e3 * least.min():.3g} mrad) is none; play motions, see `gsl collect task=excite`"
        )


def _windows(exp: Experiment, index: np.ndarray, lengths: tuple[float, float]) -> Pieces:
    """Return windows of another length of the same motions; the same ones where motions are short, or it is only one.

    Args:
        exp: The log.
        index: Of its windows.
        lengths: Warm-up and scored part [s].
    """
    chosen = np.unique(exp.pieces.record[index])
    warm_up, scored = (max(1, round(part / exp.period)) for part in lengths)
    if not exp.by_record or any(len(exp.records[k]) < warm_up + scored for k in chosen):
        return exp.pieces.chosen(index)
    cut = pieces([exp.records[k] for k in chosen], exp.robot, exp.period, warm_up=warm_up, scored=scored)
    return cut.chosen(np.unique(np.linspace(0, len(cut) - 1, min(WINDOWS, len(cut))).round().astype(int)))


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
        "members": [learned.after["all"], *(member.floors for member in learned.further)],
        "windows": {"fitted": fitted, "judged": judged, "tested": tested},
        "iterations": len(learned.way),
    }
