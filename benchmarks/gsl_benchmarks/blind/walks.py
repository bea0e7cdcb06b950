"""Walks: what a robot on the ground logs, one of a make with jitter, as its joints, base and feet tell with noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from gsl.core.body import lump
from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.log.records import slope
from gsl.policies.policy import neighbour
from gsl.policies.walk_engine import WalkEngine
from gsl.worlds.bullet import BulletWorld
from gsl_benchmarks.blind.jitter import jitter

STEP = 0.001  # physics period of the robot's world [s]: a diagnosis fits at that of the simulator
SOLE = 0.05  # relative spread of the friction under the feet
ITSELF = 3  # every how manieth walk is of the policy itself; the others are of its neighbours
PLACE, ANGLE, VELOCITY, GYRO = 0.001, 0.001, 0.005, 0.005  # noise of the base [m], [rad], [m/s], [rad/s]: estimate


@component
class Walks:
    """How a robot on the ground is logged: the walk engine from its start values, and spread around them."""

    episodes: Annotated[int, setting("walks in a log", ge=2)] = 12
    duration: Annotated[float, setting("planned length of a walk", unit="s", ge=1.0)] = 7.0
    spread: Annotated[float, setting("of the parameters, in units of a parameter's scale", ge=0)] = 0.07
    still: Annotated[float, setting("least share of the planned time on its feet", ge=0, le=1)] = 0.75

    def log(
        self, sim: BulletWorld, individual: Individual | None, effects: Mapping[str, Any], noise: float,
        rng: np.random.Generator,
    ) -> Batch:  # fmt: skip
        """Return what a robot logs; its metadata say nothing of the causes.

        Args:
            sim: The world that it is nominally alike to.
            individual: How this one differs from others of its make; None for the nominal one at the simulator's step.
            effects: As a world's `effects:`.
            noise: Standard deviation of the encoders [rad].
            rng: Of everything.
        """
        own = {} if individual is None else {"individual": individual}
        step = sim.step if individual is None else min(STEP, sim.step)
        env = replace(sim, effects={**sim.effects, **own, **effects}, floating=True, step=step).make()
        engine, logs = WalkEngine(), []
        names = ["pi0" if k % ITSELF == 0 else f"neighbour_{k:02d}" for k in range(self.episodes)]
        for name in names:
            near = neighbour(engine, engine.initial, 0.0 if name == "pi0" else self.spread, rng)
            logs.append(_noisy(self._walk(env, engine, near, int(rng.integers(2**31))), noise, sim.period, rng))
        env.close()
        about = {"robot": lump(sim.plant.robot).name, "role": "real", "source": "gsl blind"}
        episodes = [{"policy": name} for name in names]
        return Batch(tuple(logs), env.layout.joints, sim.period, {**about, "episodes": episodes})

    def on_foot(self, log: Batch) -> float:
        """Return the share of the planned time that the robot walks."""
        return sum(map(len, log.episodes)) * log.control_period / (len(log) * self.duration)

    def _walk(self, env: Any, engine: WalkEngine, parameters: np.ndarray, seed: int) -> Trajectory:
        """Return one walk up to its fall."""
        layout = env.layout
        observation, _ = env.reset(seed=seed, options={"posture": engine.posture(parameters, layout)})
        run, seen, fell = engine.start(parameters, layout), [observation], False
        actions: list[np.ndarray] = []
        while not fell and len(actions) < round(self.duration / layout.control_period):
            actions.append(run.act(observation))
            observation, _, fell, _, _ = env.step(actions[-1])
            seen.append(observation)
        states, down = np.array(seen), np.zeros(len(seen), dtype=bool)
        down[-1] = fell
        sensors = {
            column: states[:, layout[part].start + index]
            for part, columns in layout.columns.items()
            for index, column in enumerate(columns)
        }
        times = layout.control_period * np.arange(len(seen))
        return Trajectory(
            times, np.array(actions), states[:, layout["position"]], states[:, layout["velocity"]], fell=down,
            sensors=sensors,
        )  # fmt: skip


@dataclass(frozen=True)
class Individual:
    """An effect that makes another robot of the same make, on another floor."""

    kind: ClassVar[str] = "command"
    rank: ClassVar[int] = -1  # before any other

    seed: int

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with jitter."""
        rng = np.random.default_rng(self.seed)
        other, contact = jitter(plant, rng), plant.contact
        ground = contact.ground_friction * float(np.exp(SOLE * rng.standard_normal()))
        return replace(other, contact=replace(contact, ground_friction=ground))


def _noisy(walk: Trajectory, noise: float, period: float, rng: np.random.Generator) -> Trajectory:
    """Return a walk as encoders, a motion capture and an inertial unit tell it."""
    sensors = dict(walk.sensors)
    for name, size in (("base.position", PLACE), ("base.velocity", VELOCITY), ("gyro", GYRO)):
        for axis in "xyz":
            sensors[f"{name}.{axis}"] = sensors[f"{name}.{axis}"] + size * rng.standard_normal(len(walk) + 1)
    names = [f"base.orientation.{axis}" for axis in "xyzw"]
    turn = Rotation.from_quat(np.stack([sensors[name] for name in names], axis=1))
    wrong = Rotation.from_rotvec(ANGLE * rng.standard_normal((len(walk) + 1, 3)))
    sensors |= dict(zip(names, (turn * wrong).as_quat().T, strict=True))
    position = walk.position + noise * rng.standard_normal(walk.position.shape)
    return replace(walk, position=position, velocity=slope(position, period), sensors=sensors)
