"""The next experiment: the motion that best separates what a log leaves open, as a command file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.slides import levers
from gsl.diagnosis.angles import say, write_angle
from gsl.diagnosis.design.motions import Choice, ladder, motions
from gsl.diagnosis.design.questions import NOTHING, Question, find_hidden, find_rivals, find_twins
from gsl.diagnosis.design.rehearsal import Rehearsal
from gsl.diagnosis.settings import DesignSettings
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.zero_or_load import Droop, find_droops
from gsl.storage.commands import Commands, write_commands
from gsl.storage.diagnosis_report import COMMANDS

PAIR = ("zero_offset", "gravity_droop")
ON_GROUND = "any motion with the feet on the ground"


@dataclass(frozen=True)
class NextExperiment:
    """What to play next.

    Attributes:
        excitation: Its name, or what else to do.
        separates: Pairs of what it tells apart.
        episodes: Names and desired joint positions [rad], each of shape (T, n_joints); none if it cannot be played.
        why: In a sentence or two, with the expected log-odds.
    """

    excitation: str
    separates: tuple[tuple[str, ...], ...]
    episodes: tuple[tuple[str, np.ndarray], ...]
    why: str


def write_next_experiment(findings: Findings, robot: str, folder: Path) -> Mapping[str, Any] | None:
    """Write what to play next as a command file.

    Args:
        findings: The diagnosis.
        robot: Name of the robot, as a world has it.
        folder: Where.

    Returns:
        What the report says of it, None if the log leaves nothing open that a motion in the air would show.
    """
    log = findings.log
    ways = levers(log.robot)[: len(log.joints)]
    best = next_experiment(findings, [choice.scale(1.0 / ways) for choice in motions(robot, log.robot, log.period)])
    if best is None:
        return None
    about = {"excitation": best.excitation, "separates": best.separates, "why": best.why}
    if not best.episodes:
        return about | {"file": None}
    episodes = tuple((name, ways * targets) for name, targets in best.episodes)
    write_commands(folder / COMMANDS, Commands(log.robot.name, log.joints, log.period, episodes, about))
    return about | {"file": COMMANDS}


def next_experiment(findings: Findings, choices: Sequence[Choice]) -> NextExperiment | None:
    """Return the best of some motions; None if the log leaves nothing open, or nothing that any of them would show.

    Causes that cannot be told apart come first, then zeros that may be loads, then effects that the log cannot show.
    """
    unsure = tuple(droop for droop in find_droops(findings) if droop.separable)
    open_pairs, twins = find_rivals(findings), find_twins(findings)
    if unsure and not open_pairs and not twins:
        return _ladder(unsure, findings)
    questions = open_pairs or ([] if twins else find_hidden(findings))
    how = findings.options.design
    best = _best(questions, Rehearsal.of(findings, choices), choices, how) if questions else None
    return best or (_on_ground(twins) if twins else None)


def _best(
    questions: Sequence[Question], rehearsal: Rehearsal, choices: Sequence[Choice], how: DesignSettings
) -> NextExperiment | None:
    odds = np.array([rehearsal.log_odds(asked.truth, asked.rivals, loose=asked.loose) for asked in questions])
    period = rehearsal.log.period
    answered = np.minimum(odds, how.enough).sum(axis=0)
    quick = odds.sum(axis=0) / np.array([period * choice.ticks for choice in choices])
    best = max(range(len(choices)), key=lambda k: (round(answered[k], 6), quick[k]))
    asked = [k for k in range(len(questions)) if odds[k, best] >= how.worth]
    if not asked:
        return None
    choice, names = choices[best], tuple(questions[k].names for k in asked)
    return NextExperiment(choice.name, names, choice.episodes, _why(choice, names, odds[asked, best], period, how))


def _why(choice: Choice, names: Sequence[tuple[str, str]], odds: np.ndarray, period: float, how: DesignSettings) -> str:
    unseen = [name for name, other in names if other == NOTHING]
    more = len(unseen) - how.listed
    unseen = [*unseen[: how.listed], f"{more} more"] if more > 1 else unseen
    pairs = [f"{name} from {other}" for name, other in names if other != NOTHING]
    gaps = [f"cannot tell {', nor '.join(pairs)}"] if pairs else []
    gaps += [f"does not show {', '.join(unseen)} at half the documented strength"] if unseen else []
    seconds, size = period * sum(len(targets) for _, targets in choice.episodes), min(how.certain, odds.min())
    text = (
        f"This log {' and '.join(gaps)}. {choice.name} is expected to decide that with log-odds of "
        f"{'over ' if size == how.certain else ''}{size:.0f}"
        f"{' or more' if len(odds) > 1 and size < how.certain else ''}, "
        f"every joint calibrated anew, in {seconds:.0f} s with a second variant and a repeat."
    )
    return text.replace("_", " ")


def _ladder(unsure: tuple[Droop, ...], findings: Findings) -> NextExperiment:
    log, how = findings.log, findings.options.design
    choice = ladder([(droop.mover, droop.ends) for droop in unsure], log.robot, log.period, how)
    most = max(unsure, key=lambda droop: droop.apart)
    seconds = log.period * sum(len(targets) for _, targets in choice.episodes)
    joints, (first, last) = ", ".join(droop.joint for droop in unsure), most.torques
    (pull, of_pull), (way, of_way) = say(log.robot, (most.joint,), "N·m"), say(log.robot, (most.mover,), "rad")
    why = (
        f"This log cannot tell a shifted zero from another droop under gravity in {joints}. On a ladder of poses a "
        f"zero stays and gravity's torque changes: in {most.joint} from {pull * first:+.2f} to {pull * last:+.2f} "
        f"{of_pull} with {most.mover} between {way * most.ends[0]:.2f} and {way * most.ends[1]:.2f} {of_way}, which "
        f"sets the two {write_angle(log.robot, most.joint, most.apart, '.0f')} apart; {seconds:.0f} s with a second "
        "variant and a repeat."
    )
    return NextExperiment("pose_ladder", (PAIR,), choice.episodes, why)


def _on_ground(groups: Sequence[tuple[str, ...]]) -> NextExperiment:
    words = "; ".join(" and ".join(group) for group in groups)
    why = f"In the air {words} are alike by nature: no motion tells them apart, base and feet on the ground do."
    return NextExperiment(ON_GROUND, tuple(groups), (), why.replace("_", " "))
