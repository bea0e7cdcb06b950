"""Cross-validate: is what `diagnose` finds in a part of the trajectories true of the rest?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from gsl.core.body import lumped
from gsl.core.interruption import checkpoint
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch
from gsl.diagnosis import nuisance
from gsl.diagnosis.attribute import Hypothesis
from gsl.diagnosis.diagnose import Findings, diagnosed
from gsl.diagnosis.document import document
from gsl.diagnosis.experiment import labelled
from gsl.diagnosis.options import Options
from gsl.diagnosis.whole import mean_errors
from gsl.effects.effect import effect_class
from gsl.errors import ConfigError, InputError
from gsl.report.cross_validation import AS_IT_WAS, CALIBRATED, DIAGNOSED, Fold, table
from gsl.stages.logs import check_log, log_files, on_ground, read_logs, synchronised
from gsl.stages.population import Workers, threads
from gsl.storage import documents
from gsl.worlds.bullet import BulletWorld

TABLE, DATA = "table.md", "folds.json"
SLIGHT = 0.05  # of an effect's range: where a fit of the baseline begins


@component
class CrossValidate:
    """A diagnosis for every value of a label, of all trajectories without it; those that have it are replayed whole.

    Beside it stand the simulator as it was, calibrated, and with some usual effects fitted without a diagnosis.
    """

    kind: ClassVar[str] = "cross_validate"

    real: Annotated[str, setting("trajectories in the air: a run, a parquet file or a folder of them", min_length=1)]
    sim: Annotated[BulletWorld, setting("the simulator that disagrees with them")]
    by: Annotated[str, setting("label whose values are held out one after the other", min_length=1)]
    usual: Annotated[tuple[str, ...], setting("effects that are fitted without a diagnosis, to compare with")] = (
        "coulomb_friction",
        "viscous_friction",
    )
    without: Annotated[tuple[str, ...], setting("effects that are left out of the library")] = ()
    clocks: Annotated[
        Literal["synchronised", "unsynchronised"] | None,
        setting(
            "whether commands and measurements share a clock, else no latency is claimed; what the log says if null"
        ),
    ] = None
    most: Annotated[int, setting("effects at once, at most", ge=1, le=6)] = 4
    duels: Annotated[int, setting("simulated logs of each surviving cause in the self-test", ge=0)] = 2
    nulls: Annotated[int, setting("simulated logs without an effect in the self-test", ge=0)] = 3
    tolerance: Annotated[
        float, setting("difference of a joint that does not matter, beside the noise", unit="rad", ge=0)
    ] = 0.0
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def __post_init__(self) -> None:
        """Refuse effects that do not exist."""
        for name in self.usual:
            effect_class(name)

    def parents(self) -> Mapping[str, Path]:
        """Return the files that are read."""
        files = log_files(self.real)
        return {"real" if len(files) == 1 else f"real.{k}": path for k, path in enumerate(files)}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        """Write the table and every fold."""
        log = read_logs(self.real)
        check_log(log, lumped(self.sim.plant.robot), self.real)
        if on_ground(log):
            raise InputError(f"{self.real}: whole replays are for logs in the air")
        folds = [self._fold(log, value, console) for value in self._values(log)]
        documents.write_json(folder / DATA, [one.told() for one in folds])
        (folder / TABLE).write_text(table(folds, self.by, _names(self.usual)), encoding="utf-8")
        means = {way: float(np.mean([np.mean(one.errors[way]) for one in folds])) for way in folds[0].errors}
        return {"folds": len(folds), "mean_error": means, "causes": {str(one.value): one.causes for one in folds}}

    def _values(self, log: Batch) -> list[Any]:
        labels = log.metadata.get("episodes") or []
        found = list(dict.fromkeys(one.get(self.by) for one in labels if one.get(self.by) is not None))
        if len(found) < 2:
            known = ", ".join(sorted({key for one in labels for key in one})) or "there are none"
            problem = f"needs a label with two values at least; the log's labels: {known}"
            raise ConfigError("by", problem, given=self.by)
        return sorted(found, key=lambda value: (str(type(value)), value))

    def _fold(self, log: Batch, value: Any, console: Any) -> Fold:
        console.status(f"{self.by} {value} is held out")
        options = Options(
            self.without, self.most, self.duels, self.nulls, threads(self.workers), synchronised(log, self.clocks),
            seed=self.seed, tolerance=self.tolerance, held_out={self.by: value},
        )  # fmt: skip
        plant = self.sim.plant
        found = diagnosed(log, lumped(plant.robot), plant, self.sim.step, options, lambda phase: checkpoint())
        told = document(found)
        console.status(f"{self.by} {value}: {told['summary']}")
        return Fold(
            value=value,
            verdict=told["verdict"],
            causes=[one["effect"] for one in told["causes"] or told["suspects"]],
            parameters=found.selection.chosen.effects,
            removed=told["shrinkage"]["fraction"],
            ceiling=told["shrinkage"]["ceiling_fraction"],
            names=[one.name for one in _held_out(found, {self.by: value})],
            errors=self._errors(found, {self.by: value}),
        )

    def _errors(self, found: Findings, held: Mapping[str, Any]) -> dict[str, list[float]]:
        """Return the mean absolute error of every held-out trajectory [rad], by what replays it."""
        n = len(found.experiment.joints)
        ways: dict[str, tuple[Mapping[str, Any], np.ndarray]] = {AS_IT_WAS: ({}, nuisance.none(n))}
        fits = {CALIBRATED: found.selection.none, _names(self.usual): _usual(found, self.usual)}
        for way, fit in {**fits, DIAGNOSED: found.selection.chosen}.items():
            ways[way] = fit.effects, fit.fit.nuisances
        records, robot = _held_out(found, held), found.experiment.robot
        return {
            way: mean_errors(found.simulator, effects, nuisances, records, robot).mean(axis=1).tolist()
            for way, (effects, nuisances) in ways.items()
        }


def _held_out(found: Findings, held: Mapping[str, Any]) -> list[Any]:
    return [found.experiment.records[k] for k in labelled(found.experiment.records, held)]


def _usual(found: Findings, effects: Sequence[str]) -> Hypothesis:
    """Return these effects on all joints, fitted together as a diagnosis fits a hypothesis."""
    arena = found.arena
    chosen = tuple(
        next(one for one in arena.library if one.effect == name and one.scope in ("all", "")) for name in effects
    )
    start = [one.neutral + SLIGHT * (one.documented[1] - one.neutral) for one in chosen]
    return arena.fitted(chosen, np.concatenate(start), nuisance.none(arena.train.joints), every=1, rounds=8)


def _names(effects: Sequence[str]) -> str:
    return " + ".join(name.removesuffix("_friction") for name in effects)
