"""A control period: read the joints, ask the servos and the rotors for torques, step the physics, again and again.

Written twice: compiled, calling Bullet's C interface, which makes a rollout a quarter shorter, and in Python, calling
pybullet, for where there is no handle. Both do the same to the bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from gsl.core.compiled import compile_inner, compile_kernel
from gsl.worlds import bullet_c as c
from gsl.worlds.rotor import Rotors, compensation
from gsl.worlds.servo import servo_torque
from gsl.worlds.servo_state import ServoParameters, ServoState


class Drive(NamedTuple):
    """What never changes.

    Attributes:
        servo: Parameters of the servos, from `servo.packed`.
        base_axes: Of the base's inertial frame in its link axes, columns, shape (3, 3).
        parent, order, axis, turns, carried, armature, gain: See `rotor.Rotors`.
    """

    servo: ServoParameters
    base_axes: np.ndarray
    parent: np.ndarray
    order: np.ndarray
    axis: np.ndarray
    turns: np.ndarray
    carried: np.ndarray
    armature: np.ndarray
    gain: np.ndarray

    @classmethod
    def of(cls, servo: ServoParameters, rotor: Rotors, base_axes: np.ndarray) -> Drive:
        """Put together what `torques` needs."""
        constants = (rotor.parent, rotor.order, rotor.axis, rotor.turns, rotor.carried, rotor.armature, rotor.gain)
        return cls(servo, base_axes, *constants)


class Memory(NamedTuple):
    """What changes in time, all of it in place, with n motors.

    Attributes:
        servo: State of the servos.
        rotor: Memory of the compensation, shape (7, 3 + n).
        motion: Joint positions [rad] and velocities [rad/s] at this physics step, shape (2, n).
        spin: Angular velocity of the base in world axes, then in base axes [rad/s], shape (2, 3).
        load: What the motors bear besides their servos at each physics step of the control period [N·m], shape
            (substeps, n), or (0, n) if they never do.
        drag: Taken off that load per speed [N·m·s/rad], shape (n,).
        path: Motion at each physics step where there are loads, shape (substeps, 2, n), or (0, 2, n).
        torque: Of the motors [N·m], shape (n,).
        push: Torque on the base in its inertial axes [N·m], shape (3,).
        work: Scratch, shape (n, 18).
    """

    servo: ServoState
    rotor: np.ndarray
    motion: np.ndarray
    spin: np.ndarray
    load: np.ndarray
    drag: np.ndarray
    path: np.ndarray
    torque: np.ndarray
    push: np.ndarray
    work: np.ndarray


def first_memory(servo: ServoState, loads: int = 0) -> Memory:
    """Return the memory at the start, given that of the servos and how many physics steps have loads of their own."""
    n = servo.memory.shape[1]
    return Memory(
        servo,
        rotor=np.zeros((7, 3 + n)),
        motion=np.zeros((2, n)),
        spin=np.zeros((2, 3)),
        load=np.zeros((loads, n)),
        drag=np.zeros(n),
        path=np.zeros((loads, 2, n)),
        torque=np.zeros(n),
        push=np.zeros(3),
        work=np.zeros((n, 18)),
    )


@compile_inner
def torques(drive: Drive, memory: Memory, turn: np.ndarray, k: int, step: float, period: float) -> None:
    """Fill in the torques of one physics step, given motion and spin (world axes).

    Args:
        drive: Parameters.
        memory: Moved on by one step.
        turn: From base to world axes, shape (3, 3); within a control period the base hardly turns.
        k: Number of physics steps since the newest command was issued.
        step: Physics period [s].
        period: Control period [s].
    """
    servo_torque(drive.servo, memory.servo, memory.motion, k * step, step, period, memory.torque)
    if len(memory.load) > 0:
        for i in range(len(memory.torque)):
            memory.torque[i] += memory.load[k, i] - memory.drag[i] * memory.motion[1, i]
            memory.path[k, 0, i], memory.path[k, 1, i] = memory.motion[0, i], memory.motion[1, i]
    world, base = memory.spin[0], memory.spin[1]
    for k in range(3):
        base[k] = world[0] * turn[0, k] + world[1] * turn[1, k] + world[2] * turn[2, k]
    compensation(
        drive.parent, drive.order, drive.axis, drive.turns, drive.carried, drive.armature, drive.gain,
        memory.motion, base, step, memory.rotor, memory.work, memory.torque,
    )  # fmt: skip
    wanted, axes = memory.rotor[0], drive.base_axes
    for k in range(3):
        memory.push[k] = wanted[0] * axes[0, k] + wanted[1] * axes[1, k] + wanted[2] * axes[2, k]


@compile_kernel
def in_c(
    handle: int, body: int, places: np.ndarray, floating: bool, substeps: int, step: float, period: float,
    drive: Drive, memory: Memory, turn: np.ndarray,
) -> None:  # fmt: skip
    """Step Bullet through a control period by its C interface.

    Args:
        handle: From `bullet_c.client_handle`.
        body: Bullet's number of the robot.
        places: Of each motor in Bullet's state and velocity vectors, shape (2, n_motors).
        floating: Whether the base moves.
        substeps: Physics steps.
        step: Physics period [s].
        period: Control period [s].
        drive: Parameters.
        memory: Moved on.
        turn: From base to world axes, shape (3, 3).
    """
    pose, speed = np.empty(7), np.empty(6)
    for k in range(substeps):
        read_state(handle, body, places, memory.motion, pose, speed)
        memory.spin[0] = speed[3:]
        torques(drive, memory, turn, k, step, period)
        command = c.joint_control(handle, body, c.TORQUE_CONTROL)
        for i in range(places.shape[1]):
            c.set_torque(command, places[1, i], memory.torque[i])
        c.submit(handle, command)
        if floating:
            command = c.external_force(handle)
            c.set_external_torque(command, body, c.BASE, memory.push.ctypes.data, c.LINK_FRAME)
            c.submit(handle, command)
        c.submit(handle, c.step_simulation(handle))


@compile_kernel
def read_state(
    handle: int, body: int, places: np.ndarray, motion: np.ndarray, pose: np.ndarray, speed: np.ndarray
) -> None:
    """Read the state by Bullet's C interface.

    Args:
        handle: From `bullet_c.client_handle`.
        body: Bullet's number of the robot.
        places: Of each motor in Bullet's state and velocity vectors, shape (2, n_motors).
        motion: Result, joint positions [rad] and velocities [rad/s], shape (2, n_motors).
        pose: Result, position [m] and orientation, x y z w, of the base's inertial frame, shape (7,).
        speed: Result, its velocity [m/s] and angular velocity [rad/s] in world axes, shape (6,).
    """
    n, addresses = places.shape[1], np.zeros(2, dtype=np.intp)
    status = c.submit(handle, c.request_state(handle, body))
    first = addresses.ctypes.data
    c.actual_state(status, 0, 0, 0, 0, first, first + addresses.itemsize, 0)
    positions = carray(c.as_doubles(addresses[0]), (7 + n,))
    velocities = carray(c.as_doubles(addresses[1]), (6 + n,))
    for i in range(n):
        motion[0, i], motion[1, i] = positions[places[0, i]], velocities[places[1, i]]
    for k in range(7):
        pose[k] = positions[k]
    for k in range(6):
        speed[k] = velocities[k]


def in_python(
    bullet: Any, client: int, body: int, joints: Sequence[int],
    floating: bool, substeps: int, step: float, period: float, drive: Drive, memory: Memory, turn: np.ndarray,
    outside: Callable[[np.ndarray, float], np.ndarray] | None = None,
) -> None:  # fmt: skip
    """Do as `in_c` does, by pybullet.

    Args:
        bullet: The module.
        client: pybullet's number of the client.
        body: pybullet's number of the robot.
        joints: Bullet's numbers of the motors.
        floating: See `in_c`, as for what follows.
        substeps: Physics steps.
        step: Physics period [s].
        period: Control period [s].
        drive: Parameters.
        memory: Moved on.
        turn: From base to world axes, shape (3, 3).
        outside: Given motion and time, applies what acts from outside and returns more joint torques [N·m].
    """
    for k in range(substeps):
        memory.motion[0], memory.motion[1], _, _ = zip(*bullet.getJointStates(body, joints, client), strict=True)
        if floating:
            memory.spin[0] = bullet.getBaseVelocity(body, client)[1]
        torques(drive, memory, turn, k, step, period)
        more = 0.0 if outside is None else outside(memory.motion, memory.servo.clock[0] + k * step)
        forces = (memory.torque + more).tolist()
        bullet.setJointMotorControlArray(body, joints, bullet.TORQUE_CONTROL, forces=forces, physicsClientId=client)
        if floating:
            bullet.applyExternalTorque(body, c.BASE, memory.push.tolist(), bullet.LINK_FRAME, client)
        bullet.stepSimulation(client)
