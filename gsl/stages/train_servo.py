"""Train the servo: learn from a log in the air what the robot's servos do that the simulator's do not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import yaml

from gsl.core.console import Console
from gsl.core.described import describe
from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.core.words import several
from gsl.diagnosis.log.files import check_log, log_parents, on_ground, read_logs, take_motions
from gsl.diagnosis.log.gains import list_added_gains, unseen_gains, with_logged_gains
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.options import Tolerance
from gsl.errors import ConfigError, InputError
from gsl.models.servo import ServoModel, neutral
from gsl.models.servo_file import FILE
from gsl.models.servo_members import ServoMembers
from gsl.report.servo_curves import servo_curves
from gsl.report.servo_page import write_servo_page
from gsl.robots.catalogue import see_from as see_robot_from
from gsl.rollout.parallel import Workers, threads
from gsl.storage import documents
from gsl.storage.models import write_model
from gsl.training.learn_servo import LearnedServo, document, learn_servo
from gsl.training.servo_verdict import problems, remarks
from gsl.training.servo_walks import Walks, walks
from gsl.training.torque_width import measure_widths
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.fits import check_hinges, check_replayable, fitting_step

WORLD, CURVES = "world/learned.yaml", "servo.png"


@component
class TrainServo:
    """Fits a servo law to a log of joint motion alone, on top of the servos that the simulator has.

    Every second motion is held out: half of these say when to stop, the others are for the figures.
    """

    kind: ClassVar[str] = "train_servo"

    real: Annotated[str, setting("trajectories in the air: a run, a parquet file or a folder of them", min_length=1)]
    sim: Annotated[BulletWorld, setting("the simulator whose servos are to become the robot's")]
    walks: Annotated[str | None, setting("trajectories on the ground besides, from which numbers are learned too")] = (
        None
    )
    tolerance: Tolerance = 0.0
    held_out: Annotated[
        Mapping[str, Any], setting("labels of the trajectories that are for checking; {} is every second motion")
    ] = field(default_factory=dict)
    members: Annotated[int, setting("of an ensemble; a further one takes a third of the time", ge=1, le=64)] = 1
    workers: Workers = -1
    seed: Annotated[int, setting("of the first weights", ge=0)] = 1

    def __post_init__(self) -> None:
        """Refuse to stand on another learned servo, and joints that have none."""
        check_replayable(self.sim.motors, self.sim.plant)
        if self.sim.servo is not None:
            raise ConfigError("sim.servo", "is a learned servo already; learn on top of the world without it")

    def parents(self) -> Mapping[str, Path]:
        """Return the files that are read."""
        return log_parents(real=self.real, walks=self.walks)

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the checkpoint, the world that it makes and what it has learned as curves."""
        batch = read_logs(self.real)
        exp, plant = take_motions(batch, self.sim.plant, self.real, self.held_out)
        sensors = [episode.sensors for episode in batch.episodes]
        sim = with_logged_gains(self.sim, sensors, self.real)
        if sim is not self.sim:
            return {**replace(self, sim=sim).run(folder, console), **list_added_gains(self.sim, sim)}
        if warning := unseen_gains(sensors, exp.joints):
            console.status(f"warning: {warning}")
        if len(exp.held_out) < 2:
            raise InputError(f"{self.real}: one window is held out; a servo needs two, to stop by and to check by")
        exp = exp.with_model_error(np.full(len(exp.joints), self.tolerance))
        walked = self._walks(exp)
        console.phase(f"learning the servo from {several(len(exp.records), 'motion')}; a minute for a humanoid")
        learned = learn_servo(
            exp, plant, self.sim.step, labelled=bool(self.held_out), seed=self.seed,
            threads=threads(self.workers), members=self.members, walks=walked,
        )  # fmt: skip
        console.phase("measuring what the servo leaves unexplained")
        noise = self._measure_rest(exp, learned.model, plant)
        model, *further = (
            replace(servo, noise=noise).in_metres(plant, self.sim.plant)
            for servo in (learned.model, *(member.model for member in learned.further))
        )
        write_model(folder, ServoMembers((model, *further)))
        self._write_world(folder, learned)
        servo_curves(folder / CURVES, self.sim.plant, model, fitting_step(self.sim.step, exp.period), exp.period)
        metrics = document(learned) | {"step": fitting_step(self.sim.step, exp.period), "period": exp.period}
        for line in [*(f"a search will refuse it: {problem}" for problem in problems(metrics)), *remarks(metrics)]:
            console.status(f"warning: {line}")
        noises = dict(zip(model.joints, model.noise.tolist(), strict=True))
        metrics |= {"torque_noise": noises, "problems": problems(metrics)}
        way = [progress.level for progress in learned.way]
        write_servo_page(folder, metrics, model, self.sim.plant, exp.period, way, spent=_count_real(exp, learned))
        return metrics

    def _walks(self, exp: Log) -> Walks | None:
        """Return the log on the ground, if there is one.

        Raises:
            InputError: It cannot be replayed, or has other joints or another rate than the log in the air.
        """
        if self.walks is None:
            return None
        batch = read_logs(self.walks)
        check_log(batch, exp.robot, self.walks)
        if not on_ground(batch):
            raise InputError(f"{self.walks}: the robot is in the air here; name these logs in real=")
        check_hinges(exp.robot, self.walks)
        if abs(batch.control_period - exp.period) > 1e-9:
            rates = f"{batch.control_period:g} s, not {exp.period:g} s as in {self.real}"
            raise InputError(f"{self.walks}: has another control period, {rates}; resample one of them")
        return walks(batch, exp.robot, self.sim.plant, self.sim.step, threads(self.workers))

    def _measure_rest(self, exp: Log, model: ServoModel, plant: Plant) -> np.ndarray:
        """Return the torque noise that held-out motions leave unexplained [N·m], at every step and constant, (n, 2)."""
        group = neutral(plant, np.random.default_rng(0)).group  # of those that keep their servo, too
        groups = {name: group[: len(exp.joints)] == g for g, name in enumerate(model.groups)}
        widths = measure_widths(exp, plant, model, step=self.sim.step, seed=self.seed, groups=groups)
        return np.array([widths[name] for name in model.groups])[group]

    def _write_world(self, folder: Path, learned: LearnedServo) -> None:
        own = {"robot": see_robot_from(self.sim.robot, folder), "servo": FILE}  # this folder is its --config-dir
        text = yaml.safe_dump(documents.plain(describe(self.sim) | own), sort_keys=False, allow_unicode=True)
        gap = f"held out, {learned.before['all']:.2f} noise floors became {learned.after['all']:.2f}"
        (folder / WORLD).parent.mkdir()
        (folder / WORLD).write_text(f"# The simulator with a learned servo: {gap}.\n{text}", encoding="utf-8")


def _count_real(exp: Log, learned: LearnedServo) -> list[tuple[str, str]]:
    """Return what real data the servo was learned from, in words."""
    seconds = exp.period * sum(len(record.targets) for record in exp.records)
    fitted, judged, tested = learned.windows
    return [
        ("motions in the air", f"{len(exp.records)}, {seconds:.0f} s"),
        ("windows to fit", str(fitted)),
        ("windows to stop by", str(judged)),
        ("windows to check by", str(tested)),
    ]
