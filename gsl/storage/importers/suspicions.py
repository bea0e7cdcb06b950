"""What looks wrong in imported trajectories: units, swapped columns, channels that are stuck; told column by column."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gsl.core.series import Lag, lag, likeness
from gsl.core.trajectory import Trajectory
from gsl.storage.importers.assembly import Episode
from gsl.storage.signals.check import check_signals

MOVES = 0.02  # range of a command below which it tells nothing of what follows it [rad]
ALIKE = 0.8  # correlation above which a signal is taken to follow a command
FAR = 4.0 * np.pi  # beyond this an angle is hardly in radians [rad]
TICKS = 100.0  # whole numbers beyond this are ticks
DEGREES = (40.0, 80.0)  # a ratio between these is that of degrees and radians, 57.3
FASTER = 10.0  # times the slope of the positions that velocities may be
SLOW = 0.05  # slopes below are noise [rad/s]
SLOWEST, FASTEST = 1.0, 2e-4  # from one row to the next [s]
STUCK = 0.05  # share of the rows at one end, above which a channel is told to be saturated
SAME, BEYOND = 1e-6, 0.1  # of a range: what is no difference, and what is one
CONTRAST = 2e-3  # of correlations, from which on a lag is clear
MOSTLY = 0.75  # share of the contrast that has to be of negative lags before columns are called swapped
FOLLOWS, UNLIKE = 0.9, 0.5  # correlations above and below which a position follows a command, or does not
AS_FAR = 0.33  # of the command that it follows: a joint that is dragged along moves less
AGAINST = 3  # times as many episodes that say so as say the contrary
SENSELESS = ("wrap",)  # signals after which nothing sensible can follow: velocities, filters, replays
NONE = Lag(0.0, 0.0, 0.0)


class Suspicion(NamedTuple):
    """What looks wrong with one column; `refused` ones are not imported unless they are accepted."""

    column: str
    problem: str
    refused: bool


def suspicions(
    episodes: Sequence[Episode],
    lags: Sequence[Sequence[Lag]],
    turning: Collection[str] = (),
    sliding: Collection[str] = (),
) -> list[Suspicion]:
    """Return all of them.

    Args:
        episodes: Trajectories of the same joints.
        lags: Of each trajectory and joint, from command to position.
        turning: Joints of which the mapping says that they are in radians however far they turn.
        sliding: Joints whose positions it has in metres.
    """
    joints = episodes[0].joints
    suspicions = [*_time(episodes), *_order(episodes, lags), *_suspect_exchange(episodes)]
    for index, joint in enumerate(joints):
        suspicions += _joint(joint, index, episodes, endless=joint in turning, slides=joint in sliding)
    seen = {suspicion.column for suspicion in suspicions}
    signals = check_signals([episode.trajectory for episode in episodes], joints, dict.fromkeys(sliding, 1.0))
    said = [finding for finding in signals if not (len(finding.columns) == 1 and finding.columns[0] in seen)]
    return [
        *suspicions,
        *(
            Suspicion(finding.where, f"{finding.problem}; {finding.remedy}", finding.kind in SENSELESS)
            for finding in said
        ),
    ]


def lags_of(episode: Episode) -> list[Lag]:
    """Return how far each joint's position comes after its command; zero where the command does not move."""
    trajectory = episode.trajectory
    moving = [float(np.ptp(command)) > MOVES for command in trajectory.action.T]
    pairs = zip(trajectory.action.T, trajectory.position[:-1].T, moving, strict=True)
    return [lag(command, position, trajectory.time[:-1]) if moves else NONE for command, position, moves in pairs]


def measure_saturation(values: np.ndarray, command: np.ndarray) -> float:
    """Return the share of rows in which a channel is at one of its ends while the command goes on moving."""
    if np.ptp(values) == 0.0 or np.ptp(command) < MOVES:
        return 0.0
    shares = []
    for end in (values.min(), values.max()):
        there = np.abs(values - end) <= SAME * np.ptp(values)
        moving = np.ptp(command[there]) > BEYOND * np.ptp(command)
        shares.append(float(np.mean(there)) if moving else 0.0)
    return max(shares)


def measure_stops(position: np.ndarray, command: np.ndarray) -> float:
    """Return the share of rows in which a joint is at one of its ends while its command is well beyond that [rad].

    A joint that rests where its command rests, or turns round with it, is at no stop.
    """
    if np.ptp(position) == 0.0 or np.ptp(command) < MOVES:
        return 0.0
    same, beyond = SAME * np.ptp(position), BEYOND * np.ptp(command)
    ends = (
        (position <= position.min() + same) & (command < position - beyond),
        ((position >= position.max() - same) & (command > position + beyond)),
    )
    return max(float(np.mean(there)) for there in ends)


def _all(episodes: Sequence[Episode], name: str, index: int) -> np.ndarray:
    rows = [getattr(episode.trajectory, name)[:, index][: len(episode.trajectory)] for episode in episodes]
    return np.concatenate(rows)


def _time(episodes: Sequence[Episode]) -> Iterator[Suspicion]:
    steps = [float(np.median(episode.steps)) for episode in episodes]
    if max(steps) > SLOWEST or min(steps) < FASTEST:
        problem = f"rows are {max(steps):.3g} s apart; is time: {{unit: ...}} right? Stamps are taken to be in it"
        yield Suspicion("time", problem, True)


def _order(episodes: Sequence[Episode], lags: Sequence[Sequence[Lag]]) -> Iterator[Suspicion]:
    """Tell of positions that come before their commands."""
    least = 0.5 * min(float(np.median(episode.steps)) for episode in episodes)
    clear = [lag for row in lags for lag in row if is_clear(lag)]
    early = [lag for lag in clear if lag.seconds < -least]
    if early and sum(lag.contrast for lag in early) > MOSTLY * sum(lag.contrast for lag in clear):
        typical = 1e3 * -float(np.median([lag.seconds for lag in early]))
        problem = (
            f"comes {typical:.0f} ms before action: are the columns of commands and measurements swapped, or is the "
            "commands' clock ahead (mapping.command_offset)?"
        )
        yield Suspicion("position", problem, True)


def _suspect_exchange(episodes: Sequence[Episode]) -> Iterator[Suspicion]:
    """Tell of positions that follow another joint's command and not their own."""
    joints = episodes[0].joints
    for joint, other in find_exchanges([episode.trajectory for episode in episodes]).items():
        problem = f"follows action.{joints[other]} and not action.{joints[joint]}: are the columns of joints swapped?"
        yield Suspicion(f"position.{joints[joint]}", problem, True)


def find_exchanges(trajectories: Sequence[Trajectory]) -> dict[int, int]:
    """Return for each joint whose position is another's that other joint; episodes of like commands say nothing."""
    exchanges = {}
    for joint in range(trajectories[0].action.shape[1]):
        own = [_likeness(trajectory, joint, joint) for trajectory in trajectories]
        unlike = [trajectory for trajectory, alike in zip(trajectories, own, strict=True) if alike < UNLIKE]
        votes = np.zeros(trajectories[0].action.shape[1], dtype=int)
        for other in set(range(len(votes))) - {joint}:
            votes[other] = sum(
                _likeness(trajectory, other, joint) > FOLLOWS and _likeness(trajectory, other, other) < FOLLOWS
                for trajectory in unlike
            )  # where the other joint follows its own command as well, two commands are nearly equal, or one is a copy
        best = int(np.argmax(votes))
        like = (
            [trajectory for trajectory, alike in zip(trajectories, own, strict=True) if alike > FOLLOWS]
            if votes[best]
            else []
        )
        contrary = sum(_likeness(trajectory, best, joint) < UNLIKE for trajectory in like)
        if votes[best] and votes[best] >= AGAINST * contrary:
            exchanges[joint] = best
    return exchanges


def _likeness(trajectory: Trajectory, command: int, measured: int) -> float:
    """Return how much like a joint's command a position is; 0 where the command rests or it moves much less far."""
    action, position = trajectory.action[:, command], trajectory.position[:-1, measured]
    if np.ptp(action) < MOVES or (command != measured and np.std(position) < AS_FAR * np.std(action)):
        return 0.0
    return likeness(action, position, trajectory.time[:-1])


def is_clear(lag: Lag) -> bool:
    """Tell whether a lag can be believed: slow or periodic motions, and friction, leave many that do as well."""
    return lag.correlation > ALIKE and lag.contrast > CONTRAST


def _joint(joint: str, index: int, episodes: Sequence[Episode], *, endless: bool, slides: bool) -> Iterator[Suspicion]:
    action, position, velocity = (_all(episodes, name, index) for name in ("action", "position", "velocity"))
    for name, values in (("action", action), ("position", position)):
        reach = float(np.abs(values).max())
        if reach > FAR and not endless:
            whole = reach > TICKS and np.allclose(values, np.round(values))
            asked = "are these ticks (unit: ticks/4096, zero: 2048)?" if whole else "are these degrees (unit: deg)?"
            asked += f" One that turns so far: unit: {{{joint}: rad}}"
            said = f"m; are these millimetres (unit: {{{joint}: mm}})?" if slides else f"rad; {asked}"
            yield Suspicion(f"{name}.{joint}", f"reaches {reach:.4g} {said}", True)
            return
    yield from _ratio(joint, action, position)
    slopes = [np.gradient(episode.trajectory.position[:, index], episode.trajectory.time) for episode in episodes]
    size = max(float(np.sqrt(np.mean(np.concatenate(slopes) ** 2))), SLOW)
    if (own := float(np.sqrt(np.mean(velocity**2)))) > FASTER * size:
        unit = "mm/s" if slides else "deg/s or ticks/s"
        problem = f"is {own / size:.3g} times the slope of position.{joint}; is it in {unit}?"
        yield Suspicion(f"velocity.{joint}", problem, True)


def _ratio(joint: str, action: np.ndarray, position: np.ndarray) -> Iterator[Suspicion]:
    """Tell of a command and a position that are of different sizes or signs."""
    if np.ptp(action) < MOVES:
        return
    if np.ptp(position) == 0.0:
        yield Suspicion(f"position.{joint}", f"never changes, but action.{joint} does: another joint's column?", False)
        return
    a, b = action - action.mean(), position - position.mean()
    ratio, alike = float(np.std(b) / np.std(a)), float(np.mean(a * b) / (np.std(a) * np.std(b)))
    if abs(alike) > ALIKE and any(DEGREES[0] < scale < DEGREES[1] for scale in (ratio, 1.0 / ratio)):
        which = "position" if ratio > 1.0 else "action"
        other = "action" if ratio > 1.0 else "position"
        problem = f"moves {max(ratio, 1.0 / ratio):.3g} times as far as {other}.{joint}; is it in degrees (unit: deg)?"
        yield Suspicion(f"{which}.{joint}", problem, True)
    elif alike < -ALIKE:
        yield Suspicion(f"position.{joint}", f"moves against action.{joint}; is a sign: -1 missing?", False)
