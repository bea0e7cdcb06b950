"""A plan of a diagnosis: what an iteration plays on the real robot in the air, and how thoroughly it looks at it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.grounding.effects import DiagnosedEffects, Diagnosis
from gsl.grounding.grounding import Grounding
from gsl.policies.excitation import Excitation
from gsl.stages.collect import Collect
from gsl.stages.diagnose import Diagnose
from gsl.stages.diagnosis_files import read_diagnosis
from gsl.stages.diagnosis_settings import Without
from gsl.stages.identify import Identify
from gsl.stages.link import built
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.tasks.excite import Excite
from gsl.tasks.task import REAL
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.external import ExternalRobot, asking
from gsl.worlds.velocity_motors import check_servos
from gsl.worlds.world import World

EXCITATION = "collect_excitation"


@component
class DiagnosisPlan:
    """Excitation and thoroughness; an excitation knows no policy, so that one serves all iterations."""

    excitation: Annotated[Excitation, setting("what is played in the air")]
    most: Annotated[int, setting("effects at once, at most", ge=1, le=6)] = 4
    duels: Annotated[int, setting("simulated logs of each surviving cause in the self-test", ge=0)] = 2
    nulls: Annotated[int, setting("simulated logs without an effect in the self-test", ge=0)] = 3
    evaluations: Annotated[int, setting("replays that an identification may take", ge=16)] = 4800
    without: Without = ()

    def carried_out(
        self, real: World, sim: World, method: str, home: Path, *, workers: int, seed: int, console: Any
    ) -> Artifact:
        """Return what a method finds of a simulator in an excitation of the real robot, both built below `home`.

        Raises:
            ConfigError: One of the two worlds is not of a kind that is diagnosed.
        """
        if not isinstance(real, BulletWorld | ExternalRobot) or not isinstance(sim, BulletWorld):
            raise ConfigError("grounding", "only robots in Bullet worlds are diagnosed; take another grounding")
        check_servos(sim.motors)
        played = Collect(
            world=asking(replace(real, floating=False), home / EXCITATION),
            task=Excite(duration=self.excitation.duration),
            policy=self.excitation,
            role=REAL,
            episodes=1,
            workers=workers,
            seed=seed,
        )
        log = built(played, home / EXCITATION, console)
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
                limits=False,
                workers=workers,
                seed=seed,
            )
        return built(stage, home / method, console)


class Flight(NamedTuple):
    """What a diagnosis cost, and what came of it."""

    episodes: int
    seconds: float
    diagnosis: Diagnosis

    @property
    def told(self) -> str:
        """Verdict, what it says, and what is done with it."""
        found = self.diagnosis
        return f"Diagnosis: {found.verdict.replace('_', ' ')}. {found.summary} {found.told}"


def flown(home: Path, asked: Grounding, ready: Grounding) -> Flight | None:
    """Return what lies below `home` of a plan that was carried out, None if a grounding needed none to be ready."""
    if ready is asked or not isinstance(ready, DiagnosedEffects):
        return None
    spent = Artifact(home / EXCITATION, manifest.read(home / EXCITATION)).metrics
    return Flight(spent["real_episodes"], spent["seconds"], read_diagnosis(str(home / ready.method), ready.method))
