"""Cross-validate: is what `diagnose` finds in a part of the trajectories true of the rest?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from gsl.core.body import lump
from gsl.core.console import Console
from gsl.core.labels import alike
from gsl.core.other_commands import find_other_commands
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch
from gsl.core.transitions import usable
from gsl.core.workload import Part
from gsl.diagnosis.angles import effects_in_metres, say, with_log_in_angles
from gsl.diagnosis.diagnose import diagnose, prepare
from gsl.diagnosis.hypothesis.candidates import library
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis
from gsl.diagnosis.log.files import check_log, clock_caveat, log_parents, on_ground, read_logs, share_clock
from gsl.diagnosis.log.gains import with_logged_gains
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.log.records import Record
from gsl.diagnosis.options import Clocks, Duels, Most, Nulls, Options, PhaseReporter, Tolerance, Without
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.in_the_air import change
from gsl.diagnosis.simulate.simulator import mean_errors
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.servo_law import learn_laws
from gsl.diagnosis.verdict.shrinkage import ceiling, compute_removed
from gsl.effects.effect import effect_class
from gsl.errors import ConfigError, InputError
from gsl.report.cross_validation import (
    AS_IT_WAS,
    CALIBRATED,
    DIAGNOSED,
    DIAGNOSED_GAT,
    DIAGNOSED_SERVO,
    GAT,
    SERVO,
    Fold,
    table,
)
from gsl.rollout.parallel import Workers, threads
from gsl.storage import documents
from gsl.training.servo_folds import servo_errors
from gsl.validation.learned_replay import LearnedReplay, Simulated
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.fits import check_replayable

TABLE, DATA = "table.md", "folds.json"
SINGLE = (str, int, float, bool)
SLIGHT = 0.05  # of an effect's range: where a fit of the baseline begins


@component
class CrossValidate:
    """A diagnosis for every value of a label, of all trajectories without it; those that have it are replayed whole.

    A diagnosis checks its hypotheses on every second motion of what is left: right where values are repeats, such as
    dates, which make the floor. Where they are conditions that a cause shall hold for, such as gains, it checks them on
    the next value. Beside it stand the simulator as it was, calibrated, with some usual effects fitted alone, and with
    what learns from the same trajectories, on it as it was and as it was diagnosed: a grounding by actions, a servo.
    """

    kind: ClassVar[str] = "cross_validate"

    real: Annotated[str, setting("trajectories in the air: a run, a parquet file or a folder of them", min_length=1)]
    sim: Annotated[BulletWorld, setting("the simulator that disagrees with them")]
    by: Annotated[str, setting("label whose values are held out one after the other", min_length=1)]
    usual: Annotated[tuple[str, ...], setting("effects that are fitted without a diagnosis, to compare with")] = (
        "coulomb_friction",
        "viscous_friction",
    )
    checks: Annotated[
        Literal["motions", "values"], setting("what a diagnosis checks its hypotheses on: motions, or the next value")
    ] = "motions"
    without: Without = ()
    gat: Annotated[
        LearnedReplay | None, setting("a grounding by actions that learns from the same logs; none leaves it out")
    ] = None
    servo: Annotated[bool, setting("a learned servo beside the diagnosis and on top of it, from the same logs")] = False
    folds: Annotated[
        int | None, setting("groups that the values are held out in; none holds out one value after the other", ge=2)
    ] = None
    clocks: Clocks = None
    most: Most = 4
    duels: Duels = 2
    nulls: Nulls = 3
    tolerance: Tolerance = 0.0
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def __post_init__(self) -> None:
        """Refuse what cannot be fitted to all joints, or is to be left out, or replayed."""
        check_replayable(self.sim.motors, self.sim.plant)
        if self.gat is not None and (slides := self.sim.plant.robot.slides):
            raise ConfigError("gat", f"learns angles alone, and {', '.join(slides)} slide; gat=null leaves it out")
        if not self.usual:
            raise ConfigError("usual", "names at least one effect to compare with")
        everywhere = {candidate.effect for candidate in library(lump(self.sim.plant.robot)) if candidate.on_joints}
        for name in self.usual:
            effect_class(name)
            if name in self.without or name not in everywhere:
                why = "is left out by without=" if name in self.without else "is no effect of all joints"
                raise ConfigError("usual", why, given=name)

    def parents(self) -> Mapping[str, Path]:
        """Return the files that are read."""
        return log_parents(real=self.real)

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the table and every fold."""
        log = read_logs(self.real)
        check_log(log, lump(self.sim.plant.robot), self.real)
        sim = with_logged_gains(self.sim, [episode.sensors for episode in log.episodes], self.real)
        if sim is not self.sim:
            return replace(self, sim=sim).run(folder, console)
        if on_ground(log):
            raise InputError(f"{self.real}: whole replays are for logs in the air")
        if caveat := clock_caveat(log, self.clocks):
            console.status(f"warning: {caveat}")
        groups = self._groups(log)
        if self.gat is not None:
            if (column := next(find_other_commands(log), None)) is not None:
                raise ConfigError("gat", f"learns positions alone, and the log has {column}; gat=null leaves it out")
            for group in groups:
                lengths = [usable(episode) for episode in self._rest(log, group).episodes]
                self.gat.check(lengths, f"the trajectories without {self.by} {', '.join(map(str, group))}")
        after = [*groups[1:], groups[0]] if self.checks == "values" else [[]] * len(groups)
        with console.plan("fold", [Part()] * len(groups)):
            folds = [self._fold(log, *pair, console) for pair in zip(groups, after, strict=True)]
        documents.write_json(folder / DATA, [fold.document() for fold in folds])
        (folder / TABLE).write_text(table(folds, self.by, self._unit(log)), encoding="utf-8")
        means = {way: float(np.mean(np.concatenate([fold.replayed[way] for fold in folds]))) for way in folds[0].errors}
        return {"folds": len(folds), "mean_error": means, "causes": {fold.held_out: fold.causes for fold in folds}}

    def _unit(self, log: Batch) -> str:
        """Return the unit in which a reader is told an error of all joints."""
        return say(with_log_in_angles(log, self.sim.plant)[1].robot, log.joints, "rad")[1]

    def _groups(self, log: Batch) -> list[list[Any]]:
        """Return what is held out together: each value alone, or every so many'th of them in order."""
        values = self._values(log)
        count = len(values) if self.folds is None else self.folds
        if count > len(values):
            raise ConfigError("folds", f"the label {self.by} has {len(values)} values", given=str(count))
        if count == 2 and self.checks == "values":
            name = "by" if self.folds is None else "folds"
            problem = "two groups leave no next one to check on; take three, or checks=motions"
            raise ConfigError(name, problem, given=str(getattr(self, name)))
        return [values[k::count] for k in range(count)]

    def _values(self, log: Batch) -> list[Any]:
        labels = log.metadata.get("episodes") or []
        values: list[Any] = []
        for label in labels:
            if isinstance(value := label.get(self.by), SINGLE) and not any(alike(value, other) for other in values):
                values.append(value)
        if len(values) < 2:
            names = ", ".join(sorted({key for label in labels for key in label if isinstance(label[key], SINGLE)}))
            names = names or "there are none"
            problem = f"needs a label with two values at least; the log's labels: {names}"
            raise ConfigError("by", problem, given=self.by)
        return sorted(values, key=lambda value: (str(type(value)), value))

    def _fold(self, log: Batch, values: list[Any], inner: list[Any], console: Console) -> Fold:
        """Diagnose the trajectories without some values, which know nothing of the others; these are looked at once."""
        title = f"{self.by} {', '.join(map(str, values))}"
        console.begin(f"{title} held out")
        options = Options(
            self.without, self.most, self.duels, self.nulls, threads(self.workers), share_clock(log, self.clocks),
            seed=self.seed, tolerance=self.tolerance, held_out={self.by: inner} if inner else {},
        )  # fmt: skip
        log, plant = with_log_in_angles(log, self.sim.plant)
        findings = diagnose(self._rest(log, values), plant, self.sim.step, options, PhaseReporter(console))
        exp = prepare(log, lump(plant.robot), replace(options, held_out={self.by: values}))
        chosen = findings.selection.chosen
        before = findings.simulator.simulate({}, no_shifts(len(exp.joints)), exp.pieces)
        after = findings.simulator.simulate(chosen.effects, chosen.fit.shifts, exp.pieces)
        causes = [chosen.names[cause.index] for cause in findings.verdict.causes]
        console.status(f"{title}: {' '.join([findings.verdict.word, *causes])}")
        console.phase("replaying what was held out")
        errors, servos = self._errors(findings, _check(exp))
        factor = say(findings.log.robot, findings.log.joints, "rad")[0]
        errors = {way: [factor * error for error in own] for way, own in errors.items()}
        console.finish()
        return Fold(
            values=values,
            verdict=findings.verdict.word,
            causes=causes,
            parameters=effects_in_metres(chosen.effects, findings.log.robot),
            removed=compute_removed(exp, exp.residual(before), exp.residual(after))[0],
            ceiling=ceiling(exp, before, learn_laws(exp, findings.simulator, chosen.effects, chosen.fit.shifts)),
            names=[record.name for record in _check(exp)],
            errors=errors,
            servos=servos,
        )

    def _rest(self, log: Batch, values: list[Any]) -> Batch:
        labels = log.metadata["episodes"]
        kept = [k for k, label in enumerate(labels) if not any(alike(label.get(self.by), value) for value in values)]
        about = {**log.metadata, "episodes": [labels[k] for k in kept]}
        return replace(log, episodes=tuple(log.episodes[k] for k in kept), metadata=about)

    def _errors(self, findings: Findings, held: Sequence[Record]) -> tuple[dict[str, list[float]], dict[str, Any]]:
        """Return the mean absolute error of every held-out trajectory in angles, by what replays it, and its servos."""
        n = len(findings.log.joints)
        ways: dict[str, tuple[Mapping[str, Any], np.ndarray]] = {AS_IT_WAS: ({}, no_shifts(n))}
        fits = {CALIBRATED: findings.selection.none, _names(self.usual): _usual(findings, self.usual)}
        for way, fit in {**fits, DIAGNOSED: findings.selection.chosen}.items():
            ways[way] = fit.effects, fit.fit.shifts
        robot = findings.log.robot
        errors = {
            way: mean_errors(findings.simulator, effects, nuisances, held, robot).mean(axis=1).tolist()
            for way, (effects, nuisances) in ways.items()
        }
        for name, way in ((GAT, AS_IT_WAS), (DIAGNOSED_GAT, DIAGNOSED)) if self.gat is not None else ():
            assert self.gat is not None
            world = Simulated(self.sim, findings.simulator, robot, *ways[way])
            errors[name] = self.gat.errors(world, findings.log.records, held, self.seed)
        servos: dict[str, Any] = {}
        for name, way in ((SERVO, AS_IT_WAS), (DIAGNOSED_SERVO, DIAGNOSED)) if self.servo else ():
            effects, nuisances = ways[way]
            plant = change(findings.simulator.plant, effects, nuisances)
            errors[name], servos[name] = servo_errors(
                findings.log, plant, findings.simulator.step, held, seed=self.seed, threads=threads(self.workers)
            )
        return errors, servos


def _check(exp: Log) -> list[Record]:
    """Return the trajectories that are held out, those too short for a window left out."""
    return [exp.records[k] for k in np.unique(exp.pieces.record[exp.held_out])]


def _usual(findings: Findings, effects: Sequence[str]) -> Hypothesis:
    """Return these effects on all joints, fitted together as a diagnosis fits a hypothesis."""
    problem = findings.problem
    everywhere = {candidate.effect: candidate for candidate in library(findings.log.robot) if candidate.on_joints}
    chosen = tuple(everywhere[name] for name in effects)
    start = [candidate.neutral + SLIGHT * (candidate.documented[1] - candidate.neutral) for candidate in chosen]
    return problem.fit(chosen, np.concatenate(start), no_shifts(problem.train.joints), every=1, rounds=8)


def _names(effects: Sequence[str]) -> str:
    return " + ".join(name.removesuffix("_friction") for name in effects)
