"""A plan of a diagnosis: what an iteration plays on the real robot in the air, and how thoroughly it looks at it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from gsl.core.console import Console
from gsl.core.interfaces import REAL, Grounding, World
from gsl.core.setting import component, setting
from gsl.diagnosis.options import Without
from gsl.errors import ConfigError
from gsl.grounding.diagnosis_file import Diagnosis, read_diagnosis
from gsl.grounding.effects import DiagnosedEffects, innermost, switch_on
from gsl.grounding.servo import LearnedServo
from gsl.policies.excitation import Excitation
from gsl.report.flight import Flight
from gsl.stages.collect import Collect
from gsl.stages.diagnose import Diagnose
from gsl.stages.identify import Identify
from gsl.stages.link import build_link
from gsl.stages.train_servo import TrainServo
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.tasks.excite import Excite
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.external import ExternalRobot, asking
from gsl.worlds.fits import check_replayable

EXCITATION = "collect_excitation"
ROBOTS_ONLY = "only robots in Bullet worlds are excited in the air; take another grounding"


@component
class DiagnosisPlan:
    """Excitation and thoroughness; an excitation knows no policy, so that one serves all iterations."""

    excitation: Annotated[Excitation, setting("what is played in the air")]
    most: Annotated[int, setting("effects at once, at most", ge=1, le=6)] = 4
    duels: Annotated[int, setting("simulated logs of each surviving cause in the self-test", ge=0)] = 2
    nulls: Annotated[int, setting("simulated logs without an effect in the self-test", ge=0)] = 3
    evaluations: Annotated[int, setting("replays that an identification may take", ge=16)] = 4800
    without: Without = ()

    def carry_out(
        self, real: World, sim: World, method: str, home: Path, *, workers: int, seed: int, console: Console
    ) -> Artifact:
        """Return what a method finds of a simulator in an excitation of the real robot, both built below `home`.

        Raises:
            ConfigError: One of the two worlds is not of a kind that is diagnosed.
        """
        if not isinstance(sim, BulletWorld):
            raise ConfigError("grounding", ROBOTS_ONLY)
        check_replayable(sim.motors, sim.plant)
        log = self.flown(real, home, workers=workers, seed=seed, console=console)
        stage: Diagnose | Identify = Identify(
            str(log.folder), sim, without=self.without, evaluations=self.evaluations, workers=workers, seed=seed
        )
        if method == Diagnose.kind:
            stage = Diagnose(
                real=str(log.folder),
                sim=sim,
                without=self.without,
                most=self.most,
                duels=self.duels,
                nulls=self.nulls,
                workers=workers,
                seed=seed,
            )
        return build_link(stage, home / method, console)

    def servo(
        self, real: World, sim: World, effects: Diagnosis | None, home: Path, *,
        members: int = 1, workers: int, seed: int, console: Console,
    ) -> Artifact:  # fmt: skip
        """Return the servo learned from an excitation of the real robot, on top of effects if there are any.

        Raises:
            ConfigError: One of the two worlds has no servos.
        """
        if not isinstance(sim, BulletWorld):
            raise ConfigError("grounding", ROBOTS_ONLY)
        check_replayable(sim.motors, sim.plant)
        log = self.flown(real, home, workers=workers, seed=seed, console=console)
        below = sim if effects is None else switch_on(sim, effects)
        assert isinstance(below, BulletWorld), "effects leave a world what it is"
        stage = TrainServo(real=str(log.folder), sim=below, members=members, workers=workers, seed=seed)
        name = stage.kind if effects is None else f"{stage.kind}_on_effects"
        return build_link(stage, home / (name if members == 1 else f"{name}_members"), console)

    def flown(self, real: World, home: Path, *, workers: int, seed: int, console: Console) -> Artifact:
        """Return the log of an excitation of the real robot in the air, built below `home`.

        Raises:
            ConfigError: The real world is not a robot.
        """
        if not isinstance(real, BulletWorld | ExternalRobot):
            raise ConfigError("grounding", ROBOTS_ONLY)
        played = Collect(
            world=asking(replace(real, floating=False), home / EXCITATION),
            task=Excite(duration=self.excitation.duration),
            policy=self.excitation,
            role=REAL,
            episodes=1,
            workers=workers,
            seed=seed,
        )
        return build_link(played, home / EXCITATION, console)


def flown(home: Path, asked: Grounding, ready: Grounding) -> Flight | None:
    """Return what lies below `home` of a plan that was carried out, None if a grounding needed none to be ready."""
    if ready is asked:
        return None
    inner = innermost(ready)
    if not isinstance(ready, DiagnosedEffects) and not isinstance(inner, LearnedServo):
        return None
    spent = Artifact(home / EXCITATION, manifest.read(home / EXCITATION)).metrics
    diagnosis = servo = None
    if isinstance(ready, DiagnosedEffects) and not ready.effects:
        diagnosis = read_diagnosis(str(home / ready.method), ready.method)
    if isinstance(inner, LearnedServo):
        servo = Artifact(Path(inner.servo), manifest.read(Path(inner.servo))).metrics
    return Flight(spent["real_episodes"], spent["seconds"], diagnosis, servo)
