"""A robot in Bullet as a gymnasium environment: actions are desired joint positions, observations what sensors tell.

A world is the body: it gives no reward (always 0.0) and ends an episode only when the robot falls. A rollout is a
function of the world's configuration, the actions and the seed of `reset`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import gymnasium
import numpy as np

from gsl.core.body import lump
from gsl.core.layout import Layout
from gsl.core.plant import Plant, nominal
from gsl.core.setting import component, setting
from gsl.effects.effect import add_own, apply_all, build, own, own_of
from gsl.errors import ConfigError, GslError
from gsl.models.servo import having_servo
from gsl.models.servo_file import read_servo, servo_file
from gsl.robots.catalogue import read_files, robot
from gsl.worlds.engine import Engine
from gsl.worlds.fits import check_base, check_periods, check_plant
from gsl.worlds.ground import REACH, random_heights
from gsl.worlds.physics import Physics, Reading
from gsl.worlds.start import Start, resting
from gsl.worlds.torque_noise import TorqueNoise
from gsl.worlds.velocity_motors import Motors, check_motors

OWN = "effects of a user's own"  # among what is pickled
FINEST = 1e-5  # physics period [s]: finer ones change nothing but the time that a walk takes, without end
FALLEN_TILT = 0.5  # cosine of the tilt beyond which the robot has fallen


@component
class BulletWorld:
    """A world's configuration; `make` builds the environment."""

    robot: Annotated[
        str,
        setting("its name, a URDF or yaml file, robot_descriptions:NAME, or package.module.function"),
    ]
    effects: Annotated[Mapping[str, Any], setting("what this world adds to the nominal robot, by name")]
    floating: Annotated[bool, setting("base on the ground (true) or held in the air (false)")] = True
    step: Annotated[float, setting("physics period", unit="s", ge=FINEST, le=0.02)] = 0.002
    iterations: Annotated[int, setting("iterations of the constraint solver", ge=1, le=10_000)] = 50
    period: Annotated[float, setting("control period", unit="s", gt=0, le=0.1)] = 0.02
    start_noise: Annotated[float, setting("standard deviation of the joints at the start", unit="rad", ge=0)] = 0.03
    settle: Annotated[float, setting("time the start posture is held before the episode", unit="s", ge=0, le=600)] = 0.5
    servo: Annotated[str | None, setting("learned servo that acts on top: a path or run of train-servo")] = None
    servo_member: Annotated[int, setting("which member of the learned servo, the first is 0", ge=0)] = 0
    motors: Annotated[
        Motors, setting("what turns the joints: our servo by torque, or the engine's velocity motors")
    ] = "servo"

    def __post_init__(self) -> None:
        """Refuse periods that do not fit, and effects that do not exist or do not fit them."""
        check_periods(self.step, self.period)
        _ = self.own_effects  # as they are now
        check_plant(self.plant, self.step, self.period)
        check_base(self.plant.robot, floating=self.floating)
        if self.servo_member and self.servo is None:
            raise ConfigError("servo_member", "is of a learned servo; name one by servo", given=str(self.servo_member))
        if self.motors != "servo":
            check_motors(nominal(robot(self.robot)), build(self.effects))
            if self.servo is not None:
                raise ConfigError("servo", "acts on torques; velocity motors have none", given=self.servo)

    @cached_property
    def own_effects(self) -> Mapping[str, type]:
        """Classes of its effects that are a user's own, by name, as they were when the world was made."""
        return own_of(self.effects)

    @property
    def read_files(self) -> Mapping[str, Path]:
        """What it is read from, by the setting that names it."""
        return read_files(self.robot) | ({} if self.servo is None else {"servo": servo_file(self.servo)})

    @cached_property
    def plant(self) -> Plant:
        """The robot with its effects and its learned servo."""
        plant = apply_all(nominal(robot(self.robot)), build(self.effects))
        if self.servo is None:
            return plant
        return having_servo(plant, read_servo(self.servo, self.servo_member), self.servo)

    def __getstate__(self) -> dict[str, Any]:
        """Leave a plant with a torque hook out: a worker builds its own, as a hook need not be a module's function."""
        hooked = self.plant.hook is not None
        state = {name: value for name, value in vars(self).items() if not (hooked and name == "plant")}
        return {**state, OWN: own()} if own() else state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Have effects of a user's own in a worker process too."""
        add_own({**state.pop(OWN, {}), **state.get("own_effects", {})})
        vars(self).update(state)

    @property
    def layout(self) -> Layout:
        """What an observation holds."""
        joints, feet = self.plant.robot.controlled, len(self.plant.robot.feet)
        base = {"base.position": 3, "base.orientation": 4, "base.velocity": 3}
        body = {"gyro": 3, **({"foot_force": feet} if feet else {}), **base}
        return Layout(joints, {"position": len(joints), "velocity": len(joints), **body}, self.period)

    def make(self) -> BulletEnv:
        """Build the environment."""
        return BulletEnv(self)


class BulletEnv(gymnasium.Env):
    """One robot in one Bullet client.

    Args:
        world: Its configuration.
        plant: Another one of the same robot, such as a calibrated one; by default the world's.
        host: An environment that was reset, whose Bullet client this one uses in turn with it; see `leave`.

    Attributes:
        engine: The robot in Bullet, None before the first reset.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  gymnasium's own name and type

    def __init__(self, world: BulletWorld, plant: Plant | None = None, host: BulletEnv | None = None) -> None:
        self.world, self.layout, self._host = world, world.layout, host
        self._plant = plant or world.plant
        self._robot = lump(self._plant.robot)
        self._drive, self._n = self._robot.drive, len(self._robot.controlled)
        low, high = np.array([self._robot.bound_commands(name) for name in self._robot.controlled]).T
        self.action_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (self.layout.size,), dtype=np.float64)
        self._action_noise = _or_none(self._plant.action_noise)
        self._encoder_noise = _or_none(self._plant.sensors.encoder_noise[: self._n])
        self._neutral = np.clip(np.zeros(self._n), low, high)
        self.engine: Engine | None = None
        self._middle: np.ndarray | None = None  # of an uneven ground [m], shape (2,)
        self._noise: TorqueNoise | None = None  # of this episode's torques

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, bool]]:
        """Start anew: at rest in a posture, or in a measured state.

        Args:
            seed: Of the start noise, of an uneven ground and of every noise.
            options: `posture`, desired joint positions at the start [rad], shape (n_joints,), by default all zero;
                or `start`, a `Start` to take up as it is, without noise or settling; `load`, a `Load` from outside in
                place of torque noise.
        """
        super().reset(seed=seed)
        options = options or {}
        start = options.get("start") or self._at_rest(np.asarray(options.get("posture", self._neutral), dtype=float))
        if self.engine is None:
            physics = Physics(
                self.world.step, self.world.iterations, self.world.period, self.world.floating, self.world.motors
            )
            self.engine = Engine(self._plant, physics, None if self._host is None else self._host.engine)
        before = 0 if options.get("start") else round(self.world.settle / self.world.period)
        surface = self._surface()
        self._middle = None if surface is None else start.reading.place[:2]
        self.engine.load(start.reading, start.commands, -before * self.world.period, surface, options.get("load"))
        reading = self.engine.read()
        self._noise = self._torque_noise()
        for _ in range(before):
            self._run(start.commands[0])
            reading = self.engine.read()
        return self._observe(reading), {"fell": False}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, bool]]:
        """Hold desired joint positions [rad], shape (n_joints,), for one control period.

        Raises:
            GslError: if the action has another size or holds what is not a finite number, or the robot has come to the
                edge of an uneven ground.
        """
        assert self.engine is not None, "reset comes first"
        targets, noise = self._check(action)[self._drive], self._action_noise
        if noise is not None:
            targets = targets + noise * self.np_random.standard_normal(len(noise))
        self._run(targets)
        reading = self.engine.read()
        if self._middle is not None and np.abs(reading.place[:2] - self._middle).max() > REACH:
            raise GslError(f"the robot has come to the edge of the uneven ground ({REACH} m): shorten task.duration")
        fell = self.world.floating and (reading.up < FALLEN_TILT or reading.place[2] < self._robot.upright_height)
        return self._observe(reading), 0.0, bool(fell), False, {"fell": bool(fell)}

    def leave(self) -> None:
        """Leave the client to another environment that uses it, until the next reset."""
        if self.engine is not None:
            self.engine.leave()

    def close(self) -> None:
        """Free Bullet's client."""
        if self.engine is not None:
            self.engine.close()
            self.engine = None

    def _check(self, action: np.ndarray) -> np.ndarray:
        values = np.asarray(action, dtype=float)
        if values.shape != (self._n,):
            raise GslError(f"an action has {self._n} desired positions, one a joint; given: shape {values.shape}")
        if not np.isfinite(values).all():
            joint = self._robot.controlled[int(np.argmin(np.isfinite(values)))]
            raise GslError(
                f"the action for {joint} is {values[~np.isfinite(values)][0]}: a policy must give finite angles"
            )
        return values

    def _observe(self, reading: Reading) -> np.ndarray:
        assert self.engine is not None
        n, encoders = self._n, self.engine.encoders(reading)
        position = encoders[0, :n] + self._plant.sensors.bias[:n]
        if self._encoder_noise is not None:
            position += self._encoder_noise * self.np_random.standard_normal(n)
        body = reading.gyro, reading.foot_force, reading.place, reading.quaternion, reading.velocity
        return np.concatenate([position, encoders[1, :n], *body])

    def _surface(self) -> np.ndarray | None:
        """Draw the heights of an uneven ground; it has randomness of its own, so that no other noise changes."""
        if not self.world.floating or self._plant.contact.roughness == 0.0:
            return None
        return random_heights(self._plant.contact, self.np_random.spawn(1)[0])

    def _torque_noise(self) -> TorqueNoise | None:
        """Draw an episode's torque noise; it has randomness of its own, as an uneven ground has."""
        sd = self._plant.torque_noise
        if not sd.any():
            return None
        return TorqueNoise(sd, round(self.world.period / self.world.step), self.np_random.spawn(1)[0])

    def _run(self, targets: np.ndarray) -> None:
        assert self.engine is not None
        self.engine.run(targets, None if self._noise is None else self._noise.draw())

    def _at_rest(self, posture: np.ndarray) -> Start:
        targets = posture[self._drive]
        noise = self.world.start_noise * self.np_random.standard_normal(self._n)[self._drive]
        positions = targets + noise * self._robot.sizes
        positions = np.clip(positions, self._plant.servo.lower_stop, self._plant.servo.upper_stop)
        return resting(self._robot, positions, targets, floating=self.world.floating)


def _or_none(noise: np.ndarray) -> np.ndarray | None:
    """Return standard deviations, None where all are zero: asking an array takes longer than a joint's control."""
    return noise if noise.any() else None
