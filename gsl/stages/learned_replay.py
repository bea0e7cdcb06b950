"""Whole trajectories replayed through a grounding by actions (GAT), learned from the same logs as a diagnosis."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.seeds import derived_seed
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.nuisance import calibrated
from gsl.diagnosis.records import Record, pieces, same, slope
from gsl.diagnosis.replay import Effects, Simulator
from gsl.diagnosis.whole import driven
from gsl.effects.effect import applied, built
from gsl.errors import GslError
from gsl.grounding.gat import LoadedTransformation
from gsl.models.config import ModelConfig
from gsl.models.ensemble import Forward
from gsl.stages import train_forward, train_inverse
from gsl.stages.train_inverse import Damping, Method
from gsl.stages.training import parted
from gsl.worlds.bullet import BulletEnv, BulletWorld
from gsl.worlds.held import Windows
from gsl.worlds.start import resting

SHARE = 0.2  # of the trajectories that stop a fit, and again of those that judge it
PLAYED = 2.0  # length of what the simulator plays for the inverse model [s]
LEAST = 3  # trajectories that it takes to fit a model


@component
class LearnedReplay:
    """How the grounding is learned; the defaults of its config are the recipe's.

    The forward model learns the logs. The inverse model learns what the simulator does with their commands, with noise
    on top and under the conditions of what is to be replayed: a simulator can be asked.
    """

    forward: Annotated[ModelConfig, setting("the forward model of the robot")]
    inverse: Annotated[ModelConfig, setting("the inverse model of the simulator")]
    method: Method = "solve"
    damping: Damping = 0.2
    noise: Annotated[float, setting("on the commands that the simulator plays", unit="rad", ge=0)] = 0.015

    def __post_init__(self) -> None:
        """Refuse body sensors: a robot in the air has none to tell of."""
        if self.forward.sensors:
            raise GslError("gat.forward.sensors: logs in the air have joints alone; leave the sensors out")

    def learned(self, known: Sequence[Record], joints: Sequence[str], period: float, seed: int) -> Forward:
        """Return a forward model of trajectories.

        Raises:
            GslError: There are too few of them.
        """
        drives = [one for one in map(driven, known) if len(one)]
        if len(drives) < LEAST:
            raise GslError(
                f"GAT needs {LEAST} trajectories to learn from, here are {len(drives)}; gat=null leaves it out"
            )
        parts = parted(_batch([_recorded(one, period) for one in drives], joints, period), SHARE, seed)
        return train_forward.fitted(self.forward, parts, seed)[0]

    def errors(
        self, world: Simulated, forward: Forward, known: Sequence[Record], held: Sequence[Record], seed: int
    ) -> list[float]:
        """Return the mean absolute error of every held-out trajectory [rad], NaN where a replay diverges.

        Args:
            world: What replays.
            forward: From `learned`.
            known: Trajectories whose commands the simulator plays for the inverse model.
            held: What is replayed.
            seed: Of the noise and the fits.
        """
        result = np.full(len(held), np.nan)
        for index in same([one.conditions for one in held]):
            conditions = held[index[0]].conditions
            played = _batch(world.played(known, conditions, self.noise, seed), forward.joints, world.simulator.period)
            data = parted(played, SHARE, seed)
            inverse, _ = train_inverse.fitted(self.inverse, data, seed, self.method, self.damping)
            grounding = LoadedTransformation(forward, inverse)
            for k in index:
                result[k] = world.replayed(held[k], grounding, seed)
        return result.tolist()


@dataclass(frozen=True)
class Simulated:
    """A simulator with effects and nuisances, as replays of whole trajectories want it.

    Attributes:
        world: The user's, whose engine steps where a grounding acts.
        simulator: The same held in the air, without a grounding.
        robot: Without fixed joints.
        effects: That are switched on.
        nuisances: Shape (7, n_joints).
    """

    world: BulletWorld
    simulator: Simulator
    robot: Robot
    effects: Effects
    nuisances: np.ndarray

    def played(
        self, known: Sequence[Record], conditions: Mapping[str, Any], noise: float, seed: int
    ) -> Iterator[Trajectory]:
        """Yield what the simulator does from the states and with the commands of logs, in cuts, with noise on top."""
        period, joints = self.simulator.period, self.nuisances.shape[1]
        length = min(round(PLAYED / period), max(map(len, known)))
        about = [replace(one, about={**one.about, "conditions": conditions}) for one in known]
        cut = pieces(about, self.robot, period, warm_up=0, scored=length)
        noises = np.random.default_rng(derived_seed(seed, "played")).standard_normal((len(cut), length, joints))
        commands = cut.windows.commands.copy()
        commands[:, :length] += noise * noises[..., self.robot.drive]
        assert isinstance(cut.windows, Windows)
        told = self.simulator.told(
            self.effects, self.nuisances, replace(cut, windows=cut.windows._replace(commands=commands))
        )
        for start, path, asked in zip(cut.windows.motion[:, :1, :joints], told, commands, strict=True):
            if np.isfinite(path).all():
                yield _trajectory(asked[:length, :joints][::-1], np.vstack([start, path]), period)

    def replayed(self, one: Record, grounding: LoadedTransformation, seed: int) -> float:
        """Return the mean absolute error of a replay whose commands pass through a grounding [rad]."""
        one = driven(one)
        if not len(one):
            return float("nan")
        start = resting(self.robot, one.position[0][self.robot.drive], one.targets[0], floating=False)
        motion = np.array([one.position[0], one.velocity[0]])[:, self.robot.drive]
        start = start._replace(reading=start.reading._replace(motion=motion))
        env = self._env(one.conditions)
        run, told = grounding.start(env.layout, np.random.default_rng(seed)), []
        seen, _ = env.reset(seed=seed, options={"start": start})
        for action in one.targets[:, : len(env.layout.joints)]:
            seen, *_ = env.step(run.transform(seen, action))
            told.append(seen[env.layout["position"]])
        env.close()
        return float(np.abs(np.array(told) - one.position[1:]).mean())

    def _env(self, conditions: Mapping[str, Any]) -> BulletEnv:
        """Return the engine with this simulator, in which a grounding can act."""
        period, step = self.simulator.period, self.simulator.step
        world = replace(self.world, floating=False, step=step, period=period)
        plant = calibrated(applied(self.simulator.plant, built(self.effects)), self.nuisances)
        return BulletEnv(world, applied(plant, built(conditions)))


def _recorded(one: Record, period: float) -> Trajectory:
    return _trajectory(one.targets[:, : one.position.shape[1]], one.position, period)


def _trajectory(action: np.ndarray, position: np.ndarray, period: float) -> Trajectory:
    return Trajectory(period * np.arange(len(position)), action, position, slope(position, period))


def _batch(episodes: Iterable[Trajectory], joints: Sequence[str], period: float) -> Batch:
    return Batch(tuple(episodes), tuple(joints), period)
