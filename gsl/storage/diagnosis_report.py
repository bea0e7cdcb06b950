"""The report of a diagnosis as a file, and the names of what lies beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gsl.core.budget import read_json

REPORT, COMMANDS = "report.json", "next_experiment.json"
DIGITS = 6  # of an effect's numbers in a world file
WORLD, SIMULATOR = "world/diagnosed.yaml", "world/simulator.yaml"


def report_of(folder: Path) -> dict[str, Any]:
    """Return the report of an artifact with paths that are good from where the command runs.

    Raises:
        OSError: There is none.
        ValueError: It is damaged.
        InputError: It is no plain file, or too large.
    """
    report: dict[str, Any] = read_json(folder / REPORT)
    if not isinstance(report, dict):
        raise ValueError("a report holds entries by name")
    files = {key: (folder / report[key]).as_posix() for key in ("world_file", "report") if report.get(key)}
    wanted = report.get("next_experiment")
    if wanted and wanted.get("file"):
        files |= {"next_experiment": wanted | {"file": (folder / wanted["file"]).as_posix()}}
    return report | files
