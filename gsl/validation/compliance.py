"""Compliance of a simulated robot: its joints are loaded from outside, and their stiffness and strength measured.

An action transformation changes how joints move; how they yield, it need not. The robot hangs in the air and holds its
stance as a constant action; a torque acts on a joint as the ground would. First it swings (stiffness, damping), then
it rises until the joint gives way (its strength). The grounding sees and acts once a control period, as in a search.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.impedance import impedance
from gsl.core.interfaces import Grounding
from gsl.core.plant import Plant, noiseless
from gsl.core.seeds import derive_seed, grounding_generator
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.worlds.bullet import BulletEnv, BulletWorld

FREQUENCY = 1.25  # of the swing [Hz]: a step of the walk takes 0.3 to 0.5 s, a load on its leg as long
AMPLITUDE = 0.35  # of the swing [joint's effort]: 4 times a worn servo's friction, half of a weak one's limit
SETTLING, CYCLES = 1, 3  # cycles before the measurement and in it
RATE, MOST = 0.3, 1.4  # of the rising load [effort/s], and where it ends [effort]: in 3 s to the nominal limit
DRAG = 0.25  # on a joint that gives way [effort·s/rad]: without it the load would also have to move its inertia
BEFORE = -1e-9  # latest time of a clock before an episode, whose zero is rounded [s]
REMEMBERED = 16  # robots without a grounding, measured once a process: a study has a few worlds and many trials
YIELDED = 0.1  # deflection beyond the linear one at which a joint has given way [Joint.size]: 5 times the NAO's


@dataclass(frozen=True)
class Compliance:
    """How each motor of a robot answers a load, every array of shape (n_motors,).

    Attributes:
        motors: Names.
        groups: Names of motors by group.
        stiffness: Real part of the impedance at `FREQUENCY` [N·m/rad].
        damping: Imaginary part over omega [N·m·s/rad].
        noise: Standard error of the stiffness [N·m/rad].
        torque: Load at which the motor gives way [N·m]; `MOST` efforts where it does not.
    """

    motors: tuple[str, ...]
    groups: Mapping[str, tuple[str, ...]]
    stiffness: np.ndarray
    damping: np.ndarray
    noise: np.ndarray
    torque: np.ndarray

    @property
    def impedance(self) -> np.ndarray:
        """Stiffness and damping as a complex number [N·m/rad]."""
        return self.stiffness + 2j * np.pi * FREQUENCY * self.damping

    def where(self, group: str) -> np.ndarray:
        """Return which motors a group has, shape (n_motors,)."""
        return np.isin(self.motors, self.groups[group])

    def document(self) -> dict[str, Any]:
        """Return it as a JSON document."""
        arrays = ("stiffness", "damping", "noise", "torque")
        groups = {name: list(members) for name, members in self.groups.items()}
        return {
            "motors": list(self.motors),
            "groups": groups,
            **{name: getattr(self, name).tolist() for name in arrays},
        }

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Compliance:
        """Return what a document holds; what was not finite is NaN."""
        arrays = {name: np.array(document[name], dtype=float) for name in ("stiffness", "damping", "noise", "torque")}
        motors = tuple(document["motors"])
        groups = {name: tuple(members) for name, members in document["groups"].items()}
        in_order = sorted(groups, key=lambda name: motors.index(groups[name][0]))  # a document's keys are by letter
        return cls(motors, {name: groups[name] for name in in_order}, **arrays)


def measure(world: Any, grounding: Grounding, seed: int) -> Compliance:
    """Measure the robot of a world with a grounding that is ready to act, without draws and noise if it can.

    One joint is loaded at a time: a grounding's models may answer a load on one joint at another. Where nothing joins
    the branches of a robot, since its base is held, one joint of each is loaded at once, which is three times as quick.

    Args:
        world: A robot in Bullet, with its effects.
        grounding: What stands between action and simulator.
        seed: Of all randomness.

    Raises:
        ConfigError: The world is no robot in Bullet.
    """
    if not isinstance(world, BulletWorld):
        raise ConfigError("world", "only a robot in Bullet can be loaded from outside")
    held = replace(world, floating=False, start_noise=0.0)
    plant = replace(noiseless(held.plant), pushes=())
    if isinstance(grounding, NoGrounding) and plant.hook is None:
        physics = held.step, held.iterations, held.period, held.settle, held.motors
        return _measure_once(_Alone(pickle.dumps((plant, physics)), held, plant))
    return _load_joints(held, plant, getattr(grounding, "deterministic", grounding), seed)


@dataclass(frozen=True)
class _Alone:
    """A robot without a grounding, which no seed changes: equal where plant and physics are, byte by byte."""

    key: bytes
    world: BulletWorld = field(compare=False)
    plant: Plant = field(compare=False)


@lru_cache(REMEMBERED)
def _measure_once(robot: _Alone) -> Compliance:
    return _load_joints(robot.world, robot.plant, NoGrounding(), 0)


def _load_joints(world: BulletWorld, plant: Plant, grounding: Grounding, seed: int) -> Compliance:
    robot, env = plant.robot, BulletEnv(world, plant=plant)
    effort = np.array([robot.joint(name).effort for name in robot.motors])
    quantities, apart = np.zeros((4, len(robot.motors))), isinstance(grounding, NoGrounding) and separate(plant)
    for number, loaded in enumerate(rounds(robot) if apart else np.eye(len(robot.motors), dtype=bool)):
        swing = Swing(AMPLITUDE * effort * loaded, world.step)
        hold(env, grounding, swing, swing.duration, derive_seed(seed, "swing", number))
        quantities[:3, loaded] = swing.answer()[:, loaded]
        far = YIELDED * robot.sizes
        rising = Ramp(RATE * effort * loaded * inwards(robot), DRAG * effort * loaded, quantities[0], far)
        hold(env, grounding, rising, MOST / RATE, derive_seed(seed, "yield", number))
        quantities[3, loaded] = np.where(rising.yielded, rising.torque, MOST * effort)[loaded]
    env.close()
    return Compliance(robot.motors, joint_groups(robot), *quantities)


class Swing:
    """A load that swings, and how the joints answer.

    Args:
        amplitude: On each motor [N·m], shape (n_motors,).
        step: Physics period [s].
    """

    def __init__(self, amplitude: np.ndarray, step: float) -> None:
        self._amplitude, self._step, self.drag = amplitude, step, np.zeros_like(amplitude)
        self._rows: list[np.ndarray] = []
        self._times: list[np.ndarray] = []
        self.done = False
        self.duration = (SETTLING + CYCLES) / FREQUENCY

    def act(self, times: np.ndarray) -> np.ndarray:
        """Return the load [N·m], (T,) -> (T, n_motors)."""
        return np.outer(np.where(times < 0.0, 0.0, np.sin(2.0 * np.pi * FREQUENCY * times)), self._amplitude)

    def note(self, times: np.ndarray, path: np.ndarray) -> None:
        """Take in the joints' motion, shape (T, 2, n_motors)."""
        if times[0] > BEFORE:
            self._times.append(times)
            self._rows.append(path[:, 0].copy())

    def answer(self) -> np.ndarray:
        """Return stiffness, damping and the stiffness' standard error, shape (3, n_motors); infinite if none acted."""
        if not self._times:
            return np.full((3, len(self._amplitude)), np.inf)
        times, rows = np.concatenate(self._times), np.concatenate(self._rows)
        load = np.outer(np.sin(2.0 * np.pi * FREQUENCY * times), self._amplitude)
        first = [SETTLING / FREQUENCY + k / FREQUENCY for k in range(CYCLES)]
        parts = [(times >= start - 0.5 * self._step) & (times < start + 1.0 / FREQUENCY) for start in first]
        every = np.any(parts, axis=0)
        whole = impedance(load[every], rows[every], times[every], FREQUENCY)
        cycles = [impedance(load[part], rows[part], times[part], FREQUENCY).real for part in parts]
        spread = np.std(cycles, axis=0, ddof=1) / math.sqrt(CYCLES)
        return np.array([whole.real, whole.imag / (2.0 * np.pi * FREQUENCY), spread])


class Ramp:
    """A load that rises until a joint gives way, where it is taken off.

    Args:
        rate: On each motor [N·m/s], 0 for those that are not loaded, shape (n_motors,).
        drag: Taken off the load per speed [N·m·s/rad], shape (n_motors,).
        stiffness: By which a joint yields before it gives way [N·m/rad], shape (n_motors,).
        far: Deflection beyond that at which it has given way [rad], shape (n_motors,).

    Attributes:
        yielded: Which motors have given way, shape (n_motors,).
        torque: At which load [N·m], shape (n_motors,).
    """

    def __init__(self, rate: np.ndarray, drag: np.ndarray, stiffness: np.ndarray, far: np.ndarray) -> None:
        self._rate, self._drag, self.drag, self._far = rate, drag, np.zeros_like(drag), far
        usable = np.isfinite(stiffness) & (stiffness > 0.0)
        self._softness = np.where(usable, 1.0 / np.where(usable, stiffness, 1.0), 0.0)
        self._still: np.ndarray | None = None
        self.yielded, self.torque = np.zeros(len(rate), dtype=bool), np.zeros(len(rate))

    def act(self, times: np.ndarray) -> np.ndarray:
        """Return the load without its drag [N·m], (T,) -> (T, n_motors)."""
        self.drag = np.where(self.yielded | (times[0] <= BEFORE), 0.0, self._drag)
        return np.outer(np.maximum(times, 0.0), np.where(self.yielded, 0.0, self._rate))

    def note(self, times: np.ndarray, path: np.ndarray) -> None:
        """Take in the joints' motion, shape (T, 2, n_motors), and what has given way."""
        if times[0] <= BEFORE:
            return
        if self._still is None:
            self._still = path[0, 0].copy()
        load = np.outer(times, self._rate) - self.drag * path[:, 1]
        beyond = np.sign(self._rate) * (path[:, 0] - self._still - self._softness * load) > self._far
        new, first = beyond.any(axis=0) & ~self.yielded, beyond.argmax(axis=0)
        self.torque[new] = np.abs(load[first, np.arange(len(first))])[new]
        self.yielded |= new

    @property
    def done(self) -> bool:
        """Whether all loaded motors have given way."""
        return bool((self.yielded | (self._rate == 0.0)).all())


def hold(env: BulletEnv, grounding: Grounding, load: Swing | Ramp, duration: float, seed: int) -> None:
    """Hold the stance for some time [s] or until the load is done."""
    run = grounding.start(env.layout, grounding_generator(seed))
    action = stance(env.world.plant.robot)
    observation, _ = env.reset(seed=seed, options={"posture": action, "load": load})
    for _ in range(math.ceil(duration / env.world.period)):
        observation, *_ = env.step(run.transform(observation, action))
        if load.done:
            break


def stance(robot: Robot) -> np.ndarray:
    """Return the robot's stance as an action [rad], shape (n_joints,)."""
    limits = [robot.joint(name) for name in robot.controlled]
    return np.array([min(max(robot.stance.get(joint.name, 0.0), joint.lower), joint.upper) for joint in limits])


def inwards(robot: Robot) -> np.ndarray:
    """Return the direction in which each motor has more room, 1 or -1, shape (n_motors,)."""
    joints, at = [robot.joint(name) for name in robot.motors], stance(robot)[robot.drive]
    middle = np.array([0.5 * (joint.lower + joint.upper) for joint in joints])
    return np.where(middle >= at, 1.0, -1.0)


def separate(plant: Plant) -> bool:
    """Whether a motor feels the others through its links alone: no common supply, no torque of a user's own."""
    return plant.hook is None and not plant.servo.supply_resistance.any()


def rounds(robot: Robot) -> list[np.ndarray]:
    """Return which motors are loaded at the same time, one of each branch, masks of shape (n_motors,)."""
    above = {joint.child: joint for joint in robot.joints}
    branches: dict[str, list[tuple[int, int]]] = {}
    for index, name in enumerate(robot.motors):
        root, depth = robot.joint(name), 0
        while root.parent in above:
            root, depth = above[root.parent], depth + 1
        branches.setdefault(root.name, []).append((depth, index))
    masks = np.zeros((max(map(len, branches.values())), len(robot.motors)), dtype=bool)
    for members in branches.values():
        for mask, (_, index) in zip(masks, sorted(members), strict=False):
            mask[index] = True
    return list(masks)


def joint_groups(robot: Robot) -> Mapping[str, tuple[str, ...]]:
    """Return the motors by group of the robot; what is in none is a group, all motors if there are no groups."""
    groups = {
        name: tuple(motor for motor in robot.motors if motor in members) for name, members in robot.groups.items()
    }
    inside = {motor for members in groups.values() for motor in members}
    rest = tuple(motor for motor in robot.motors if motor not in inside)
    every = {**groups, ("others" if groups else "all"): rest}
    return {name: members for name, members in every.items() if members}
