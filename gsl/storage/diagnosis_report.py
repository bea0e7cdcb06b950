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
    check_shape(report)
    return see_from(report, folder)


def see_from(report: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return a report that lies in `folder` with paths that are good from where the command runs."""
    files = {key: (folder / report[key]).as_posix() for key in ("world_file", "report") if report.get(key)}
    wanted = report.get("next_experiment")
    if wanted and wanted.get("file"):
        files |= {"next_experiment": wanted | {"file": (folder / wanted["file"]).as_posix()}}
    return report | files


def check_shape(report: Any) -> None:
    """Refuse a report whose entries are of other kinds than a diagnosis writes.

    Raises:
        ValueError: They are.
    """
    if not isinstance(report, dict):
        raise ValueError("a report holds entries by name")
    experiment = report.get("next_experiment") or {}
    texts = [report.get("world_file"), report.get("report"), experiment.get("file") if _is_by_name(experiment) else 0]
    causes = [cause for key in ("causes", "suspects") for cause in _entries(report.get(key))]
    if not all(text is None or isinstance(text, str) for text in texts) or not all(map(_is_cause, causes)):
        raise ValueError("its causes or files are no such")
    if not all(map(_is_names, _entries(report.get("inseparable")))):
        raise ValueError("what it cannot tell apart are no names")


def _entries(value: Any) -> list[Any]:
    """Return a list's entries; anything else that is something counts as a wrong one."""
    return value if isinstance(value, list) else [value] if value else []


def _is_by_name(value: Any) -> bool:
    return isinstance(value, dict)


def _is_names(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


def _is_cause(cause: Any) -> bool:
    if not _is_by_name(cause):
        return False
    parameters, joints = cause.get("parameters") or {}, cause.get("joints") or []
    joints = [joints] if isinstance(joints, str) else joints
    return (
        _is_by_name(parameters)
        and all(map(_is_by_name, parameters.values()))
        and _is_names(joints)
        and isinstance(cause.get("scope") or "", str)
        and _is_names(cause.get("exempt") or [])
        and _is_by_name(cause.get("fixed") or {})
        and isinstance(cause.get("effect") or "", str)
    )
