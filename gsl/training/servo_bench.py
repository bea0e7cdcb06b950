"""The bench on which servos compete: replays of a log's windows, and which of two servos held-out ones speak for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.experiment import Experiment
from gsl.diagnosis.records import Pieces, pieces
from gsl.diagnosis.residual import Comparison
from gsl.models.servo import ServoModel, with_group
from gsl.training.held_out_change import levels, relative_changes
from gsl.training.servo_numbers import fit_numbers
from gsl.training.servo_replays import Replays
from gsl.training.servo_walks import Walks
from gsl.worlds.servo_state import COMMANDS

LONG = (0.4, 1.6)  # warm-up and scored part of a window for numbers [s]: what a log does not show at first is forgotten
WINDOWS = 160  # that are fitted, at most
CHANCE = 0.025  # of a bootstrap, on either side
LIKELY = 0.9  # share of bootstraps in which numbers have to help: they are few, and each means something


@dataclass(frozen=True)
class ServoBench:
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
        return fit_numbers(self.replays.plant, self.start, self.fitted_residual(index), longest=self.longest)

    def numbers_of_some(self, index: np.ndarray, begun: ServoModel, rng: np.random.Generator) -> ServoModel:
        """Return a model with numbers fitted further, to motions of some windows that are drawn with replacement."""
        motion = self.exp.pieces.record[index]
        drawn = rng.choice(np.unique(motion), len(np.unique(motion)))
        residual = self.fitted_residual(index[np.isin(motion, drawn)])
        return fit_numbers(self.replays.plant, begun, residual, longest=self.longest, rounds=1)

    def numbers_with(self, walks: Walks, index: np.ndarray, begun: ServoModel) -> ServoModel:
        """Return a model with numbers fitted further, to motions in the air and on the ground together."""
        air = self.fitted_residual(index)

        def residual(model: ServoModel) -> np.ndarray:
            both = air(model), walks.residuals(walks.train, model)
            return np.vstack([one.reshape(-1, len(self.floor)) for one in both])

        return fit_numbers(self.replays.plant, begun, residual, longest=self.longest, rounds=1)

    def fitted_residual(self, index: np.ndarray) -> Callable[[ServoModel], np.ndarray]:
        """Return what numbers are fitted by: residuals of long windows [floors], by model."""
        some, floor = cut_windows(self.exp, index, LONG), self.floor
        plain = Comparison(floor, np.zeros(len(floor), dtype=bool), np.zeros(len(floor)))
        return lambda model: plain.residual(self.replays.replay(model, some), some)

    def residuals(self, index: np.ndarray, model: ServoModel) -> np.ndarray:
        """Return residuals of some windows [floors], shape (W, scored, n_joints)."""
        some = self.exp.pieces.chosen(index)
        return self.exp.comparison.residual(self.replays.replay(model, some), some)

    def level(self, index: np.ndarray, model: ServoModel) -> float:
        """Return the root mean square of residuals [floors]."""
        return self.by_group(index, model)["all"]

    def by_group(self, index: np.ndarray, model: ServoModel) -> dict[str, float]:
        """Return the root mean square of residuals by group, and of `all` [floors]."""
        z = self.residuals(index, model)
        return levels(z, self.exp.comparison.used(z.shape[1]), self.group, model.groups)

    @property
    def group(self) -> np.ndarray:
        """Group of each joint, shape (n_joints,)."""
        return self.start.group[: len(self.floor)]

    def change(self, index: np.ndarray, old: ServoModel, new: ServoModel) -> dict[str, np.ndarray]:
        """Return the relative change of the robust cost in bootstraps over motions, by group, shape (SAMPLES,) each."""
        sample = self.exp.pieces.chosen(index).samples
        before, after = (self.residuals(index, one) for one in (old, new))
        return relative_changes(before, after, sample, self.group, old.groups)

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

    def kept_on_foot(self, walks: Walks, index: np.ndarray, old: ServoModel, new: ServoModel) -> ServoModel:
        """Return the new servo, and the old one in groups that walks or motions in the air speak against.

        Args:
            walks: Their held-out windows have to come nearer.
            index: Of windows in the air, which must not get significantly worse.
            old: What it shall be better than.
            new: The new one.
        """
        test, air = walks.exp.held_out, self.change(index, old, new)
        before, after = (walks.residuals(test, one) for one in (old, new))
        sample = walks.exp.pieces.chosen(test).samples
        ground = relative_changes(before, after, sample, self.group, old.groups)
        for name in ground:
            if np.quantile(ground[name], LIKELY) >= 0.0 or np.quantile(air[name], CHANCE) > 0.0:
                new = with_group(new, old, name)
        return new


def cut_windows(exp: Experiment, index: np.ndarray, lengths: tuple[float, float]) -> Pieces:
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
        return exp.pieces.chosen(index)
    cut = pieces([exp.records[k] for k in chosen], exp.robot, exp.period, warm_up=warm_up, scored=scored)
    return cut.chosen(np.unique(np.linspace(0, len(cut) - 1, min(WINDOWS, len(cut))).round().astype(int)))
