"""The bench on which servos compete: replays of a log's windows, and which of two servos held-out ones speak for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gsl.diagnosis.log.log import Log
from gsl.diagnosis.log.records import Pieces, cut_pieces
from gsl.diagnosis.log.residual import Comparison
from gsl.models.servo import ServoModel, with_groups
from gsl.training.frozen import freeze
from gsl.training.held_out_change import levels, relative_changes
from gsl.training.servo_network import Alike, Progress, fit_network
from gsl.training.servo_numbers import fit_numbers
from gsl.training.servo_replays import Replays
from gsl.training.servo_walks import Walks
from gsl.worlds.servo_state import COMMANDS

LONG = (0.4, 1.6)  # warm-up and scored part of a window for numbers [s]: what a log does not show at first is forgotten
WINDOWS = 160  # that are fitted, at most
CHANCE = 0.025  # of a bootstrap, on either side
LIKELY = 0.9  # share of bootstraps in which numbers have to help: they are few, and each means something


class Duel(NamedTuple):
    """Two servos, and windows that the new one was not fitted to."""

    windows: np.ndarray
    old: ServoModel
    new: ServoModel


@dataclass(frozen=True)
class ServoBench:
    """A log on which servos are compared, in windows of a second; `start` changes nothing."""

    exp: Log
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
        return fit_numbers(self.replays.plant, self.start, self.make_residual(index), longest=self.longest)

    def numbers_of_some(
        self, index: np.ndarray, begun: ServoModel, rng: np.random.Generator, walks: Walks | None
    ) -> ServoModel:
        """Return a model with numbers fitted further, to motions of some windows that are drawn, and to all walks."""
        motion = self.exp.pieces.record[index]
        drawn = rng.choice(np.unique(motion), len(np.unique(motion)))
        some = index[np.isin(motion, drawn)]
        if walks:
            return self.numbers_with(walks, some, begun)
        return fit_numbers(self.replays.plant, begun, self.make_residual(some), longest=self.longest, rounds=1)

    def numbers_with(self, walks: Walks, index: np.ndarray, begun: ServoModel) -> ServoModel:
        """Return a model with numbers fitted further, to motions in the air and on the ground together."""
        air = self.make_residual(index)

        def residual(model: ServoModel) -> np.ndarray:
            both = air(model), walks.residuals(walks.train, model)
            return np.vstack([part.reshape(-1, len(self.floor)) for part in both])

        return fit_numbers(self.replays.plant, begun, residual, longest=self.longest, rounds=1)

    def network(
        self, some: Pieces, judge: np.ndarray, begun: ServoModel, iterations: int
    ) -> tuple[ServoModel, list[Progress]]:
        """Return a model with lags, network and joints' own numbers fitted, and the way there.

        Args:
            some: What it is fitted to.
            judge: Windows that say when to stop.
            begun: Where to begin.
            iterations: At most.
        """
        replays, period = self.replays, self.exp.period
        alike = [
            Alike(plant, freeze(plant, some.take(part), self.floor, period))
            for plant, part in replays.group_by_plant(some)
        ]
        return fit_network(
            replays.plant, begun, alike, replays.step, period, replays.pool,
            judge=lambda model: self.level(judge, model), longest=self.longest, iterations=iterations,
        )  # fmt: skip

    def make_residual(self, index: np.ndarray) -> Callable[[ServoModel], np.ndarray]:
        """Return what numbers are fitted by: residuals of long windows [floors], by model."""
        some, floor = cut_windows(self.exp, index, LONG), self.floor
        plain = Comparison.plain(floor)
        return lambda model: plain.residual(self.replays.replay(model, some), some)

    def residuals(self, index: np.ndarray, model: ServoModel) -> np.ndarray:
        """Return residuals of some windows [floors], shape (W, scored, n_joints)."""
        some = self.exp.pieces.take(index)
        return self.exp.comparison.residual(self.replays.replay(model, some), some)

    def level(self, index: np.ndarray, model: ServoModel) -> float:
        """Return the root mean square of residuals [floors]."""
        return self.by_group(index, model)["all"]

    def by_group(self, index: np.ndarray, model: ServoModel) -> dict[str, float]:
        """Return the root mean square of residuals by group, and of `all` [floors]."""
        z = self.residuals(index, model)
        return levels(z, self.exp.comparison.count_residuals(z.shape[1]), self.group, model.groups)

    @property
    def group(self) -> np.ndarray:
        """Group of each joint, shape (n_joints,)."""
        return self.start.group[: len(self.floor)]

    def change(self, *duels: Duel) -> dict[str, np.ndarray]:
        """Return the relative change of the robust cost in bootstraps over motions, by group, shape (SAMPLES,) each."""
        sample = self.exp.pieces.take(np.concatenate([duel.windows for duel in duels])).samples
        before = np.concatenate([self.residuals(duel.windows, duel.old) for duel in duels])
        after = np.concatenate([self.residuals(duel.windows, duel.new) for duel in duels])
        return relative_changes(before, after, sample, self.group, self.start.groups)

    def refuse(self, duels: Sequence[Duel], likely: float, worth: float) -> set[str]:
        """Return the groups whose cost does not fall by a share.

        Args:
            duels: Looked at together; without any nothing is refused.
            likely: Share of the bootstraps in which the cost has to fall.
            worth: Share of the cost by which it has to.
        """
        changes = self.change(*duels) if duels else {}
        return {name for name, share in changes.items() if np.quantile(share, likely) >= -worth}

    def keep_on_foot(self, walks: Walks, index: np.ndarray, old: ServoModel, new: ServoModel) -> ServoModel:
        """Return the new servo, and the old one in groups that walks or motions in the air speak against.

        Args:
            walks: Their held-out windows have to come nearer.
            index: Of windows in the air, which must not get significantly worse.
            old: What it shall be better than.
            new: The new one.
        """
        ground, air = self.change_on_foot(walks, old, new), self.change(Duel(index, old, new))
        spoken = (name for name in ground if np.quantile(ground[name], LIKELY) >= 0.0 or is_worse(air[name]))
        return with_groups(new, old, spoken)

    def change_on_foot(self, walks: Walks, old: ServoModel, new: ServoModel) -> dict[str, np.ndarray]:
        """Return what `change` does, of held-out walks."""
        test = walks.exp.held_out
        before, after = (walks.residuals(test, model) for model in (old, new))
        return relative_changes(before, after, walks.exp.pieces.take(test).samples, self.group, old.groups)


def is_worse(change: np.ndarray) -> bool:
    """Whether a relative change of a cost in bootstraps, shape (SAMPLES,), is significantly above zero."""
    return bool(np.quantile(change, CHANCE) > 0.0)


def cut_windows(exp: Log, index: np.ndarray, lengths: tuple[float, float]) -> Pieces:
    """Return windows of another length of the same motions; the same ones of motions that are short or shared.

    Args:
        exp: The log.
        index: Of its windows.
        lengths: Warm-up and scored part [s].
    """
    chosen = np.unique(exp.pieces.record[index])
    shared = np.isin(np.delete(exp.pieces.record, index), chosen).any()  # with windows that are not to be fitted
    warm_up, scored = (max(1, round(part / exp.period)) for part in lengths)
    if shared or any(len(exp.records[k]) < warm_up + scored for k in chosen):
        return exp.pieces.take(index)
    cut = cut_pieces([exp.records[k] for k in chosen], exp.robot, exp.period, warm_up=warm_up, scored=scored)
    return cut.take(np.unique(np.linspace(0, len(cut) - 1, min(WINDOWS, len(cut))).round().astype(int)))
