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
from gsl.worlds.base_frame import fill_base_motion
from gsl.worlds.rotor import Rotors, compensation
from gsl.worlds.servo import servo_torque
from gsl.worlds.servo_state import ServoParameters, ServoState


class Drive(NamedTuple):
    """What never changes.

    Attributes:
        servo: Parameters of the servos, from `servo.packed`.
        base_axes: Of the base's inertial frame in its link axes, columns, shape (3, 3).
        base_com: Centre of mass of the base in its link axes [m], shape (3,).
        parent, order, axis, turns, carried, armature, gain: See `rotor.Rotors`.
    """

    servo: ServoParameters
    base_axes: np.ndarray
    base_com: np.ndarray
    parent: np.ndarray
    order: np.ndarray
    axis: np.ndarray
    turns: np.ndarray
    carried: np.ndarray
    armature: np.ndarray
    gain: np.ndarray

    @classmethod
    def of(cls, servo: ServoParameters, rotor: Rotors, base_axes: np.ndarray, base_com: np.ndarray) -> Drive:
        """Put together what `torques` needs."""
        constants = (rotor.parent, rotor.order, rotor.axis, rotor.turns, rotor.carried, rotor.armature, rotor.gain)
        return cls(servo, base_axes, base_com, *constants)


class Memory(NamedTuple):
    """What changes in time, all of it in place, with n motors.

    Attributes:
        servo: State of the servos.
        rotor: Memory of the compensation, shape (7, 3 + n).
        motion: Joint positions [rad] and velocities [rad/s] now, shape (2, n).
        base: Pose and velocity of the base's inertial frame now, see `fill_base_motion`, shape (13,).
        frame: Motion of the base's link frame at the last end of a control period, see base_frame.py, shape (6, 3).
        feet: Normal force on each foot then [N], shape (n_feet,).
        spin: Angular velocity of the base in base axes [rad/s], shape (3,).
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
    base: np.ndarray
    frame: np.ndarray
    feet: np.ndarray
    spin: np.ndarray
    load: np.ndarray
    drag: np.ndarray
    path: np.ndarray
    torque: np.ndarray
    push: np.ndarray
    work: np.ndarray


def first_memory(servo: ServoState, feet: int = 0, loads: int = 0) -> Memory:
    """Return the memory at the start, with how many feet there are and how many physics steps have loads."""
    n = servo.memory.shape[1]
    return Memory(
        servo,
        rotor=np.zeros((7, 3 + n)),
        motion=np.zeros((2, n)),
        base=np.zeros(13),
        frame=np.zeros((6, 3)),
        feet=np.zeros(feet),
        spin=np.zeros(3),
        load=np.zeros((loads, n)),
        drag=np.zeros(n),
        path=np.zeros((loads, 2, n)),
        torque=np.zeros(n),
        push=np.zeros(3),
        work=np.zeros((n, 18)),
    )


@compile_inner
def torques(drive: Drive, memory: Memory, k: int, step: float, period: float) -> None:
    """Fill in the torques of one physics step, given how joints and base move.

    Args:
        drive: Parameters.
        memory: Moved on by one step.
        k: Number of physics steps since the newest command was issued.
        step: Physics period [s].
        period: Control period [s].
    """
    servo_torque(drive.servo, memory.servo, memory.motion, k * step, step, period, memory.torque)
    if len(memory.load) > 0:
        for i in range(len(memory.torque)):
            memory.torque[i] += memory.load[k, i] - memory.drag[i] * memory.motion[1, i]
            memory.path[k, 0, i], memory.path[k, 1, i] = memory.motion[0, i], memory.motion[1, i]
    turn, world, base = memory.frame, memory.base[10:], memory.spin
    for k in range(3):  # within a control period the base hardly turns
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
    drive: Drive, memory: Memory, feet: np.ndarray, grounds: np.ndarray,
) -> None:  # fmt: skip
    """Step Bullet through a control period by its C interface, and measure the robot at its end.

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
        feet: Bullet's numbers of the links whose force is measured, shape (n_feet,).
        grounds: Bullet's numbers of what they stand on.
    """
    for k in range(substeps):
        torques(drive, memory, k, step, period)
        command = c.joint_control(handle, body, c.TORQUE_CONTROL)
        for i in range(places.shape[1]):
            c.set_torque(command, places[1, i], memory.torque[i])
        c.submit(handle, command)
        if floating:
            command = c.external_force(handle)
            c.set_external_torque(command, body, c.BASE, memory.push.ctypes.data, c.LINK_FRAME)
            c.submit(handle, command)
        c.submit(handle, c.step_simulation(handle))
        read_state(handle, body, places, memory.motion, memory.base)
    fill_base_motion(drive.base_axes, drive.base_com, memory.base, memory.frame)
    memory.feet[:] = 0.0
    for ground in grounds:
        add_forces(handle, body, ground, feet, memory.feet)


@compile_kernel
def read_state(handle: int, body: int, places: np.ndarray, motion: np.ndarray, base: np.ndarray) -> None:
    """Read the state by Bullet's C interface.

    Args:
        handle: From `bullet_c.client_handle`.
        body: Bullet's number of the robot.
        places: Of each motor in Bullet's state and velocity vectors, shape (2, n_motors).
        motion: Result, joint positions [rad] and velocities [rad/s], shape (2, n_motors).
        base: Result, see `Memory`, shape (13,).
    """
    n, addresses = places.shape[1], np.zeros(2, dtype=np.intp)
    status = c.submit(handle, c.request_state(handle, body))
    first = addresses.ctypes.data
    c.actual_state(status, 0, 0, 0, 0, first, first + addresses.itemsize, 0)
    positions = carray(c.as_doubles(addresses[0]), (7 + n,))
    velocities = carray(c.as_doubles(addresses[1]), (6 + n,))
    for i in range(n):
        motion[0, i], motion[1, i] = positions[places[0, i]], velocities[places[1, i]]
    base[:7], base[7:] = positions[:7], velocities[:6]


@compile_kernel
def add_forces(handle: int, body: int, ground: int, feet: np.ndarray, force: np.ndarray) -> None:
    """Add the normal forces [N] between links, `feet`, and a ground to `force`; both of shape (n_feet,)."""
    command = c.request_contacts(handle)
    c.set_contact_body_a(command, body)
    c.set_contact_body_b(command, ground)
    c.submit(handle, command)
    answer = np.zeros(2, dtype=np.intp)  # b3ContactInformation: how many points, an int, and where they are
    c.contacts(handle, answer.ctypes.data)
    count = answer[0]
    numbers = carray(c.as_ints(answer[1]), (2 * c.CONTACT * count,))
    values = carray(c.as_doubles(answer[1]), (c.CONTACT * count,))
    for point in range(count):
        for foot in range(len(feet)):
            if numbers[2 * c.CONTACT * point + c.LINK_A] == feet[foot]:
                force[foot] += values[c.CONTACT * point + c.NORMAL_FORCE]


def in_python(
    bullet: Any, client: int, body: int, joints: Sequence[int],
    floating: bool, substeps: int, step: float, period: float, drive: Drive, memory: Memory,
    outside: Callable[[np.ndarray, float], np.ndarray] | None = None,
) -> None:  # fmt: skip
    """Step as `in_c` does, by pybullet.

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
        outside: Given motion and time, applies what acts from outside and returns more joint torques [N·m].
    """
    for k in range(substeps):
        memory.motion[0], memory.motion[1], _, _ = zip(*bullet.getJointStates(body, joints, client), strict=True)
        if floating:
            memory.base[10:] = bullet.getBaseVelocity(body, client)[1]
        torques(drive, memory, k, step, period)
        more = 0.0 if outside is None else outside(memory.motion, memory.servo.clock[0] + k * step)
        forces = (memory.torque + more).tolist()
        bullet.setJointMotorControlArray(body, joints, bullet.TORQUE_CONTROL, forces=forces, physicsClientId=client)
        if floating:
            bullet.applyExternalTorque(body, c.BASE, memory.push.tolist(), bullet.LINK_FRAME, client)
        bullet.stepSimulation(client)
