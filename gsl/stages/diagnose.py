"""Diagnose: where a simulator's gap to recorded trajectories lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, field, replace
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, ClassVar

import yaml

from gsl.core.body import lump
from gsl.core.console import Console
from gsl.core.described import describe
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch
from gsl.diagnosis.design.next_experiment import write_next_experiment
from gsl.diagnosis.diagnose import diagnose
from gsl.diagnosis.log.files import check_log, clock_caveat, log_parents, on_ground, read_logs, share_clock
from gsl.diagnosis.log.gains import list_added_gains, unseen_gains, with_logged_gains
from gsl.diagnosis.log.log import label_indices
from gsl.diagnosis.log.records import labels_of
from gsl.diagnosis.options import Clocks, Duels, Most, Nulls, Options, PhaseReporter, Tolerance, Without
from gsl.diagnosis.simulate.simulator import compare_with_bullet
from gsl.diagnosis.verdict.document import document
from gsl.diagnosis.verdict.findings import Findings, join_effects
from gsl.diagnosis.verdict.limits import limits
from gsl.errors import InputError
from gsl.report.diagnosis import report_html
from gsl.robots.catalogue import see_from as see_robot_from
from gsl.rollout.parallel import Workers, threads
from gsl.stages.audit import audit_log, write_wiring
from gsl.storage import documents
from gsl.storage.diagnosis_report import REPORT, SIMULATOR, WORLD, report_of, see_from
from gsl.storage.hashing import PAGE
from gsl.storage.origin import origin
from gsl.validation.policy_gap import Effort, policy_gap
from gsl.validation.real_returns import RealReturns, list_parents, real_returns
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.fits import check_hinges, check_replayable

DEFAULT_ROBOT = "nao"  # that commands mean which name none


@component
class Diagnose:
    """Reads trajectories, sets every effect of the library against them, and says what the evidence allows."""

    kind: ClassVar[str] = "diagnose"

    real: Annotated[str, setting("trajectories: a run, a parquet file or a folder of them", min_length=1)]
    sim: Annotated[BulletWorld, setting("the simulator that disagrees with them")]
    reference: Annotated[str | None, setting("trajectories without the effect, to calibrate the simulator first")] = (
        None
    )
    policies: Annotated[
        str | None, setting("policies with real returns, of evaluate or iterate, to be simulated before and after")
    ] = None
    episodes: Annotated[int, setting("simulated episodes of each of these policies", ge=1)] = 5
    without: Without = ()
    clocks: Clocks = None
    most: Most = 4
    duels: Duels = 2
    nulls: Nulls = 3
    workers: Workers = -1
    tolerance: Tolerance = 0.0
    limits: Annotated[bool, setting("ask how much of what is not named there may be all the same")] = False
    held_out: Annotated[
        Mapping[str, Any], setting("labels of the trajectories that are for checking; {} is every second motion")
    ] = field(default_factory=dict)
    trust: Annotated[tuple[str, ...], setting("modules of your own whose classes the policies' files may name")] = ()
    audit: Annotated[bool, setting("look at the wiring first, and name no physics where it explains the gap")] = True
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def __post_init__(self) -> None:
        """Refuse a simulator that logs cannot be replayed in."""
        check_replayable(self.sim.motors, self.sim.plant)

    def parents(self) -> Mapping[str, Path]:
        """Return the files that are read."""
        logs = log_parents(real=self.real, reference=self.reference)
        return {**logs, **(list_parents(self.policies) if self.policies else {})}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write report.json, report.html, the diagnosed world and the next experiment."""
        console.phase("reading the log")
        log = read_logs(self.real)
        sim = with_logged_gains(self.sim, [episode.sensors for episode in log.episodes], self.real)
        if sim is not self.sim:
            console.status("note: the simulator's servos get the gains of the log")
            return {**replace(self, sim=sim).run(folder, console), **list_added_gains(self.sim, sim)}
        label_indices(labels_of(log), self.held_out)  # refuses labels that there are not, before minutes of work
        wiring = audit_log(log, self.sim, self.real, console) if self.audit else None
        if wiring and wiring.spoils:
            return write_wiring(wiring, folder, real=self.real, sim=self.sim.robot, command=self._command())
        measured = real_returns(self.policies, self.sim, trust=self.trust) if self.policies else None
        logs = {role: self._read(role) for role in ("real", "reference") if getattr(self, role)}
        if "reference" in logs and any(on_ground(log) for log in logs.values()):
            raise InputError(
                "a reference calibrates logs in the air only; leave reference= out, or log the robot in the air"
            )
        for warning in self._warnings(logs["real"]):
            console.status(f"warning: {warning}")
        tick, options = PhaseReporter(console), self._options(logs["real"])
        plant, step = self.sim.plant, self.sim.step
        findings = diagnose(logs["real"], plant, step, options, tick, reference=logs.get("reference"))
        gap = self._policy_gap(measured, findings, console) if measured else None
        remarks = wiring.doubts if wiring else ()
        return self._write(findings, logs["real"], gap, folder, tick, remarks)

    def document(self, folder: Path) -> dict[str, Any]:
        """Return what --json shows of an artifact: the report without its curves."""
        bulky = ("replays", "horizon")
        return {key: value for key, value in report_of(folder).items() if key not in bulky}

    def _read(self, role: str) -> Batch:
        batch = read_logs(getattr(self, role))
        check_log(batch, lump(self.sim.plant.robot), getattr(self, role))
        if on_ground(batch):
            check_hinges(self.sim.plant.robot, getattr(self, role))
        return batch

    def _stranger(self, batch: Batch) -> str | None:
        """Return a warning if the log says that it is of another robot, whose joints have the same names."""
        said, ours = str(batch.metadata.get("robot") or ""), lump(self.sim.plant.robot).name
        if said.lower() in ("", ours.lower(), self.sim.robot.lower()):
            return None
        return f"The log says that it is of the robot {said}, the simulator is {ours}: only the joints' names agree."

    def _warnings(self, batch: Batch) -> Sequence[str]:
        """Return what the log says of its robot, or does not show, that a user of the result has to know."""
        unseen = unseen_gains([episode.sensors for episode in batch.episodes], batch.joints)
        return [*filter(None, [self._stranger(batch), unseen])]

    def _options(self, batch: Batch) -> Options:
        return Options(
            self.without, self.most, self.duels, self.nulls, threads(self.workers), share_clock(batch, self.clocks),
            seed=self.seed, tolerance=self.tolerance, held_out=self.held_out,
        )  # fmt: skip

    def _policy_gap(self, measured: RealReturns, findings: Findings, console: Console) -> Mapping[str, Any]:
        effort = Effort(self.episodes, threads(self.workers), self.seed)
        after = replace(self.sim, effects=self._effects(findings))
        named = bool(findings.answer.candidates)
        return policy_gap(measured, self.sim, after, named=named, effort=effort, console=console)

    def _write(
        self,
        findings: Findings,
        batch: Batch,
        gap: Mapping[str, Any] | None,
        folder: Path,
        tick: PhaseReporter,
        remarks: Sequence[str],
    ) -> Mapping[str, Any]:
        report = document(
            findings,
            verified=self._verify(findings),
            next_experiment=write_next_experiment(findings, self.sim.robot, folder),
            effects=findings.effects,
            policy_gap=gap,
            world_file=WORLD,
            report=PAGE,
            data=self._data(findings, batch),
            command=self._command(),
            own=self._own(findings),
        )
        if self.limits:
            report["limits"] = [asdict(limit) for limit in limits(findings, report["shrinkage"], tick)]
        report["caveats"] += filter(None, [*remarks, *self._warnings(batch), clock_caveat(batch, self.clocks)])
        documents.write_json(folder / REPORT, report)
        how = origin()  # what a reader types is typed where this command was, as the terminal has it
        (folder / PAGE).write_text(report_html(see_from(report, how.out) if how else report), encoding="utf-8")
        (folder / WORLD).parent.mkdir()
        sim = describe(self.sim) | {"robot": see_robot_from(self.sim.robot, folder)}  # this folder is its --config-dir
        (folder / WORLD).write_text(self._world(sim, findings, report["summary"]), encoding="utf-8")
        if report["own"]:
            plain = yaml.safe_dump(documents.plain(sim), sort_keys=False, allow_unicode=True)
            (folder / SIMULATOR).write_text(
                f"# The simulator that was diagnosed, as it was.\n{plain}", encoding="utf-8"
            )
        return {
            "verdict": report["verdict"],
            "causes": [cause["effect"] for cause in report["causes"]],
            "before": report["shrinkage"]["before"],
            "after": report["shrinkage"]["after"],
            "fraction": report["shrinkage"]["fraction"],
        }

    def _verify(self, findings: Findings) -> Mapping[str, Any] | None:
        """Return how far Bullet differs from the chain model in a log of the air whose causes are named."""
        if not findings.verdict.names_causes or findings.log.walking:
            return None
        answer = findings.answer
        return compare_with_bullet(
            findings.log, findings.simulator, answer.effects, answer.fit.shifts, self.sim.iterations
        )

    def _own(self, findings: Findings) -> dict[str, Any] | None:
        """Return what commands for another robot than the default one have to name."""
        if self.sim.robot == DEFAULT_ROBOT:
            return None
        return {"robot": self.sim.robot, "period": findings.log.period, "world": PurePosixPath(SIMULATOR).stem}

    def _command(self) -> str:
        """Return the settings to type again, of those that say what is diagnosed; the data name the simulator."""
        said = [f"real={self.real}"]
        said += [f"reference={self.reference}"] if self.reference else []
        said += [f"without=[{','.join(self.without)}]"] if self.without else []
        said += [f"tolerance={self.tolerance:g}"] if self.tolerance else []
        held = ", ".join(f"{key}: {_format_typed(value)}" for key, value in self.held_out.items())
        said += [f"held_out={{{held}}}"] if held else []
        said += [f"clocks={self.clocks}"] if self.clocks else []
        said += [] if self.audit else ["audit=false"]
        return shlex.join(["gsl", "diagnose", *said])

    def _data(self, findings: Findings, batch: Batch) -> dict[str, Any]:
        log = findings.log
        held = {int(k) for k in log.pieces.record[log.held_out]}
        return {
            "robot": log.robot.name,
            "sim": f"the simulated {self.sim.robot}"
            + (" with " if self.sim.effects else "")
            + ", ".join(self.sim.effects),
            "records": len(log.records),
            "seconds": sum(len(record) for record in log.records) * log.period,
            "train": len(log.records) - len(held) if log.by_record else len(log.records),
            "held_out": len(held),
            "windows": len(log.pieces),
            "source": self.real,
            "reference": self.reference,
            "engine": "bullet" if log.walking else "chain",
        }

    def _effects(self, findings: Findings) -> dict[str, Any]:
        """Return all effects of the diagnosed simulator, those that it had before included."""
        return join_effects(describe(self.sim)["effects"], findings.effects)

    def _world(self, sim: Mapping[str, Any], findings: Findings, summary: str) -> str:
        config = {**sim, "effects": self._effects(findings)}
        text = yaml.safe_dump(documents.plain(config), sort_keys=False, allow_unicode=True)
        how = "with it switched on, and calibrated" if findings.answer.candidates else "calibrated"
        return f"# {summary}\n# The simulator {how} joint by joint.\n{text}"


def _format_typed(value: Any) -> str:
    """Return a value, or several, as it is typed."""
    return f"[{', '.join(map(str, value))}]" if isinstance(value, list | tuple) else str(value)
