"""What a person looks at after `iterate`: table, learning curve and one joint's traces (the paper's figure 6)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gsl.core.observation import observations
from gsl.core.trajectory import Trajectory
from gsl.grounding.none import NoGrounding
from gsl.report.joint_trace import Traces, joint_trace
from gsl.report.learning_curve import Search, learning_curve, search
from gsl.stages.evaluate import TABLE
from gsl.stages.grounding_replay import Place, replay
from gsl.storage.artifact import Artifact
from gsl.worlds.bullet import BulletWorld

if TYPE_CHECKING:
    from gsl.stages.iterate import Iterate

CURVE, TRACE, MARKDOWN = "learning_curve.png", "joint_trace.png", "table.md"
TAKEN_OVER, SHOWN = 2.0, 0.8  # when the simulators take over from the real robot, and for how long [s]


def write_curve(folder: Path, iterate: Iterate, done: Sequence[Artifact], ungrounded: Artifact | None) -> None:
    """Write the learning curve of all iterations, with the search without grounding beside them if there was one."""
    searches = [_search(f"iteration {k + 1}", one, iterate, f"π{k}") for k, one in enumerate(done)]
    if ungrounded is not None:
        searches.append(_search("without grounding", ungrounded, iterate, "π0"))
    learning_curve(folder / CURVE, searches, unit=iterate.task.unit)


def write_trace(folder: Path, world: BulletWorld, grounding: Any, walk: Trajectory) -> None:
    """Write the trace of the joint that moves most: a real walk, and its actions replayed from one of its states.

    Args:
        folder: Where to write.
        world: The simulator.
        grounding: Ready to act.
        walk: A real trajectory that no model has seen.
    """
    env = world.make()
    place = Place(observations(walk, world.layout), walk.action, min(round(TAKEN_OVER / world.period), len(walk) // 2))
    ticks = min(round(SHOWN / world.period), len(walk) - place.tick)
    rng = np.random.default_rng(0)
    simulated = [np.array(list(replay(env, way, place, rng, ticks))) for way in (NoGrounding(), grounding)]
    env.close()
    shown = slice(place.tick + 1, place.tick + 1 + ticks)
    joint = int(np.argmax(np.ptp(walk.position[shown], axis=0)))
    traces = Traces(
        walk.time[shown],
        walk.action[place.tick : place.tick + ticks, joint],
        walk.position[shown, joint],
        *(seen[:, joint] for seen in simulated),
    )
    joint_trace(folder / TRACE, traces, world.layout.joints[joint])


def write_table(folder: Path, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Write the table that was shown as markdown."""
    lines = [columns, ["---"] * len(columns), *rows]
    (folder / MARKDOWN).write_text("".join(f"| {' | '.join(line)} |\n" for line in lines), encoding="utf-8")


def _search(label: str, evaluation: Artifact, iterate: Iterate, start: str) -> Search:
    document = json.loads((evaluation.folder / TABLE).read_text(encoding="utf-8"))
    return search(label, document, shown=iterate.task.shown, returned=evaluation.metrics["best"], start=start)
