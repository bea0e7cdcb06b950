"""Learning a servo from a log in the air: numbers first, then lags and network, judged and tested on held-out motions.

A group of joints takes a step only if held-out motions say so: numbers, which are few, if these come nearer, a network
if they come nearer by a good share, significantly. Half of them also say when to stop, the others are for the report.
Where a log knows of three conditions or more, such as gains, each is left out in turn, and the same has to hold of all
windows that were left out, together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis.log.log import Log
from gsl.errors import InputError
from gsl.models.servo import ServoModel, neutral, with_groups, without_group
from gsl.training.servo_bench import CHANCE, LIKELY, Duel, ServoBench, cut_windows, is_worse
from gsl.training.servo_members import ITERATIONS, Member, further
from gsl.training.servo_network import Progress
from gsl.training.servo_replays import Replays
from gsl.training.servo_split import Split, leave_out, split
from gsl.training.servo_walks import Walks
from gsl.worlds.fits import fitting_step

SHORT = (0.1, 0.4)  # warm-up and scored part of a window for a network [s]: errors stay small enough to be frozen
MOST = 300  # iterations of the network's fit
WORTH = 0.1  # of the cost that a network has to take: for less it is not let loose on motions that nobody has logged
WIDE = 10.0  # noise floors that a joint moves in a window, at least, to show what drives it: noise alone spans 6
LEAST_MOVING = 4  # windows in which a joint moves so far, at least


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
        walks: Gap of held-out walks before and after in noise floors, if there were some.
        whole: Whether whole motions were held out; else parts of one, which is weaker.
    """

    model: ServoModel
    before: Mapping[str, float]
    after: Mapping[str, float]
    worse: tuple[str, ...]
    way: tuple[Progress, ...]
    windows: tuple[int, int, int]
    further: tuple[Member, ...] = ()
    walks: tuple[float, ...] | None = None
    whole: bool = True


def learn_servo(
    exp: Log,
    plant: Plant,
    step: float,
    *,
    labelled: bool,
    seed: int,
    threads: int,
    members: int = 1,
    walks: Walks | None = None,
) -> LearnedServo:
    """Learn the servo of a log on top of a plant.

    Args:
        exp: The log, of a robot in the air.
        plant: The robot with what is known of its servos.
        step: Physics period of the simulator that it is for [s]; replays take the nearest one that divides the log's.
        labelled: Whether the held-out motions were chosen by labels.
        seed: Of the first weights.
        threads: That replay side by side; the result does not depend on them.
        members: Of an ensemble, the servo included.
        walks: Of the same robot, that numbers are fitted to besides.

    Raises:
        InputError: The log shows too little motion to learn from.
    """
    _check_motion(exp)
    step = fitting_step(step, exp.period)
    parts, start = split(exp, labelled=labelled), neutral(plant, np.random.default_rng(seed))
    if not len(parts.train):
        raise InputError("what is held out leaves nothing to learn from; hold out fewer trajectories, or log more")
    splits = [parts, *leave_out(exp, parts)]
    with ThreadPoolExecutor(threads) as pool:
        bench = ServoBench(exp, Replays(plant, step, exp.period, threads, pool), start)

        def refuse_groups(
            old: Sequence[ServoModel], new: Sequence[ServoModel], likely: float, worth: float
        ) -> set[str]:
            pairs = zip(splits[1:], old[1:], new[1:], strict=True)
            unseen = [Duel(part.test, before, after) for part, before, after in pairs]
            seen = Duel(parts.held, old[0], new[0])
            return bench.refuse([seen], likely, worth) | bench.refuse(unseen, likely, worth)

        def network(part: Split, begun: ServoModel) -> tuple[ServoModel, list[Progress]]:
            return bench.network(cut_windows(exp, part.train, SHORT), part.judge, begun, MOST)

        begun, fitted = [start] * len(splits), [bench.numbers(part.train) for part in splits]
        unfit = refuse_groups(begun, fitted, LIKELY, 0.0)
        numbers = [with_groups(*pair, unfit) for pair in zip(fitted, begun, strict=True)]
        if walks:
            on_both = bench.numbers_with(walks, parts.train, numbers[0])
            numbers[0] = bench.keep_on_foot(walks, parts.held, numbers[0], on_both)
        networks, ways = zip(*map(network, splits, numbers), strict=True)
        bare = refuse_groups(numbers, networks, 1.0 - CHANCE, WORTH)
        if walks:  # which a network of motions in the air knows nothing of
            on_foot = bench.change_on_foot(walks, numbers[0], with_groups(networks[0], numbers[0], bare))
            bare |= {name for name, change in on_foot.items() if is_worse(change)}
        model = with_groups(networks[0], numbers[0], bare)
        worse = tuple(name for name, change in bench.change(Duel(parts.test, start, model)).items() if is_worse(change))
        for name in worse:
            model = without_group(model, name)
        gaps = [bench.by_group(parts.test, servo) for servo in (start, model)]
        some = cut_windows(exp, parts.train, SHORT)

        def member(begun: ServoModel, index: np.ndarray) -> ServoModel:
            new = bench.network(some.take(index), parts.judge, begun, ITERATIONS)[0]
            return with_groups(new, begun, bare | bench.refuse([Duel(parts.held, begun, new)], 1.0 - CHANCE, WORTH))

        def draw_numbers(rng: np.random.Generator) -> ServoModel:
            return with_groups(bench.numbers_of_some(parts.train, numbers[0], rng, walks), numbers[0], unfit)

        others = further(
            members - 1, draw_numbers, worse, member,
            lambda servo: bench.level(parts.test, servo), plant=plant, samples=some.samples, seed=seed,
        )  # fmt: skip
        sizes, way = (len(some), len(parts.judge), len(parts.test)), tuple(ways[0])
        walked = tuple(walks.level(servo) for servo in (start, model)) if walks else None
        return LearnedServo(model, gaps[0], gaps[1], worse, way, sizes, tuple(others), walked, exp.by_record)


def _check_motion(exp: Log) -> None:
    """Refuse a log that shows nothing of its servos.

    Raises:
        InputError: It is too short, or hardly a joint moves.
    """
    moved = np.ptp(exp.pieces.real[..., : len(exp.joints)], axis=1)
    if len(moved) < LEAST_MOVING:
        raise InputError(
            f"the log has {len(moved)} windows of a second; {LEAST_MOVING} are the least: log longer motions"
        )
    least = WIDE * np.maximum(exp.noise.sd[: len(exp.joints)], exp.robot.encoder_step)
    if (moved > least).any(axis=1).sum() < LEAST_MOVING:
        raise InputError(
            f"the log's joints hardly move: by {1e3 * moved.max():.3g} mrad in a second at most, and less than "
            f"{WIDE:g} noise floors ({1e3 * least.min():.3g} mrad) is none; play motions, see `gsl collect task=excite`"
        )


def document(learned: LearnedServo) -> dict[str, Any]:
    """Return what metrics say of a learned servo."""
    fitted, judged, tested = learned.windows
    return {
        "floors_before": learned.before["all"],
        "floors_after": learned.after["all"],
        "groups": {
            name: {"floors_before": learned.before[name], "floors_after": value, "learned": learned.model.changes(name)}
            for name, value in learned.after.items()
            if name != "all"
        },
        "members": [learned.after["all"], *(member.floors for member in learned.further)],
        "windows": {"fitted": fitted, "judged": judged, "tested": tested},
        "iterations": len(learned.way),
        "whole_motions": learned.whole,
        "learned": any(map(learned.model.changes, learned.model.groups)),
        **(
            {"walks": dict(zip(("floors_before", "floors_after"), learned.walks, strict=True))} if learned.walks else {}
        ),
    }
