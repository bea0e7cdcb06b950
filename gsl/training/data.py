"""What both training stages share: which trajectories they learn from, which they hold out, and how errors are told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gsl.core.interfaces import SIM
from gsl.core.other_commands import find_other_commands
from gsl.core.split import split
from gsl.core.trajectory import Batch, Trajectory
from gsl.core.transitions import usable
from gsl.core.words import several
from gsl.errors import TrajectoryError
from gsl.models.choice import Choice
from gsl.robots.catalogue import names, robot
from gsl.storage.trajectories import read
from gsl.storage.trajectory_contract import suggestion

HELDOUT, VALIDATION = "heldout.parquet", "validation.parquet"  # beside a model, as what nobody has seen
PI0 = "pi0"
FEWEST, WHY = 3, "to fit, to stop, to hold out"  # trajectories of a model
FALLS = "pi0_falls"  # share of its real episodes, told beside the trajectories that are held out


class Parts(NamedTuple):
    """A batch in three: to learn from; to stop, choose and calibrate by; and what nobody has seen."""

    training: Batch
    validation: Batch
    heldout: Batch

    def only(self, joints: Sequence[str]) -> Parts:
        """Return the same of some joints alone."""
        return Parts(*(part.only(joints) for part in self))


def labels(batch: Batch) -> list[str]:
    """Return the policy of each episode, pi0 where nothing is said."""
    return [entry.get("policy", PI0) for entry in batch.metadata.get("episodes") or [{}] * len(batch)]


def of_policy(batch: Batch, *, pi0: bool) -> tuple[Trajectory, ...]:
    """Return the episodes of pi0, or all others."""
    return tuple(episode for episode, label in zip(batch.episodes, labels(batch), strict=True) if (label == PI0) == pi0)


def parts(path: Path, *, other: str, share: float, seed: int) -> Parts:
    """Read a trajectory file and split it by trajectory; `other` is the role its world must not have played.

    Raises:
        TrajectoryError: The file breaks the contract, is of the other world or holds fewer than three trajectories.
    """
    batch = _of_role(path, other)
    _check_joints(path, batch)
    if (column := next(find_other_commands(batch), None)) is not None:
        raise TrajectoryError(path, "models of actions know positions alone; use gsl train-servo", column=column)
    if len(batch) < FEWEST:
        raise TrajectoryError(path, f"holds {several(len(batch), 'episode')}; {FEWEST} are the least: {WHY}")
    return split_batch(batch, share, seed)


def split_batch(batch: Batch, share: float, seed: int) -> Parts:
    """Split a batch of three trajectories at least."""
    rng = np.random.default_rng(seed)
    rest, heldout = _split(batch, share, rng)
    return Parts(*_split(rest, share, rng), heldout)


def earlier_batch(path: Path, newest: Batch) -> Batch:
    """Read the real trajectories of an earlier policy.

    Raises:
        TrajectoryError: The file breaks the contract, is simulated, or of another robot or rate than the newest ones.
    """
    batch = _of_role(path, other=SIM)
    for what, value, wanted in (
        ("of another robot", batch.metadata["robot"], newest.metadata["robot"]),
        ("of other joints", batch.joints, newest.joints),
        ("of another number of states", batch.states, newest.states),
        ("of another control period", batch.control_period, newest.control_period),
    ):
        if value != wanted:
            raise TrajectoryError(path, f"is {what} than the newest trajectories: {value}, not {wanted}")
    return batch


def aggregate(data: Parts, earlier: Sequence[Batch]) -> Parts:
    """Add the trajectories of earlier policies to those that models learn from; the other parts stay the newest's."""
    if not earlier:
        return data
    training = data.training
    episodes, entries = list(training.episodes), [{"policy": label} for label in labels(training)]
    for batch in earlier:
        episodes += batch.episodes
        entries += [{"policy": f"earlier_{label}"} for label in labels(batch)]
    metadata = {**training.metadata, "episodes": entries}
    return data._replace(training=replace(training, episodes=tuple(episodes), metadata=metadata))


def _of_role(path: Path, other: str) -> Batch:
    """Read trajectories of a world that has not played the `other` role."""
    batch = read(path)
    if batch.metadata.get("role") == other:
        wanted = "a forward model learns the real robot" if other == SIM else "an inverse model learns the simulator"
        raise TrajectoryError(path, f"was recorded with role={other}; {wanted}")
    return batch


def _check_joints(path: Path, batch: Batch) -> None:
    """Refuse joints that the robot of the file does not have, if it is one of ours."""
    name = batch.metadata["robot"]
    motors = robot(name).motors if name in names() and not batch.states else batch.joints
    for joint in batch.joints:
        if joint not in motors:
            raise TrajectoryError(
                path, f"the {name} has no such joint{suggestion(joint, motors)}", column=f"position.{joint}"
            )


def _split(batch: Batch, share: float, rng: np.random.Generator) -> tuple[Batch, Batch]:
    chosen = split([label == PI0 for label in labels(batch)], share, rng)
    return _some(batch, chosen.training), _some(batch, chosen.heldout)


def _some(batch: Batch, indices: Sequence[int]) -> Batch:
    entries = batch.metadata.get("episodes") or [{}] * len(batch)
    metadata = {**batch.metadata, "episodes": [entries[index] for index in indices]}
    return replace(batch, episodes=tuple(batch.episodes[index] for index in indices), metadata=metadata)


def degrees(errors: np.ndarray) -> float:
    """Return the root mean square of some angles [rad] in degrees."""
    return float(np.degrees(np.sqrt(np.mean(np.square(errors)))))


def degrees_by_joint(errors: np.ndarray, joints: tuple[str, ...]) -> dict[str, float]:
    """Return the same joint by joint, for errors of shape (N, n_joints)."""
    return {joint: degrees(errors[:, index]) for index, joint in enumerate(joints)}


def compute_r2(errors: np.ndarray, wanted: np.ndarray) -> float:
    """Return the share of the variance that is explained, R², over all joints; NaN where nothing varies."""
    varies = float(np.sum((wanted - wanted.mean(axis=0)) ** 2))
    return 1.0 - float(np.sum(errors**2)) / varies if varies > 0.0 else float("nan")


def check_lengths(path: Path, episodes: Sequence[Trajectory], needed: int) -> Sequence[Trajectory]:
    """Return the episodes that are at least `needed` ticks long before a fall.

    Raises:
        TrajectoryError: None is.
    """
    long = [episode for episode in episodes if usable(episode) >= needed]
    if not long:
        raise TrajectoryError(path, f"no episode of one part lasts {needed} ticks before a fall; collect longer ones")
    return long


def summary(choice: Choice, data: Parts) -> dict[str, Any]:
    """Return as metrics which variant was chosen, the scores, and how many trajectories it has learned from."""
    learned = len(data.training) + len(data.validation) * choice.config.learns_from_all
    variant = {"family": choice.config.family, "history": choice.config.history, "scores": dict(choice.scores)}
    return {**variant, "trajectories": learned}
