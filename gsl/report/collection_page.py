"""The page of collected trajectories: what was recorded, and what did the joints do?"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from gsl.core.interfaces import REAL, SIM
from gsl.core.statistics import mean_interval
from gsl.core.trajectory import Batch, Trajectory
from gsl.core.unit import Unit
from gsl.core.words import duration, falls, in_unit, several
from gsl.report.charts import Curve, line_chart
from gsl.report.footfalls import Walk
from gsl.report.parts import choice, section, table
from gsl.report.run_page import DRAWN, Answer, budget, describe_value, fold_long, footfalls, write_page
from gsl.report.shown import Scale, scale_of

_SIDES = {REAL: "on the real side", SIM: "in simulation"}
_KINDS = {REAL: "real", SIM: "before"}  # of the line of a joint
_STATE = Scale(1.0, "")


def write_collection_page(
    folder: Path, batch: Batch, own: int, unit: Unit, *, noisy: bool, walk: Walk | None, slides: Collection[str]
) -> None:
    """Write the page.

    Args:
        folder: Where to write.
        batch: What was recorded; its metadata name its role and the policy of each episode.
        own: How many episodes from the first are of the policy itself; none where it plays a programme.
        unit: Of the task.
        noisy: Whether there was noise on the actions.
        walk: When the feet bear load in the first episode, if that is known.
        slides: Joints that slide.
    """
    role, names = batch.metadata["role"], [_say(about["policy"]) for about in batch.metadata["episodes"]]
    steps = sum(map(len, batch.episodes))
    fallen = sum(episode.ended_in_a_fall for episode in batch.episodes)
    span = f"{steps:,} steps" if batch.states else duration(steps * batch.control_period)
    ends = f", with {falls(fallen)}" if unit.falls else ""
    sentence = f"{several(len(batch), 'episode')} of {span} in all {'were' if len(batch) > 1 else 'was'} recorded"
    more = [_say_value(batch.episodes[:own], unit, noisy=noisy)] if own else []
    spent = [("episodes", str(len(batch))), ("time", "" if batch.states else span), ("steps", f"{steps:,}")]
    sections = [
        section("Episodes", _table(batch, names, unit)),
        section(
            "State over time" if batch.states else "Joint by joint",
            choice("state" if batch.states else "joint", _draw(batch, slides)),
            note=f"The first episode, {names[0]}; what moves most, {DRAWN} pictures at most.",
        ),
        footfalls([walk] if walk else []),
        budget(spent if role == REAL else [("real episodes", "none"), *((f"simulated {k}", v) for k, v in spent)]),
    ]
    answer = Answer("What was recorded?", f"{sentence} {_SIDES[role]}{ends}.", not fallen, more)
    write_page(folder, answer, sections)


def _say(name: str) -> str:
    return "π0" if name == "pi0" else name


def _say_value(episodes: Sequence[Trajectory], unit: Unit, *, noisy: bool) -> str:
    mean, lower, upper = mean_interval([episode.value for episode in episodes])
    who = f"π0{' with noise' * noisy}"
    return f"{who} reaches {describe_value(unit, mean, [lower, upper])} in {several(len(episodes), 'episode')}."


def _table(batch: Batch, names: Sequence[str], unit: Unit) -> Markup:
    """Return a row an episode."""
    valued = any(episode.reward is not None and np.any(episode.reward) for episode in batch.episodes)
    columns = ["policy", "time [s]", *[in_unit("value", unit.name)] * valued, *["end"] * unit.falls]
    rows = []
    for name, episode in zip(names, batch.episodes, strict=True):
        end = "fell" if episode.ended_in_a_fall else "stood"
        cells = [name, f"{len(episode) * batch.control_period:.2f}"]
        rows.append([*cells, *[unit.bare(episode.value)] * valued, *[end] * unit.falls])
    return fold_long(table(columns, rows), len(rows))


def _draw(batch: Batch, slides: Collection[str]) -> Mapping[str, Markup]:
    """Return pictures of what moves most in the first episode: joints, or entries of a state that is not joints."""
    first, kind = batch.episodes[0], _KINDS[batch.metadata["role"]]
    moving = np.argsort(-np.ptp(first.position if first.state is None else first.state, axis=0), kind="stable")[:DRAWN]
    drawn: dict[str, tuple[Scale, np.ndarray | None, np.ndarray]]
    if first.state is not None:
        drawn = {f"state.{k}": (_STATE, None, first.state[:, k]) for k in moving}
    else:
        drawn = {
            batch.joints[k]: (scale_of(batch.joints[k], slides), first.action[:, k], first.position[:, k])
            for k in moving
        }
    pictures: dict[str, Markup] = {}
    for name, (scale, command, seen) in drawn.items():
        curves = [_curve("command", "command", first.time, command, scale)] if command is not None else []
        curves.append(_curve("measured", kind, first.time, seen, scale))
        picture = line_chart(curves, x="time [s]", y=in_unit(name, scale.unit))
        pictures |= {name: picture} if picture else {}
    return pictures


def _curve(label: str, kind: str, time: np.ndarray, values: np.ndarray, scale: Scale) -> Curve:
    return Curve(label, kind, time[: len(values)].tolist(), (scale.factor * values).tolist())
