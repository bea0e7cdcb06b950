"""Which windows of a log a servo is fitted to, which say when to stop, and which say what is kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.log.log import Log

LEAST_CONDITIONS = 3  # known of a log, of which one is left out: two others are the least to show how a servo depends


@dataclass(frozen=True)
class Split:
    """Which windows of an experiment are for what; each an array of indices.

    Attributes:
        train: Fitted.
        judge: Choose when to stop.
        test: Are for the report; with the judge they also say whether a group takes a step.
    """

    train: np.ndarray
    judge: np.ndarray
    test: np.ndarray

    @property
    def held(self) -> np.ndarray:
        """Windows that are not fitted."""
        return np.concatenate([self.judge, self.test])


def split(exp: Log, *, labelled: bool) -> Split:
    """Divide a log: held-out motions judge and test in turn; where labels chose them, all test and others judge.

    Args:
        exp: The log.
        labelled: Whether the held-out windows were chosen by labels.
    """
    if labelled:
        judge = _share(exp, exp.train, 4)
        return Split(np.setdiff1d(exp.train, judge), judge, exp.held_out)
    judge = _share(exp, exp.held_out, 2)
    return Split(exp.train, judge, np.setdiff1d(exp.held_out, judge))


def leave_out(exp: Log, parts: Split) -> list[Split]:
    """Return splits that leave out one known condition each, such as a firmware gain, and test on it.

    A servo learned at some gains is used at others. Motions held out at the same gains cannot say how far it holds.

    Args:
        exp: The log.
        parts: Its split; what only tests there is fitted here, unless it is left out.

    Returns:
        One for each condition; none for a log of fewer than LEAST_CONDITIONS.
    """
    kinds = [index for _, index in exp.pieces.alike]
    return [_without(exp, parts, index) for index in kinds] if len(kinds) >= LEAST_CONDITIONS else []


def _without(exp: Log, parts: Split, index: np.ndarray) -> Split:
    judge = np.setdiff1d(parts.judge, index)
    train = np.setdiff1d(np.concatenate([parts.train, parts.test]), index)
    if not judge.size:
        judge = _share(exp, train, 4)
        train = np.setdiff1d(train, judge)
    return Split(train, judge, index)


def _share(exp: Log, part: np.ndarray, every: int) -> np.ndarray:
    """Return the windows of every so many'th motion, repeats with it, or every so many'th window of few motions."""
    motion = np.array([repeat.motion for repeat in exp.repeats])[exp.pieces.record[part]]
    names = np.unique(motion)
    return part[np.isin(motion, names[::every])] if len(names) >= every else part[::every]
