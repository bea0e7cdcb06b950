"""`gsl view`: a trajectory to scrub through, robot and ghost of the simulator, with the curves of every joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

from gsl.commandline.film import Cast, Subject, assemble, read_settings
from gsl.core.body import Robot
from gsl.core.other_commands import find_varying_gains, read_other_commands
from gsl.core.plant import nominal
from gsl.core.setting import component, setting
from gsl.core.trajectory import Trajectory
from gsl.core.validation import make
from gsl.errors import InputError
from gsl.report.console import Console
from gsl.report.film import Shot
from gsl.report.film_strip import walks
from gsl.report.recording import check_viewer, record_shots
from gsl.report.style import SIMULATION
from gsl.storage.whole import explain_refusal, replacing
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.fits import fitting_step
from gsl.worlds.held import Held

FORMAT = ".rrd"


@component
class Viewing(Subject):
    """What `gsl view` takes beside the reference."""

    out: Annotated[str, setting("a recording to write, .rrd, in place of a window")] = ""


def view(reference: str, words: Sequence[str], console: Console) -> None:
    """Show a trajectory in the Rerun viewer, or write a recording for it.

    The ghost is a second log (`beside`), the simulator's walk, or, for a log in the air, what the robot's plain model
    does with the same commands.

    Args:
        reference: A path, or the name of a run.
        words: Settings, as they were typed.
        console: Where what is shown is named.

    Raises:
        ArtifactError: There is no such artifact, or it has nothing that moves.
        ConfigError: A setting is wrong.
        InputError: The robot cannot be shown, or the viewer is missing.
    """
    settings = make(Viewing, read_settings(words, "view"))
    path = Path(settings.out) if settings.out else None
    if path is not None and path.suffix.lower() != FORMAT:
        raise InputError(f"{path}: a recording is {FORMAT}; choose such a name with out=")
    check_viewer()
    with console.at_work("view"):
        cast = _add_ghost(assemble(reference, settings, words, console), console)
    if path is None:
        record_shots(cast.robot, cast.joints, cast.shots, None)
    else:
        with explain_refusal(path.parent):
            path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            record_shots(cast.robot, cast.joints, cast.shots, temporary)
        console.status(f"rerun {path.as_posix()} shows it")
    document = {"recording": path, "shown": [shot.title for shot in cast.shots]}
    console.result(document, text=path.as_posix() if path else " and ".join(shot.title for shot in cast.shots))


def _add_ghost(cast: Cast, console: Console) -> Cast:
    """Return the same with a ghost, if there is none yet and one can be computed."""
    if len(cast.shots) > 1:
        return cast
    shot = cast.shots[0]
    if walks(shot.trajectory) or not len(shot.trajectory):
        console.status("no ghost: a log on the ground has none of its own; beside=REF shows a second log")
        return cast
    if any(column.startswith("kp_command.") for column in shot.trajectory.sensors):
        console.status("no ghost: the log has gains of its own; beside=REF shows a second log")
        return cast
    ghost = replay_in_the_air(cast.robot, cast.joints, shot.trajectory)
    return replace(cast, shots=(shot, Shot("plain model", "with the same commands", ghost, SIMULATION)))


def replay_in_the_air(robot: Robot, joints: Sequence[str], trajectory: Trajectory) -> Trajectory:
    """Return what the plain model of a robot does with the commands of a trajectory, its base held still."""
    period = float(np.median(np.diff(trajectory.time)))
    stance = [robot.stance.get(name, 0.0) for name in robot.controlled]
    targets, start = np.tile(stance, (len(trajectory), 1)), np.array(stance)
    for k, name in enumerate(joints):
        targets[:, robot.controlled.index(name)] = trajectory.action[:, k]
        start[robot.controlled.index(name)] = trajectory.position[0, k]
    held = Held.of(nominal(robot), fitting_step(BulletWorld.step, period), period)
    settle = max(round(BulletWorld.settle / period), 1)
    varies = next(find_varying_gains([trajectory.sensors], joints), None) is not None
    sent, others = targets[:, robot.drive], read_other_commands(trajectory, robot, gains=varies)
    if others.any():
        sent, settle = np.hstack([sent, others]), 1  # a speed or a torque is not held before the log begins
    [answer] = held.play([sent], [start[robot.drive]], settle)
    columns = [robot.motors.index(name) for name in joints]
    position = answer[:, columns]
    return replace(trajectory, position=position, velocity=np.gradient(position, period, axis=0))
