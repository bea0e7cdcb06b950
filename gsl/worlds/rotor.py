"""Rotor inertia in an engine that has no armature parameter.

A motor's rotor adds its reflected inertia A to the diagonal of the mass matrix and to nothing else. Bullet can only
make links heavier to turn. A link with extra inertia about its joint's axis, however, resists every rotation of that
link: of the joints above it (hip, knee and ankle pitch axes are parallel) and of the base. So each link carries a share
of the rotor, which keeps the integration stable, and a torque takes the surplus away. The link of a slide carries none,
for its mass would weigh: there the force does all of it.

    (M + E) a = tau + (E - A) a          E from the links, A the rotors, a = generalised acceleration

The right-hand a can only be that of the last physics step, and a servo's torque changes from step to step: fed back as
it is, the loop chatters at 250 Hz or diverges. So the compensation c = (E - A) a is corrected towards what was measured
and at once for the known change of the servos' torque:

    c <- c + G (r ((E - A) a - c) + dtau) - dtau        G = (1 - (E - A) (M + E)^-1)^-1 of the robot's stance

The first part is a Newton step (contact and posture change (M + E)^-1, hence r < 1), the second makes the robot answer
a change of torque with (M + A)^-1. Of the linear loop of servos, compensation and robot no eigenvalue leaves the unit
circle at 2 ms: in the air, on one foot and on two, upright and in a deep crouch.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gsl.core.body import Robot
from gsl.core.compiled import compile_inner
from gsl.core.dynamics import forward_kinematics, mass_matrix

LINK_SHARE = 0.5  # of the rotor inertia that the link carries
RELAXATION = 0.6  # of a Newton step


@dataclass(frozen=True)
class Rotors:
    """Constants of the compensation, base rotation first, then motors: n = 3 + n_motors.

    Attributes:
        carried: Inertia that each motor's link carries about the joint's axis [kg·m²], shape (n_motors,).
        armature: True rotor inertia of each motor [kg·m²], shape (n_motors,).
        gain: The matrix G, shape (n, n).
        parent: Motor above each motor in the tree, -1 for the base, shape (n_motors,); parents come first in `order`.
        order: Motors from the base outwards, shape (n_motors,).
        axis: Of each motor in its parent's axes, shape (n_motors, 3).
        turns: 1 for each motor that turns, 0 for one that slides, shape (n_motors,).
    """

    carried: np.ndarray
    armature: np.ndarray
    gain: np.ndarray
    parent: np.ndarray
    order: np.ndarray
    axis: np.ndarray
    turns: np.ndarray


def rotors(robot: Robot, armature: np.ndarray, *, floating: bool, apart: np.ndarray | float = 0.0) -> Rotors:
    """Prepare the compensation for a robot without fixed joints.

    Args:
        robot: With its true link inertias.
        armature: Rotor inertia at the output [kg·m²], shape (n_motors,).
        floating: Whether the base is free to move.
        apart: Further rotor inertia, which turns on its own behind play or a spring [kg·m²], shape (n_motors,).
    """
    turns = np.array([not robot.joint(name).slides for name in robot.motors], dtype=float)
    carried = LINK_SHARE * (armature + apart) * turns
    surplus = _carry_matrix(robot, carried) - np.diag(np.r_[np.zeros(3), armature])
    return Rotors(
        carried,
        np.asarray(armature, dtype=float),
        _newton_gain(robot, carried, surplus, floating=floating),
        parent=np.array([_motor_above(robot, name) for name in robot.motors]),
        order=np.array([robot.motors.index(joint.name) for joint in robot.joints]),
        axis=np.array([robot.joint(name).axis for name in robot.motors]),
        turns=turns,
    )


def carry_inertia(robot: Robot, carried: np.ndarray) -> Mapping[str, np.ndarray]:
    """Return what is added to each link's inertia tensor [kg·m²], in link axes, by link."""
    joints = [robot.joint(name) for name in robot.motors]
    return {joint.child: value * np.outer(joint.axis, joint.axis) for joint, value in zip(joints, carried, strict=True)}


@compile_inner
def compensation(
    parent: np.ndarray,
    order: np.ndarray,
    axis: np.ndarray,
    turns: np.ndarray,
    carried: np.ndarray,
    armature: np.ndarray,
    gain: np.ndarray,
    motion: np.ndarray,
    spin: np.ndarray,
    step: float,
    memory: np.ndarray,
    work: np.ndarray,
    torque: np.ndarray,
) -> None:
    """Add the compensation c of this physics step to `torque`; its share for the base is `memory[0, :3]`, in base axes.

    Args:
        parent: Of `Rotors`, as the next five.
        order: Motors from the base outwards.
        axis: In the parent's axes.
        turns: 1, or 0 of slides.
        carried: By the links [kg·m²].
        armature: Of the rotors [kg·m²].
        gain: The matrix G.
        motion: Joint positions [rad] then velocities [rad/s], shape (2, n_motors).
        spin: Angular velocity of the base in base axes [rad/s], shape (3,).
        step: Physics period [s].
        memory: Rows c; last joint speeds (from column 3 on); last angular momentum of what the links carry, in base
            axes, rows 2 to 4; last torques without c; memory[1, 0] counts the calls; scratch. Shape (7, 3 + n_motors).
        work: Scratch, rows: rotation matrix (9), axis (3), angular velocity (3), momentum rate (3); (n_motors, 18).
        torque: Of the motors [N·m], shape (n_motors,).
    """
    n = len(parent)
    wanted = memory[6]
    wanted[:] = 0.0
    for i in order:
        _place(work, parent[i], i, axis[i], turns[i] * motion[0, i], turns[i] * motion[1, i], spin)
        speed = 0.0
        for k in range(3):
            speed += work[i, 9 + k] * work[i, 12 + k]
        for k in range(3):
            momentum = carried[i] * speed * work[i, 9 + k]
            work[i, 15 + k] = (momentum - memory[2 + k, 3 + i]) / step + carried[i] * speed * _turn(spin, work[i], k)
            memory[2 + k, 3 + i] = momentum
        wanted[3 + i] = -armature[i] * (motion[1, i] - memory[1, 3 + i]) / step
        memory[1, 3 + i] = motion[1, i]
    for index in range(n - 1, -1, -1):  # children first: a link's momentum rate loads every joint above it
        i = order[index]
        for k in range(3):
            wanted[3 + i] += work[i, 9 + k] * work[i, 15 + k]
            if parent[i] >= 0:
                work[parent[i], 15 + k] += work[i, 15 + k]
            else:
                wanted[k] += work[i, 15 + k]
    memory[1, 0] += 1.0
    relaxation = RELAXATION if memory[1, 0] > 1.5 else 0.0  # the first call only learns the speeds
    for k in range(n + 3):
        wanted[k] = relaxation * (wanted[k] - memory[0, k])
    for i in range(n):
        change = torque[i] - memory[5, 3 + i]
        memory[5, 3 + i] = torque[i]
        wanted[3 + i] += change
        memory[0, 3 + i] -= change
    for k in range(n + 3):
        for m in range(n + 3):
            memory[0, k] += gain[k, m] * wanted[m]
    for i in range(n):
        torque[i] += memory[0, 3 + i]


@compile_inner
def _turn(spin: np.ndarray, row: np.ndarray, k: int) -> float:
    """Component k of spin x axis: base axes turn with the base."""
    first, second = (k + 1) % 3, (k + 2) % 3
    return float(spin[first] * row[9 + second] - spin[second] * row[9 + first])


@compile_inner
def _place(
    work: np.ndarray, above: int, i: int, axis: np.ndarray, angle: float, speed: float, spin: np.ndarray
) -> None:
    """Fill in the rotation, axis and angular velocity of motor i's link, in base axes."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis[0], axis[1], axis[2]
    t = 1.0 - c
    r0, r1, r2 = c + t * x * x, t * x * y - s * z, t * x * z + s * y
    r3, r4, r5 = t * x * y + s * z, c + t * y * y, t * y * z - s * x
    r6, r7, r8 = t * x * z - s * y, t * y * z + s * x, c + t * z * z
    for k in range(3):
        if above >= 0:
            a, b, d = work[above, 3 * k], work[above, 3 * k + 1], work[above, 3 * k + 2]
            omega = work[above, 12 + k]
        else:
            a, b, d = 1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2)
            omega = spin[k]
        work[i, 9 + k] = a * x + b * y + d * z
        work[i, 12 + k] = omega + work[i, 9 + k] * speed
        work[i, 3 * k] = a * r0 + b * r3 + d * r6
        work[i, 3 * k + 1] = a * r1 + b * r4 + d * r7
        work[i, 3 * k + 2] = a * r2 + b * r5 + d * r8


def _newton_gain(robot: Robot, carried: np.ndarray, surplus: np.ndarray, *, floating: bool) -> np.ndarray:
    whole = mass_matrix(robot, robot.stance)
    used = np.r_[0:3, 6 : len(whole)]
    whole[np.ix_(used, used)] += _carry_matrix(robot, carried)
    if floating:
        mobility = np.linalg.inv(whole)[np.ix_(used, used)]
    else:
        mobility = np.zeros_like(surplus)
        mobility[3:, 3:] = np.linalg.inv(whole[6:, 6:])
    return np.linalg.inv(np.eye(len(surplus)) - surplus @ mobility)


def _carry_matrix(robot: Robot, carried: np.ndarray) -> np.ndarray:
    """E in the robot's stance for (base angular velocity, motor velocities): sum of carried (axis · spin)²."""
    frames, total = forward_kinematics(robot, robot.stance), np.zeros((3 + len(carried),) * 2)
    for i, name in enumerate(robot.motors):
        row = np.r_[frames.axis[name], np.zeros(len(carried))]
        while i >= 0:
            if not robot.joint(robot.motors[i]).slides:
                row[3 + i] = frames.axis[name] @ frames.axis[robot.motors[i]]
            i = _motor_above(robot, robot.motors[i])
        total += carried[robot.motors.index(name)] * np.outer(row, row)
    return total


def _motor_above(robot: Robot, name: str) -> int:
    parents = {joint.child: joint.name for joint in robot.joints}
    above = parents.get(robot.joint(name).parent)
    return -1 if above is None else robot.motors.index(above)
