"""Whole trajectories replayed through a grounding by actions (GAT), learned from the same logs as a diagnosis."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.plant import noiseless
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch, Trajectory
from gsl.core.transitions import transitions
from gsl.diagnosis.log.records import Record, cut_pieces, group_alike, slope
from gsl.diagnosis.simulate.in_the_air import Effects, change
from gsl.diagnosis.simulate.simulator import Simulator, mean_errors
from gsl.errors import ConfigError, GslError
from gsl.grounding.gat import LoadedTransformation
from gsl.models.config import FARTHEST, ModelConfig
from gsl.models.ensemble import Forward
from gsl.models.forward import ForwardModel
from gsl.models.free_run import shortest
from gsl.models.inverse import Solver
from gsl.models.linear import fit_linear
from gsl.training.data import split_batch
from gsl.training.forward import fit_forward
from gsl.training.inverse import Damping, fit_inverse
from gsl.validation.model_requirements import SHRINKING, extra_ticks_of, looking_ahead
from gsl.worlds.bullet import BulletEnv, BulletWorld
from gsl.worlds.held import Windows
from gsl.worlds.start import resting

SHARE = 0.2  # of the trajectories that stop a fit, and again of those that judge it
PLAYED = 2.0  # length of what the simulator plays for the inverse model [s]
LEAST = 3  # trajectories that it takes to fit a model


@component
class LearnedReplay:
    """How the grounding is learned; the defaults of its config are the recipe's.

    The inverse model solves one of the simulator, which learns what this does with the logs' commands and noise on top.
    The forward model corrects that, linearly, by how the robot differs (`residual`), or learns the logs alone, as in
    the paper. Where conditions of trajectories are known, such as gains, there is a model of the simulator under each.
    """

    model: Annotated[ModelConfig, setting("of the simulator, and of the robot where that is no residual")]
    residual: Annotated[bool, setting("the robot's model corrects the simulator's, or learns the logs alone")] = True
    damping: Damping = 0.2
    noise: Annotated[float, setting("on the commands that the simulator plays", unit="rad", ge=0)] = 0.015

    def __post_init__(self) -> None:
        """Refuse what cannot be learned from joints alone, and what a correction cannot be."""
        if self.model.sensors:
            raise ConfigError("gat.model.sensors", "logs in the air have joints alone; leave the sensors out")
        if self.model.variables != "all":
            raise ConfigError("gat.model.variables", "whole replays are of all joints; leave the variables out")
        if self.model.rested:
            raise ConfigError("gat.model.rested", "logs are learned from in cuts, which do not begin at rest")
        if self.model.head.draws or self.model.members > 1:
            raise ConfigError(
                "gat.model", "replays are of one model that says a point; leave likelihood and members out"
            )
        if self.model.multi_step > 1:
            raise ConfigError("gat.model.multi_step", "is of a search's f", given=str(self.model.multi_step))
        if self.residual and (self.model.history == "auto" or self.model.encoding != "plain"):
            raise ConfigError("gat.model", "a correction has a history of one length, and plain angles")

    @property
    def least_ticks(self) -> int:
        """Control periods a trajectory has to have to be learned from."""
        farthest = looking_ahead(self.model, FARTHEST)  # nobody knows yet what is diagnosed
        return shortest(farthest.of_joints, farthest.horizon)

    def check(self, lengths: Sequence[int], source: str) -> None:
        """Refuse to learn from too little.

        Args:
            lengths: Of the trajectories [control periods].
            source: Which they are, in words.

        Raises:
            ConfigError: Too few are long enough.
        """
        if sum(length >= self.least_ticks for length in lengths) < LEAST:
            problem = (
                f"{source} are fewer than {LEAST} trajectories of {self.least_ticks} control periods to learn from"
            )
            raise ConfigError("gat", f"{problem}; gat=null leaves it out")

    def errors(self, world: Simulated, records: Sequence[Record], held: Sequence[Record], seed: int) -> list[float]:
        """Return the mean absolute error of every held-out trajectory [rad], NaN where a replay diverges.

        Args:
            world: What replays.
            records: Trajectories to learn from.
            held: What is replayed.
            seed: Of the noise and the fits.

        Raises:
            ConfigError: There are too few trajectories to learn from.
        """
        learner = replace(self, model=looking_ahead(self.model, world.extra_ticks))
        records = [
            record for record in (record.cut_to_driven() for record in records) if len(record) >= self.least_ticks
        ]
        self.check([len(record) for record in records], "the rest")
        every = [*records, *held]
        kinds = group_alike([record.conditions for record in every])
        kind = {k: number for number, index in enumerate(kinds) for k in index}
        solvers = [learner._solver(world, records, every[index[0]].conditions, seed) for index in kinds]
        forwards = learner._forwards(world, records, [kind[k] for k in range(len(records))], solvers, seed)
        return [
            world.measure_replay(record, LoadedTransformation(forwards[kind[k]], solvers[kind[k]]), seed)
            for k, record in enumerate(held, start=len(records))
        ]

    def _solver(self, world: Simulated, records: Sequence[Record], conditions: Mapping[str, Any], seed: int) -> Solver:
        """Return what solves the simulator under some conditions for actions."""
        played = world.batch(world.play(records, conditions, self.noise, seed))
        if len(played) < LEAST:
            raise GslError("GAT cannot learn a simulator whose replays diverge; gat=null leaves it out")
        solver, _ = fit_inverse(self.model, split_batch(played, SHARE, seed), seed, "solve", self.damping)
        assert isinstance(solver, Solver)
        return solver

    def _forwards(
        self, world: Simulated, records: Sequence[Record], kind: Sequence[int], solvers: Sequence[Solver], seed: int
    ) -> list[Forward]:
        """Return a forward model for every solver, given which one each trajectory belongs to."""
        logged = world.batch(map(world.convert, records))
        if not self.residual:
            return [fit_forward(self.model, split_batch(logged, SHARE, seed), seed)[0]] * len(solvers)
        bases = [solver.simulator for solver in solvers]
        rows = [
            transitions([episode], bases[0].history, bases[0].horizon, carried_out=True) for episode in logged.episodes
        ]
        windows = np.concatenate([samples.windows for samples in rows])
        left = np.concatenate(
            [
                samples.change - bases[number].effects(samples.windows)
                for samples, number in zip(rows, kind, strict=True)
            ]
        )
        network = fit_linear(windows, left, ridge=max(self.model.ridge, SHRINKING))
        return [ForwardModel(network, base.history, base.joints, horizon=base.horizon, base=base) for base in bases]


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

    @property
    def extra_ticks(self) -> int:
        """Ticks more than one that a model has to look ahead."""
        return extra_ticks_of(change(self.simulator.plant, self.effects).servo, self.simulator.period)

    def play(
        self, records: Sequence[Record], conditions: Mapping[str, Any], noise: float, seed: int
    ) -> Iterator[Trajectory]:
        """Yield what the simulator does from the states and with the commands of logs, in cuts, with noise on top."""
        joints, longest = self.nuisances.shape[1], round(PLAYED / self.simulator.period)
        rng = np.random.default_rng(derive_seed(seed, "played"))
        for record in records:
            about, length = replace(record, about={**record.about, "conditions": conditions}), min(longest, len(record))
            cut = cut_pieces([about], self.robot, self.simulator.period, warm_up=0, scored=length)
            assert isinstance(cut.windows, Windows)
            commands = cut.windows.commands.copy()
            commands[:, :length] += noise * rng.standard_normal((len(cut), length, joints))[..., self.robot.drive]
            noisy = replace(cut, windows=cut.windows._replace(commands=commands))
            replays = self.simulator.simulate(self.effects, self.nuisances, noisy)
            for start, path, asked in zip(cut.windows.motion[:, :1, :joints], replays, commands, strict=True):
                if np.isfinite(path).all():
                    yield self._trajectory(asked[:length, :joints][::-1], np.vstack([start, path]))

    def measure_replay(self, record: Record, grounding: LoadedTransformation, seed: int) -> float:
        """Return the mean absolute error of a replay behind a grounding [rad]; NaN if it diverges."""
        record = record.cut_to_driven()
        if (
            not len(record)
            or np.isnan(mean_errors(self.simulator, self.effects, self.nuisances, [record], self.robot)).any()
        ):
            return float("nan")  # Bullet bounds speeds, so that it does not say
        start = resting(self.robot, record.position[0][self.robot.drive], record.targets[0], floating=False)
        motion = np.array([record.position[0], record.velocity[0]])[:, self.robot.drive]
        start = start._replace(reading=start.reading._replace(motion=motion))
        env, positions = self._env(record.conditions), []
        run = grounding.start(env.layout, np.random.default_rng(seed))
        try:
            seen, _ = env.reset(seed=seed, options={"start": start})
            for action in record.targets[:, : len(env.layout.joints)]:
                seen, *_ = env.step(run.transform(seen, action))
                positions.append(seen[env.layout["position"]])
        finally:
            env.close()
        return float(np.abs(np.array(positions) - record.position[1:]).mean())

    def _env(self, conditions: Mapping[str, Any]) -> BulletEnv:
        """Return the engine with this simulator, in which a grounding can act, without noise as in all replays."""
        period, step = self.simulator.period, self.simulator.step
        world = replace(self.world, floating=False, step=step, period=period)
        plant = change(self.simulator.plant, self.effects, self.nuisances)
        return BulletEnv(world, noiseless(change(plant, conditions)))

    def convert(self, record: Record) -> Trajectory:
        """Return a log's trajectory as a model learns it."""
        return self._trajectory(record.targets[:, : record.position.shape[1]], record.position)

    def batch(self, episodes: Iterable[Trajectory]) -> Batch:
        """Return trajectories of this robot."""
        return Batch(tuple(episodes), self.robot.controlled, self.simulator.period)

    def _trajectory(self, action: np.ndarray, position: np.ndarray) -> Trajectory:
        period = self.simulator.period
        return Trajectory(period * np.arange(len(position)), action, position, slope(position, period))
