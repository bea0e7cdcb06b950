"""The files of a diagnosis: its report, with the paths of what lies beside it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gsl.diagnosis.world_file import DIGITS
from gsl.grounding.draws import UncertainCause
from gsl.grounding.effects import Diagnosis
from gsl.storage.references import load

REPORT, PAGE, COMMANDS = "report.json", "report.html", "next_experiment.json"
WORLD, SIMULATOR = "world/diagnosed.yaml", "world/simulator.yaml"


def report_of(folder: Path) -> dict[str, Any]:
    """Return the report of an artifact with paths that are good from where the command runs."""
    report: dict[str, Any] = json.loads((folder / REPORT).read_text(encoding="utf-8"))
    found = {key: (folder / report[key]).as_posix() for key in ("world_file", "report") if report.get(key)}
    wanted = report.get("next_experiment")
    if wanted and wanted.get("file"):
        found |= {"next_experiment": wanted | {"file": (folder / wanted["file"]).as_posix()}}
    return report | found


def read_diagnosis(reference: str, kind: str) -> Diagnosis:
    """Return what an artifact of `gsl diagnose`, or of `gsl identify`, says of its simulator.

    Raises:
        ArtifactError: There is none, or it is not as it was written.
    """
    artifact = load(reference, kind)
    report, sim = report_of(artifact.folder), artifact.config["sim"]
    gap = report["shrinkage"]
    return Diagnosis(
        verdict=report["verdict"],
        causes=tuple(one["effect"] for one in report["causes"]),
        summary=report["summary"],
        robot=sim["robot"],
        simulated=sim["effects"],
        effects=report["effects"],
        before=gap["before"],
        after=gap["after"],
        uncertain=tuple(uncertain_causes(report)),
    )


def uncertain_causes(report: Mapping[str, Any]) -> Iterator[UncertainCause]:
    """Yield the causes of a report with what its effects have of each; those without a probability are left out."""
    for cause in report["causes"]:
        entries = [one for one in report["effects"].get(cause["effect"], []) if _is(one, cause)]
        if "probability" not in cause or not entries:
            continue
        intervals = {
            name: (float(one["low"]), float(one["high"]))
            for name, one in cause["parameters"].items()
            if one.get("low") is not None and one.get("high") is not None
        }
        yield UncertainCause(cause["effect"], entries[0], float(cause["probability"]), intervals)


def _is(entry: Mapping[str, Any], cause: Mapping[str, Any]) -> bool:
    """Whether an entry of `effects:` is a cause's, whose numbers are not rounded."""
    if "parameters" not in cause or cause["scope"] != entry.get("joints", entry.get("link", "")):
        return False
    values = {**cause["fixed"], **{name: one["value"] for name, one in cause["parameters"].items()}}
    return all(_same(entry.get(name), value) for name, value in values.items())


def _same(rounded: Any, value: Any) -> bool:
    return rounded == (round(value, DIGITS) if isinstance(value, float) else value)
