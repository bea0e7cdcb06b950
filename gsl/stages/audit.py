"""Audit: what is wrong between robot, log and simulator that no physics could do, in seconds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

from gsl.core.body import lump
from gsl.core.budget import read_json
from gsl.core.console import Console
from gsl.core.interruption import checkpoint
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch
from gsl.diagnosis.log.files import check_joints, log_parents, read_logs
from gsl.diagnosis.log.gains import with_logged_gains
from gsl.diagnosis.wiring.audit import Audit as Found
from gsl.diagnosis.wiring.audit import audit
from gsl.report.diagnosis import report_html
from gsl.storage import documents
from gsl.storage.diagnosis_report import REPORT as DIAGNOSIS
from gsl.storage.hashing import PAGE
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.fits import check_replayable

REPORT = "audit.json"


@component
class Audit:
    """Looks for names, signs, units, zeros, rows, rates and signals that are wrong; says nothing of physics."""

    kind: ClassVar[str] = "audit"

    real: Annotated[str, setting("trajectories: a run, a parquet file or a folder of them", min_length=1)]
    sim: Annotated[BulletWorld, setting("the simulator that they should fit")]

    def __post_init__(self) -> None:
        """Refuse a simulator that logs cannot be replayed in."""
        check_replayable(self.sim.motors, self.sim.plant)

    def parents(self) -> Mapping[str, Path]:
        """Return the files that are read."""
        return log_parents(real=self.real)

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write audit.json."""
        audit = audit_log(read_logs(self.real), self.sim, self.real, console)
        document = {**audit.document(), "summary": audit.summary, "sim": self.sim.robot, "real": self.real}
        documents.write_json(folder / REPORT, document)
        kinds = [finding["kind"] for finding in document["findings"]]
        return {"verdict": audit.verdict, "findings": kinds, "headline": audit.summary}

    def document(self, folder: Path) -> dict[str, Any]:
        """Return what --json shows of an artifact."""
        document: dict[str, Any] = read_json(folder / REPORT)
        return document


def audit_log(batch: Batch, sim: BulletWorld, name: str, console: Console) -> Found:
    """Audit a log that a diagnosis, too, would take.

    Raises:
        InputError: It is of another robot, or its gains cannot be.
    """
    console.phase("looking at the wiring")
    check_joints(batch, lump(sim.plant.robot), name)
    sim = with_logged_gains(sim, [episode.sensors for episode in batch.episodes], name)
    return audit(batch, sim.plant, sim.step, checkpoint)


def write_wiring(audit: Found, folder: Path, *, real: str, sim: str, command: str) -> Mapping[str, Any]:
    """Write the report of a diagnosis that ends with the wiring: no physics is named, and no world is corrected."""
    audited = audit.document()
    report = {
        "verdict": "wiring",
        "summary": audit.summary,
        "causes": [],
        "effects": {},
        "wiring": audited["findings"],
        "shrinkage": {"before": audited["before"], "after": None, "fraction": None},
        "caveats": audited["remarks"],
        "data": {"sim": f"the simulated {sim}", "source": real},
        "report": PAGE,
        "command": command,
    }
    documents.write_json(folder / DIAGNOSIS, report)
    (folder / PAGE).write_text(report_html(report), encoding="utf-8")
    return {"verdict": "wiring", "causes": [], "before": audited["before"], "after": None, "fraction": None}
