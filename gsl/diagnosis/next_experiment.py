"""The next experiment: the excitation of a menu that best separates what a log leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.droop import Droop, droops
from gsl.diagnosis.menu import Dish
from gsl.diagnosis.pose_ladder import ladder
from gsl.diagnosis.questions import NOTHING, Question, alike, hidden, rivals
from gsl.diagnosis.rehearsal import Rehearsal

ENOUGH = 30.0  # log-odds with which a question is answered: what comes on top decides only between equals
WORTH = 3.0  # log-odds below which a motion is not worth playing
CERTAIN = 100.0  # log-odds beyond which their size says nothing any more
LISTED = 4  # effects that a sentence names
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


def next_experiment(found: Findings, dishes: Sequence[Dish]) -> NextExperiment | None:
    """Return the best of a menu; None if the log leaves nothing open, or nothing that any of it would show.

    Causes that cannot be told apart come first, then zeros that may be loads, then effects that the log cannot show.
    """
    unsure = tuple(one for one in droops(found) if one.told)
    if unsure and not rivals(found) and not alike(found):
        return _ladder(unsure, found)
    questions = rivals(found) or ([] if alike(found) else hidden(found))
    best = _best(questions, Rehearsal.of(found, dishes), dishes) if questions else None
    return best or (_on_ground(alike(found)) if alike(found) else None)


def _best(questions: Sequence[Question], rehearsal: Rehearsal, dishes: Sequence[Dish]) -> NextExperiment | None:
    odds = np.array([rehearsal.log_odds(one.truth, one.rivals, loose=one.loose) for one in questions])
    period = rehearsal.experiment.period
    answered = np.minimum(odds, ENOUGH).sum(axis=0)
    quick = odds.sum(axis=0) / np.array([period * one.ticks for one in dishes])
    best = max(range(len(dishes)), key=lambda k: (round(answered[k], 6), quick[k]))
    asked = [k for k in range(len(questions)) if odds[k, best] >= WORTH]
    if not asked:
        return None
    dish = dishes[best]
    names = tuple(questions[k].names for k in asked)
    why = _why(dish, [questions[k] for k in asked], odds[asked, best], period)
    return NextExperiment(dish.name, names, dish.episodes, why)


def _why(dish: Dish, questions: Sequence[Question], odds: np.ndarray, period: float) -> str:
    unseen = [name for name, other in (one.names for one in questions) if other == NOTHING]
    unseen = [*unseen[:LISTED], f"{len(unseen) - LISTED} more"] if len(unseen) > LISTED + 1 else unseen
    pairs = [f"{name} from {other}" for name, other in (one.names for one in questions) if other != NOTHING]
    gaps = [f"cannot tell {', nor '.join(pairs)}"] if pairs else []
    gaps += [f"does not show {', '.join(unseen)} at half the documented strength"] if unseen else []
    seconds, size = period * sum(len(targets) for _, targets in dish.episodes), min(CERTAIN, odds.min())
    told = (
        f"This log {' and '.join(gaps)}. {dish.name} is expected to decide that with log-odds of "
        f"{'over ' if size == CERTAIN else ''}{size:.0f}{' or more' if len(odds) > 1 and size < CERTAIN else ''}, "
        f"every joint calibrated anew, in {seconds:.0f} s with a second variant and a repeat."
    )
    return told.replace("_", " ")


def _ladder(unsure: tuple[Droop, ...], found: Findings) -> NextExperiment:
    exp = found.experiment
    dish = ladder([(one.mover, one.ends) for one in unsure], exp.robot, exp.period)
    most = max(unsure, key=lambda one: one.apart)
    seconds = exp.period * sum(len(targets) for _, targets in dish.episodes)
    joints, (first, last) = ", ".join(one.joint for one in unsure), most.torques
    why = (
        f"This log cannot tell a shifted zero from another droop under gravity in {joints}. On a ladder of poses a "
        f"zero stays and gravity's torque changes: in {most.joint} from {first:+.2f} to {last:+.2f} N·m with "
        f"{most.mover} between {most.ends[0]:.2f} and {most.ends[1]:.2f} rad, which sets the two "
        f"{1e3 * most.apart:.0f} mrad apart; {seconds:.0f} s with a second variant and a repeat."
    )
    return NextExperiment("pose_ladder", (PAIR,), dish.episodes, why)


def _on_ground(groups: Sequence[tuple[str, ...]]) -> NextExperiment:
    words = "; ".join(" and ".join(group) for group in groups)
    why = f"In the air {words} are alike by nature: no motion tells them apart, base and feet on the ground do."
    return NextExperiment(ON_GROUND, tuple(groups), (), why.replace("_", " "))
