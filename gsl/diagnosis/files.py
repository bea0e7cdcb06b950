"""A diagnosis as a grounding takes it, read from the report of an artifact."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gsl.diagnosis.world_file import DIGITS
from gsl.grounding.draws import UncertainCause
from gsl.grounding.effects import Diagnosis
from gsl.storage.diagnosis_report import report_of
from gsl.storage.references import load


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
