"""A diagnosis as a grounding takes it, read from the report of an artifact."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from gsl.core.other_commands import gains_of
from gsl.core.words import name_effects
from gsl.effects.effect import build, together
from gsl.errors import ArtifactError
from gsl.grounding.draws import UncertainCause
from gsl.storage.artifact import Artifact
from gsl.storage.diagnosis_report import DIGITS, report_of
from gsl.storage.documents import as_written
from gsl.storage.references import load

DOUBT = "In the task that may be no nearer: compare with grounding=ane and grounding=gat."  # docs/results/withheld.md


@dataclass(frozen=True)
class Diagnosis:
    """What a diagnosis says of a simulator.

    Attributes:
        verdict: `no_gap`, `causes`, `inseparable`, `unknown`; `given` or `identified` where nobody diagnosed.
        causes: Names of the effects that it names.
        summary: In a sentence.
        robot: That was simulated.
        simulated: The `effects:` of the simulator as it was.
        effects: What it lacks, the log's own gains and its calibration included.
        before, after: The held-out gap without and with them, in noise floors; None where nobody measured.
        uncertain: Causes with their probabilities and intervals, as far as it tells them.
    """

    verdict: str
    causes: tuple[str, ...]
    summary: str
    robot: str
    simulated: Mapping[str, Any]
    effects: Mapping[str, Any]
    before: float | None = None
    after: float | None = None
    uncertain: tuple[UncertainCause, ...] = ()

    @property
    def sentence(self) -> str:
        """What is done with it, in a sentence."""
        if not self.causes:
            kept = "Nothing is switched on: the simulator is taken as it is, calibrated joint by joint."
            return f"{kept} {DOUBT}" if self.verdict == "unknown" else kept
        return f"Switched on in the simulator: {name_effects(self.causes)}."


def read_diagnosis(reference: str, kind: str) -> Diagnosis:
    """Return what an artifact of `gsl diagnose`, or of `gsl identify`, says of its simulator.

    Raises:
        ArtifactError: There is none, or it is not as it was written.
    """
    artifact = load(reference, kind)
    with as_written(artifact.folder, "diagnose again"):
        return _read(artifact)


def _read(artifact: Artifact) -> Diagnosis:
    report, sim = report_of(artifact.folder), artifact.config["sim"]
    if report["verdict"] == "wiring":
        raise ArtifactError(artifact.folder, f"{report['summary']} Mend the log and diagnose it again")
    gap = report["shrinkage"]
    build({**sim["effects"], **report["effects"]})  # they are what effects are
    return Diagnosis(
        verdict=report["verdict"],
        causes=tuple(cause["effect"] for cause in report["causes"]),
        summary=report["summary"],
        robot=sim["robot"],
        simulated=sim["effects"],
        effects=together([gains_of(artifact.metrics), report["effects"]]),
        before=gap["before"],
        after=gap["after"],
        uncertain=tuple(uncertain_causes(report)),
    )


def uncertain_causes(report: Mapping[str, Any]) -> Iterator[UncertainCause]:
    """Yield the causes of a report with what its effects have of each; those without a probability are left out."""
    for cause in report["causes"]:
        entries = [entry for entry in report["effects"].get(cause["effect"], []) if _is(entry, cause)]
        if "probability" not in cause or not entries:
            continue
        intervals = {
            name: (float(estimate["low"]), float(estimate["high"]))
            for name, estimate in cause["parameters"].items()
            if estimate.get("low") is not None and estimate.get("high") is not None
        }
        yield UncertainCause(cause["effect"], entries[0], float(cause["probability"]), intervals)


def _is(entry: Mapping[str, Any], cause: Mapping[str, Any]) -> bool:
    """Whether an entry of `effects:` is a cause's, whose numbers are not rounded."""
    where = entry.get("joints", entry.get("link", ""))
    if "parameters" not in cause or cause["scope"] != (where if isinstance(where, str) else ", ".join(where)):
        return False
    values = {**cause["fixed"], **{name: estimate["value"] for name, estimate in cause["parameters"].items()}}
    return all(_same(entry.get(name), value) for name, value in values.items())


def _same(rounded: Any, value: Any) -> bool:
    return rounded == (round(value, DIGITS) if isinstance(value, float) else value)
