"""What looks wrong with a signal, in words and as data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from gsl.core.trajectory import Trajectory

MOVES = 0.02  # range of a command below which it shows nothing of what follows it [rad]
LISTED = 6  # joints that a sentence names


class Finding(NamedTuple):
    """One thing that is wrong with the signals of a log.

    Attributes:
        kind: `wrap`, `glitch`, `copy`, `frozen`, `stale`, `velocity`, `base_frame` or `speed`.
        columns: Of the trajectory file.
        joints: Whose they are; none of the base.
        problem: What is wrong.
        remedy: What to do.
        episode, row: Where it is first, counted from 0; None of what is wrong throughout.
        times: How often it is there.
    """

    kind: str
    columns: tuple[str, ...]
    joints: tuple[str, ...]
    problem: str
    remedy: str
    episode: int | None = None
    row: int | None = None
    times: int = 1

    @property
    def where(self) -> str:
        """Columns and the first place, in words."""
        shown = ", ".join(self.columns[:LISTED]) + (
            f" and {more} more" if (more := len(self.columns) - LISTED) > 0 else ""
        )
        return shown if self.row is None else f"{shown}, episode {self.episode}, row {self.row}"

    @property
    def sentence(self) -> str:
        """Where, what and what to do, in a line."""
        return f"{self.where}: {self.problem}; {self.remedy}"


class Place(NamedTuple):
    """One channel of one episode that shows something: which joint, and the row where it begins."""

    joint: int
    episode: int
    row: int


def first_places(places: Iterable[Place]) -> dict[int, list[Place]]:
    """Return the places of each joint, in order."""
    by_joint: dict[int, list[Place]] = {}
    for place in places:
        by_joint.setdefault(place.joint, []).append(place)
    return by_joint


def per_joint(
    kind: str, signal: str, places: Iterable[Place], joints: Sequence[str], problem: str, remedy: str
) -> list[Finding]:
    """Return one finding for each joint that has a place."""
    return [
        Finding(kind, (f"{signal}.{joints[k]}",), (joints[k],), problem, remedy, own[0].episode, own[0].row, len(own))
        for k, own in sorted(first_places(places).items())
    ]


def together(findings: Sequence[Finding], joints: Sequence[str]) -> list[Finding]:
    """Return findings that all joints of a log share as one, and others as they are."""
    alike: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in findings:
        alike.setdefault((finding.kind, finding.columns[0].partition(".")[0], finding.problem), []).append(finding)
    joined: list[Finding] = []
    for group in alike.values():
        if len(group) == len(joints) > 1:
            columns = tuple(column for finding in group for column in finding.columns)
            joined.append(
                group[0]._replace(columns=columns, joints=tuple(joints), times=sum(finding.times for finding in group))
            )
        else:
            joined += group
    return joined


def count(times: int) -> str:
    """Return how often something is there, in words."""
    return {1: "once", 2: "twice"}.get(times, f"{times} times")


def moves(episode: Trajectory, joint: int) -> bool:
    """Whether a joint's command moves in an episode."""
    command = episode.action[:, joint]
    return bool(command.max() - command.min() > MOVES)
