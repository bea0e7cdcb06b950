"""What a person looks at after `evaluate`: the joints and feet of the policies that were reported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gsl.commandline.rebuild import rebuild_search
from gsl.core.console import Console
from gsl.core.layout import Layout, check_alike
from gsl.core.observation import missing
from gsl.core.trajectory import Trajectory
from gsl.errors import GslError
from gsl.grounding.none import NoGrounding
from gsl.report.evaluation_page import Look
from gsl.report.flight import describe_servo
from gsl.report.joint_trace import Traces
from gsl.report.shown import scale_of
from gsl.rollout.rollout import Scenario, play_once
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.policy_choice import find_search
from gsl.validation.gate import REPORT
from gsl.validation.iteration_pictures import Way, centre, read_footfalls, show_window, trace_joints
from gsl.validation.replay import PAST
from gsl.worlds.external import ExternalRobot

SHORTEST = 2 * PAST  # ticks of a walk whose joints are shown: where it fell at once there is no state to begin in
_ALONE = "the page shows no simulator"


class Walked(NamedTuple):
    """An episode of a policy on the real side.

    Attributes:
        parameters: Of the policy, shape (n_parameters,).
        seed: Of the episode.
        log: What a robot that is elsewhere has logged of it, if it is one and has.
    """

    parameters: np.ndarray
    seed: int
    log: Trajectory | None


def look_at(
    real: Scenario,
    walks: Mapping[str, Walked],
    source: Path | None,
    trust: Sequence[str],
    console: Console,
) -> Look:
    """Return what there is to see of policies; nothing of what is no robot, or of a robot that has logged nothing.

    Args:
        real: The real side.
        walks: The episode that is shown, by the name of the policy; the best one first.
        source: Where the policies come from.
        trust: Modules that are not gsl's and whose classes settings may name.
        console: Hears why no simulator is shown where there was a search.
    """
    searched = _find(source, console)
    check, layout = searched.folder / REPORT if searched else None, real.world.layout
    findings = list(_describe_servos(searched)) if searched else []
    if simulated := centre(real.world):
        robot = simulated.plant.robot
        episodes = {name: play_once(real, walk.parameters, walk.seed) for name, walk in walks.items()}
    elif isinstance(real.world, ExternalRobot):
        robot, episodes = real.world.body, {name: walk.log for name, walk in walks.items() if walk.log}
    else:
        return Look(check=check, findings=findings)
    steps = [read_footfalls(f"{name} on the real side", walk) for name, walk in episodes.items()]
    ways: list[Way] = []
    try:
        if searched:
            plain, grounded = rebuild_search(searched, trust)
            check_alike(plain.world.layout, layout)  # a step of another length would be replayed as another motion
            ways = [Way(simulator, NoGrounding())] if (simulator := centre(plain.world)) else []
            if ways and not isinstance(plain.grounding, NoGrounding) and (inner := centre(grounded.world)):
                ways.append(Way(inner, grounded.grounding))
            name, walk = next(iter(walks.items()))
            where = "in the grounded simulator" if len(ways) > 1 else "in simulation"
            steps.append(read_footfalls(f"{name} {where}", play_once(grounded, walk.parameters, walk.seed)))
    except GslError as error:  # it is of another rate, or its settings name code that nobody has trusted here
        console.status(f"{_ALONE}: {error}")
        ways = []
    long = {name: walk for name, walk in episodes.items() if len(walk) >= SHORTEST}
    traces = {name: _trace(ways, walk, layout, robot.slides) for name, walk in long.items()}
    return Look(traces, [step for step in steps if step], check, findings)


def _find(source: Path | None, console: Console) -> Artifact | None:
    try:
        return find_search(source) if source else None
    except GslError as error:  # what the policies were measured in is damaged
        console.status(f"{_ALONE}: {error}")
        return None


def _describe_servos(searched: Artifact) -> Iterator[str]:
    """Yield how near the servo is that a search had learned before; nothing where its artifact is gone."""
    for parent in searched.manifest.parents:
        if parent.role.endswith(".servo"):
            with suppress(GslError):
                folder = searched.folder / parent.path
                yield describe_servo(Artifact(folder, manifest.read(folder)).metrics)


def _trace(ways: Sequence[Way], walk: Trajectory, layout: Layout, slides: Sequence[str]) -> Mapping[str, Traces]:
    """Return the traces of all joints, with the simulators where these can begin in a state of the walk."""
    if ways and not missing(walk, ways[0].world.layout):
        return trace_joints(ways[0], ways[1] if len(ways) > 1 else None, walk)
    tick, ticks = show_window(walk, layout.control_period)
    time, shown = slice(tick + 1, tick + 1 + ticks), slice(tick, tick + ticks)
    order = np.argsort(-np.ptp(walk.position[time], axis=0), kind="stable")
    return {
        layout.joints[k]: Traces(
            walk.time[time], walk.action[shown, k], walk.position[time, k], scale=scale_of(layout.joints[k], slides)
        )
        for k in order
    }
