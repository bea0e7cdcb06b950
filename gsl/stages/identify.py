"""Identify: fit every parameter of the effect library at once to a log, as system identification does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import yaml

from gsl.core.console import Console
from gsl.core.described import describe
from gsl.core.interruption import checkpoint
from gsl.core.setting import component, setting
from gsl.diagnosis.angles import effects_in_metres
from gsl.diagnosis.log.files import log_parents, read_logs, take_motions
from gsl.diagnosis.log.gains import list_added_gains, unseen_gains, with_logged_gains
from gsl.diagnosis.options import Options, Without
from gsl.diagnosis.search.reference import Nominal
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.in_the_air import Effects
from gsl.diagnosis.simulate.simulator import Bench
from gsl.diagnosis.verdict.findings import join_effects
from gsl.robots.catalogue import see_from as see_robot_from
from gsl.rollout.parallel import Workers, threads
from gsl.storage import documents
from gsl.storage.diagnosis_report import REPORT
from gsl.training.system_identification import identify
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.fits import check_replayable

WORLD = "world/identified.yaml"


@component
class Identify:
    """The baseline of `diagnose`: same log, same library, no verdict; `grounding=identified` trains in the result.

    What the library lacks is absorbed by the parameters that come nearest to it: a good fit names no cause.
    """

    kind: ClassVar[str] = "identify"

    real: Annotated[str, setting("trajectories in the air: a run, a parquet file or a folder of them", min_length=1)]
    sim: Annotated[BulletWorld, setting("the simulator that is fitted to them")]
    without: Without = ()
    evaluations: Annotated[int, setting("replays of the log that the fit may take", ge=16)] = 4800
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def __post_init__(self) -> None:
        """Refuse a simulator that logs cannot be replayed in."""
        check_replayable(self.sim.motors, self.sim.plant)

    def parents(self) -> Mapping[str, Path]:
        """Return the files that are read."""
        return log_parents(real=self.real)

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write report.json and the identified world."""
        batch = read_logs(self.real)
        log, plant = take_motions(batch, self.sim.plant, self.real)
        sensors = [episode.sensors for episode in batch.episodes]
        sim = with_logged_gains(self.sim, sensors, self.real)
        if sim is not self.sim:
            return {**replace(self, sim=sim).run(folder, console), **list_added_gains(self.sim, sim)}
        if warning := unseen_gains(sensors, log.joints):
            console.status(f"warning: {warning}")
        options = Options(self.without, threads=threads(self.workers))
        problem = Nominal(plant, self.sim.step).problem(log, options, lambda phase: checkpoint())
        with console.progress(self.evaluations, "fitting all parameters at once") as progress:
            system = identify(problem, evaluations=self.evaluations, seed=self.seed, tick=progress.advance)
        before, after = (_gap(problem.held_out, effects) for effects in ({}, system.effects))
        effects = join_effects(effects_in_metres(system.effects, log.robot))
        fit = f"{len(system.candidates)} parameters of {len(effects)} effects were fitted at once"
        summary = f"{fit}: held out, {before:.1f} noise floors became {after:.1f}."
        report = {
            "verdict": "identified",
            "causes": [{"effect": name} for name in effects],
            "summary": summary,
            "effects": effects,
            "shrinkage": {"before": before, "after": after},
        }
        documents.write_json(folder / REPORT, report)
        world = describe(self.sim) | {"effects": join_effects(describe(self.sim)["effects"], effects)}
        world["robot"] = see_robot_from(self.sim.robot, folder)
        (folder / WORLD).parent.mkdir()
        text = yaml.safe_dump(documents.plain(world), sort_keys=False, allow_unicode=True)
        (folder / WORLD).write_text(f"# {summary}\n{text}", encoding="utf-8")
        return {"effects": len(effects), "before": before, "after": after}


def _gap(bench: Bench, effects: Effects) -> float:
    """Return the root mean square of the residuals [noise floors]."""
    z = bench.residual(effects, no_shifts(bench.joints))
    used = bench.comparison.count_residuals(z.shape[1])
    return float(np.sqrt((z**2).sum() / (used.sum() * len(z))))
