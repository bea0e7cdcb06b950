"""Bullet with our servos: loads a plant, steps it with torques, reads it; with camera.py all that imports pybullet."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from gsl.core.body import Robot, lump
from gsl.core.plant import Plant, hardness
from gsl.core.scratch import Scratch
from gsl.robots.urdf import principal_axes, urdf
from gsl.worlds.base_frame import GYRO, PLACE, TURN, VELOCITY, fill_base_motion
from gsl.worlds.bullet_c import NO_HANDLE, client_handle
from gsl.worlds.control_period import Drive, first_memory, in_c, in_python
from gsl.worlds.ground import PLANE, lay
from gsl.worlds.physics import Load, Physics, Reading
from gsl.worlds.pushes import aim, apply_push, overlap
from gsl.worlds.rotor import carry_inertia, rotors
from gsl.worlds.servo import encoder_motion
from gsl.worlds.servo_state import ROTOR, first_state, pack, senses_apart
from gsl.worlds.velocity_motors import VelocityMotors

NOTHING = -1  # Bullet's number of a robot that is not loaded yet


class Engine:
    """One client of Bullet in DIRECT mode that holds one robot; `load` removes it and loads it anew every time.

    With the robot go its contacts, motors and friction, and the ground has no state: a rollout has the same bits as in
    a client that was reset, which would take more time than the loading itself (tests/worlds/test_bullet.py). An uneven
    ground is another one every time, and everything is loaded anew.

    Args:
        plant: What to simulate.
        physics: How.
        host: Another engine, whose client this one uses in turn with it; see `leave`.

    Attributes:
        bullet, client: The pybullet module and our client in it.
        handle: The client in Bullet's C interface, or NO_HANDLE, which makes `run` step through pybullet.
        body: Bullet's number of the robot, once loaded.
        links: Bullet's number of each link, once loaded.
        joints: Bullet's numbers of the motors, once loaded.
    """

    body: int
    links: Mapping[str, int]
    joints: Sequence[int]

    def __init__(self, plant: Plant, physics: Physics, host: Engine | None = None) -> None:
        with quiet():
            import pybullet

            self.bullet, self.hosted = pybullet, host is not None
            self.client: int = pybullet.connect(pybullet.DIRECT) if host is None else host.client
        self.body = NOTHING
        self.plant, self.physics, self.robot = plant, physics, lump(plant.robot)
        self.handle = client_handle(pybullet.__file__, self.client)
        servo = pack(plant.servo, plant.robot.supply_voltage, plant.law, hardness(plant.robot), plant.robot.sizes)
        apart, moved = servo.rows[ROTOR], physics.motors == "servo"
        armature = plant.servo.armature - apart if moved else np.zeros(len(apart))
        self._motors = None if moved else VelocityMotors.of(plant, servo.rows)
        self._compiled = moved and not (plant.pushes or plant.hook)
        rotor = rotors(self.robot, armature, floating=physics.floating, apart=apart)
        self._loaded = _heavier(self.robot, carry_inertia(self.robot, rotor.carried))
        self._inertia = {name: principal_axes(link.inertia)[0].tolist() for name, link in self._loaded.links.items()}
        base = self._loaded.links[self.robot.base]
        axes = np.ascontiguousarray(principal_axes(base.inertia)[1])
        self._drive = Drive.of(servo, rotor, axes, base.com)
        self._senses_apart = senses_apart(servo)
        self._pushes = aim(plant, self._loaded)
        self._link_from_inertial = Rotation.from_matrix(axes.T).as_quat().tolist()
        self._folder = Scratch()
        model = urdf(self._loaded, visuals=False, meshes=Path(self._folder.name))
        for name, text in (("robot", model), ("ground", PLANE)):
            Path(self._folder.name, f"{name}.urdf").write_text(text)

    def close(self) -> None:
        """Free the client, if it is its own, and the files."""
        if not self.hosted:
            self.bullet.disconnect(self.client)
        self._folder.cleanup()

    def leave(self) -> None:
        """Leave the client to another engine; the next `load` resets it."""
        self.body = NOTHING

    def load(
        self, reading: Reading, commands: np.ndarray, clock: float = 0.0, heights: np.ndarray | None = None,
        outside: Load | None = None,
    ) -> None:  # fmt: skip
        """Start from nothing in a measured state.

        Args:
            reading: Where the robot is and how it moves; forces are what follows, not what is set.
            commands: Commands so far, newest first, see `ServoState`: targets [rad], shape (k, n_motors), or others
                beside them as well, shape (k, 3 or 5 n_motors); the oldest one stands for all before.
            clock: Time since the episode began [s], negative before it.
            heights: Of an uneven ground, its middle where the robot is, see `ground.random_heights`.
            outside: Torques on the motors, in place of those that `run` is given.
        """
        self._load = outside
        b, client, physics = self.bullet, self.client, self.physics
        if self.body == NOTHING or heights is not None:
            self._begin(heights, *reading.place[:2].tolist())
        else:
            b.removeBody(self.body, client)
        self.body = b.loadURDF(
            f"{self._folder.name}/robot.urdf",
            basePosition=reading.place.tolist(),
            baseOrientation=reading.quaternion,
            useFixedBase=not physics.floating,
            flags=b.URDF_USE_INERTIA_FROM_FILE,
            physicsClientId=client,
        )
        self._set_dynamics()
        for joint, position, velocity in zip(self.joints, *reading.motion.tolist(), strict=True):
            b.resetJointState(self.body, joint, position, velocity, physicsClientId=client)
        turn = np.array(b.getMatrixFromQuaternion(reading.quaternion)).reshape(3, 3)
        spin = turn @ reading.gyro
        centre = reading.velocity + np.cross(spin, turn @ self._drive.base_com)
        if physics.floating and (spin.any() or centre.any()):
            b.resetBaseVelocity(self.body, centre.tolist(), spin.tolist(), client)
        self._start(reading.motion, commands, clock)

    def _begin(self, heights: np.ndarray | None, x: float, y: float) -> None:
        """Set up an empty world with its ground."""
        b, client, physics = self.bullet, self.client, self.physics
        b.resetSimulation(physicsClientId=client)
        b.setPhysicsEngineParameter(
            fixedTimeStep=physics.step,
            numSolverIterations=physics.iterations,
            deterministicOverlappingPairs=1,
            enableFileCaching=0,
            physicsClientId=client,
        )
        b.setGravity(*self.plant.gravity.tolist(), physicsClientId=client)
        plane = f"{self._folder.name}/ground.urdf"
        grounds = lay(b, client, plane, self.plant.contact, heights, x, y) if physics.floating else ()
        self._grounds = np.array(grounds, dtype=np.int32)

    def run(self, targets: np.ndarray, load: np.ndarray | None = None) -> None:
        """Hold commands for one control period.

        Args:
            targets: Of the motors [rad], shape (n_motors,), or as wide as the commands that `load` was given.
            load: What they bear besides their servos [N·m], shape (substeps, n_motors), where the plant's torques are
                noisy.
        """
        physics, memory = self.physics, self._memory
        memory.servo.commands[1:] = memory.servo.commands[:-1]
        memory.servo.commands[0] = targets
        if load is not None:
            memory.load[:] = load
        if self._load is not None:
            times = memory.servo.clock[0] + np.arange(physics.substeps) * physics.step
            memory.load[:], memory.drag[:] = self._load.act(times), self._load.drag
        rest = physics.floating, physics.substeps, physics.step, physics.period, self._drive, memory
        if self._compiled and self.handle != NO_HANDLE:
            in_c(self.handle, self.body, self._places, *rest, self._feet, self._grounds)
        else:
            outside = self._outside if self.plant.pushes or self.plant.hook else None
            if self._motors is None:
                in_python(self.bullet, self.client, self.body, self.joints, *rest, outside)
            else:
                steps = physics.substeps, physics.step
                self._motors.run(self.bullet, self.client, self.body, self.joints, *steps, memory.servo, outside)
            self._measure()
        if self._load is not None and self._motors is None:
            self._load.note(times, memory.path)
        memory.servo.clock[0] += physics.period

    def read(self) -> Reading:
        """Return what was measured of the robot at the end of the control period."""
        memory, still = self._memory, (0, 0, 0)
        frame, turned = memory.frame.copy(), memory.base[3:7].tolist()
        quaternion = self.bullet.multiplyTransforms(still, turned, still, self._link_from_inertial)[1]
        rest = frame[VELOCITY], frame[GYRO], float(frame[TURN][2, 2]), memory.feet.copy()
        return Reading(memory.motion.copy(), frame[PLACE], quaternion, *rest)

    def encoders(self, reading: Reading) -> np.ndarray:
        """Return what the encoders tell of the motors' positions [rad] and velocities [rad/s], shape (2, n_motors)."""
        if not self._senses_apart:
            return reading.motion
        readings = np.empty_like(reading.motion)
        encoder_motion(self._drive.servo, self._memory.servo, reading.motion, self.physics.step, readings)
        return readings

    def _outside(self, motion: np.ndarray, time: float) -> np.ndarray:
        """Push the robot's links and return the joint torques of a user's own effect [N·m], shape (n_motors,)."""
        for push in self._pushes:
            if share := overlap(push.push, time, self.physics.step):
                apply_push(self.bullet, self.client, self.body, self.links, push, share)
        return np.zeros(len(self.joints)) if self.plant.hook is None else self.plant.hook(motion, time)

    def _measure(self) -> None:
        """Fill in how the robot moves and what its feet bear, by pybullet."""
        b, body, client, memory = self.bullet, self.body, self.client, self._memory
        memory.motion[0], memory.motion[1], _, _ = zip(*b.getJointStates(body, self.joints, client), strict=True)
        memory.base[:3], memory.base[3:7] = b.getBasePositionAndOrientation(body, client)
        memory.base[7:10], memory.base[10:] = b.getBaseVelocity(body, client)
        fill_base_motion(self._drive.base_axes, self._drive.base_com, memory.base, memory.frame)
        memory.feet[:] = 0.0
        for ground in self._grounds:
            for contact in b.getContactPoints(body, int(ground), physicsClientId=client):
                memory.feet[self._feet == contact[3]] += contact[9]

    def _set_dynamics(self) -> None:
        """Find the links by name; set true inertia, sole friction, and no damping that nobody asked for."""
        b, client = self.bullet, self.client
        info = [b.getJointInfo(self.body, i, client) for i in range(b.getNumJoints(self.body, client))]
        joints = {row[1].decode(): row[0] for row in info}
        self._places = np.array([info[joints[name]][3:5] for name in self.robot.motors], dtype=np.int32).T.copy()
        self.links = {row[12].decode(): row[0] for row in info} | {self.robot.base: -1}
        self.joints = [joints[name] for name in self.robot.motors]
        self._feet = np.array([self.links[name] for name in self.robot.feet.values()], dtype=np.int32)
        for name, inertia in self._inertia.items():
            b.changeDynamics(
                self.body,
                self.links[name],
                localInertiaDiagonal=inertia,
                lateralFriction=self.plant.contact.foot_friction,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                physicsClientId=client,
            )

    def _start(self, motion: np.ndarray, commands: np.ndarray, clock: float) -> None:
        """Release the default velocity motors and clear what the servos remember."""
        n = len(self.joints)
        self.bullet.setJointMotorControlArray(
            self.body, self.joints, self.bullet.VELOCITY_CONTROL, forces=[0.0] * n, physicsClientId=self.client
        )
        loads = self.physics.substeps if self.plant.torque_noise.any() or self._load is not None else 0
        self._memory = first_memory(first_state(commands, motion, self.physics.step, clock), len(self._feet), loads)
        self._measure()


def _heavier(robot: Robot, extra: Mapping[str, np.ndarray]) -> Robot:
    links = {name: replace(link, inertia=link.inertia + extra.get(name, 0.0)) for name, link in robot.links.items()}
    return replace(robot, links=links)


@contextmanager
def quiet() -> Iterator[None]:
    """Keep to itself what Bullet prints when it is imported and connected, on both of C's output streams."""
    kept = [(stream, os.dup(stream)) for stream in (1, 2)]
    with open(os.devnull, "w") as nowhere:
        for stream, _ in kept:
            os.dup2(nowhere.fileno(), stream)
    try:
        yield
    finally:
        for stream, copy in kept:
            os.dup2(copy, stream)
            os.close(copy)
