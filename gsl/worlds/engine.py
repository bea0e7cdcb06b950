"""Bullet with our servos: loads a plant, steps it with torques, reads it; with camera.py all that imports pybullet."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gsl.core.body import Robot, lumped
from gsl.core.plant import Plant
from gsl.robots.urdf import principal_axes, urdf
from gsl.worlds.rotor import carried_inertia, compensation, rotors
from gsl.worlds.servo import first_state, packed, servo_torque

GRAVITY = 9.81  # [m/s²]
_GROUND = """<robot name="ground"><link name="ground"><inertial><mass value="0"/>
<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>
<collision><geometry><plane normal="0 0 1"/></geometry></collision></link></robot>"""


@dataclass(frozen=True)
class Physics:
    """How the engine computes.

    Attributes:
        step: Physics period [s].
        iterations: Of the constraint solver.
        period: Control period [s], a multiple of `step`.
        floating: Whether the base moves freely above a plane; else it is held in the air.
    """

    step: float
    iterations: int
    period: float
    floating: bool

    @property
    def substeps(self) -> int:
        """Physics steps in a control period."""
        return round(self.period / self.step)


class Reading(NamedTuple):
    """What can be measured of the robot at one moment; base quantities are of the base's link frame.

    Attributes:
        motion: Motor positions [rad] and velocities [rad/s], shape (2, n_motors).
        place: Base position in world axes [m], shape (3,).
        quaternion: Base orientation, x y z w.
        velocity: Of the base in world axes [m/s], shape (3,).
        gyro: Angular velocity in base axes [rad/s], shape (3,).
        up: Cosine of the base's tilt.
        foot_force: Normal force on each foot [N], shape (n_feet,).
    """

    motion: np.ndarray
    place: np.ndarray
    quaternion: tuple[float, ...]
    velocity: np.ndarray
    gyro: np.ndarray
    up: float
    foot_force: tuple[float, ...]


class Engine:
    """One client of Bullet in DIRECT mode that holds one robot; `load` starts from nothing every time.

    Args:
        plant: What to simulate.
        physics: How.

    Attributes:
        bullet, client: The pybullet module and our client in it.
        body: Bullet's number of the robot, once loaded.
        links: Bullet's number of each link, once loaded.
        joints: Bullet's numbers of the motors, once loaded.
    """

    body: int
    links: Mapping[str, int]
    joints: Sequence[int]

    def __init__(self, plant: Plant, physics: Physics) -> None:
        with quiet():
            import pybullet

            self.bullet, self.client = pybullet, pybullet.connect(pybullet.DIRECT)
        self.plant, self.physics, self.robot = plant, physics, lumped(plant.robot)
        self._servo = packed(plant.servo)
        armature = plant.servo.armature - self._servo[-1]  # what is beyond the play turns on its own
        self._rotors = rotors(self.robot, armature, floating=physics.floating)
        self._loaded = _heavier(self.robot, carried_inertia(self.robot, self._rotors.carried))
        base = self._loaded.links[self.robot.base]
        self._base_com, self._base_axes = base.com, principal_axes(base.inertia)[1]
        self._link_from_inertial = Rotation.from_matrix(self._base_axes.T).as_quat().tolist()
        self._folder = tempfile.TemporaryDirectory(prefix="gsl-")
        for name, text in (("robot", urdf(self._loaded, visuals=False)), ("ground", _GROUND)):
            Path(self._folder.name, f"{name}.urdf").write_text(text)

    def close(self) -> None:
        """Free the client and its files."""
        self.bullet.disconnect(self.client)
        self._folder.cleanup()

    def load(self, reading: Reading, commands: np.ndarray) -> None:
        """Start from nothing in a measured state.

        Args:
            reading: Where the robot is and how it moves; forces are what follows, not what is set.
            commands: Targets so far, newest first [rad], shape (k, n_motors); the oldest one stands for all before.
        """
        b, client, physics = self.bullet, self.client, self.physics
        b.resetSimulation(physicsClientId=client)
        b.setPhysicsEngineParameter(
            fixedTimeStep=physics.step,
            numSolverIterations=physics.iterations,
            deterministicOverlappingPairs=1,
            enableFileCaching=0,
            physicsClientId=client,
        )
        b.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=client)
        if physics.floating:
            ground = b.loadURDF(f"{self._folder.name}/ground.urdf", physicsClientId=client)
            b.changeDynamics(ground, -1, lateralFriction=self.plant.contact.ground_friction, physicsClientId=client)
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
        centre = reading.velocity + np.cross(spin, turn @ self._base_com)
        if physics.floating and (spin.any() or centre.any()):
            b.resetBaseVelocity(self.body, centre.tolist(), spin.tolist(), client)
        self._start(commands)

    def run(self, targets: np.ndarray) -> None:
        """Hold motor `targets` [rad], shape (n_motors,), for one control period."""
        commands, rotor, physics = self._state.commands, self._rotors, self.physics
        commands[1:] = commands[:-1].copy()
        commands[0] = targets
        b, body, client, joints = self.bullet, self.body, self.client, self.joints
        motion, torque, spin, memory = self._motion, self._torque, self._spin, self._rotor_memory
        states, act, mode = b.getJointStates, b.setJointMotorControlArray, b.TORQUE_CONTROL
        turn, axes = self._base_turn, self._base_axes
        for k in range(physics.substeps):
            motion[0], motion[1], _, _ = zip(*states(body, joints, client), strict=True)
            servo_torque(
                self._servo,
                commands,
                self._state.memory,
                motion,
                k * physics.step,
                physics.step,
                physics.period,
                torque,
            )
            if physics.floating:
                spin[:] = b.getBaseVelocity(body, client)[1]
                spin[:] = spin @ turn  # within a control period the base hardly turns
            compensation(
                rotor.parent, rotor.order, rotor.axis, rotor.carried, rotor.armature, rotor.gain,
                motion, spin, physics.step, memory, self._work, torque,
            )  # fmt: skip
            act(body, joints, mode, forces=torque.tolist(), physicsClientId=client)
            if physics.floating:
                b.applyExternalTorque(body, -1, (memory[0, :3] @ axes).tolist(), b.LINK_FRAME, client)
            b.stepSimulation(client)

    def read(self) -> Reading:
        """Measure the robot now, and remember its orientation for the next control period."""
        b, body, client = self.bullet, self.body, self.client
        centre, quaternion = b.getBasePositionAndOrientation(body, client)
        linear, angular = b.getBaseVelocity(body, client)
        turn = np.array(b.getMatrixFromQuaternion(quaternion)).reshape(3, 3) @ self._base_axes.T
        self._base_turn, lever = turn, turn @ self._base_com
        positions, velocities, _, _ = zip(*b.getJointStates(body, self.joints, client), strict=True)
        return Reading(
            np.array((positions, velocities)),
            np.array(centre) - lever,
            b.multiplyTransforms((0, 0, 0), quaternion, (0, 0, 0), self._link_from_inertial)[1],
            np.array(linear) - np.cross(angular, lever),
            np.array(angular) @ turn,
            turn[2, 2],
            tuple(self._force(foot) for foot in self._feet),
        )

    def _force(self, foot: int) -> float:
        if not self.physics.floating:
            return 0.0
        points = self.bullet.getContactPoints(self.body, 0, foot, physicsClientId=self.client)
        return float(sum(point[9] for point in points))

    def _set_dynamics(self) -> None:
        """Find the links by name; set true inertia, sole friction, and no damping that nobody asked for."""
        b, client = self.bullet, self.client
        info = [b.getJointInfo(self.body, i, client) for i in range(b.getNumJoints(self.body, client))]
        joints = {row[1].decode(): row[0] for row in info}
        self.links = {row[12].decode(): row[0] for row in info} | {self.robot.base: -1}
        self.joints = [joints[name] for name in self.robot.motors]
        self._feet = [self.links[name] for name in self.robot.feet.values()]
        for name, link in self._loaded.links.items():
            b.changeDynamics(
                self.body,
                self.links[name],
                localInertiaDiagonal=principal_axes(link.inertia)[0].tolist(),
                lateralFriction=self.plant.contact.foot_friction,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                physicsClientId=client,
            )

    def _start(self, commands: np.ndarray) -> None:
        """Release the default velocity motors and clear what the servos remember."""
        n = len(self.joints)
        self.bullet.setJointMotorControlArray(
            self.body, self.joints, self.bullet.VELOCITY_CONTROL, forces=[0.0] * n, physicsClientId=self.client
        )
        self._motion, self._torque, self._spin = np.zeros((2, n)), np.zeros(n), np.zeros(3)
        self._rotor_memory, self._work = np.zeros((6, 3 + n)), np.zeros((n, 18))
        self._state = first_state(commands, self.read().motion)


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
