"""The command file of what to play next, as a diagnosis writes it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.menu import menu
from gsl.diagnosis.next_experiment import next_experiment
from gsl.storage.commands import Commands, write_commands
from gsl.storage.diagnosis_report import COMMANDS


def write_next_experiment(found: Findings, robot: str, folder: Path) -> Mapping[str, Any] | None:
    """Write what to play next as a command file.

    Args:
        found: The diagnosis.
        robot: Name of the robot, as a world has it.
        folder: Where.

    Returns:
        What the report says of it, None if the log leaves nothing open that a motion in the air would show.
    """
    exp = found.experiment
    best = next_experiment(found, menu(robot, exp.robot, exp.period))
    if best is None:
        return None
    told = {"excitation": best.excitation, "separates": best.separates, "why": best.why}
    if not best.episodes:
        return told | {"file": None}
    commands = Commands(exp.robot.name, exp.joints, exp.period, best.episodes, told)
    write_commands(folder / COMMANDS, commands)
    return told | {"file": COMMANDS}
