"""A robot held in the air, compiled: the tree of its links with exact rotor inertia under the same servos as in Bullet.

    (M(q) + A) d²q/dt² = torque - bias(q, dq/dt, gravity)        A = diag(armature)

M by the composite rigid body algorithm, bias by recursive Newton-Euler, both with spatial vectors about the base's
origin; the sparse factorisation of M + A costs only where the tree has branches (Featherstone 2008, chapters 5, 6, 8).
One physics step is a semi-implicit Euler step, as Bullet's is: with equal servos both agree far below an encoder's step
(tests/worlds/test_chain.py), and this one is many times faster.
The same code moves one robot and robots side by side (`lanes`).
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.compiled import compile_inner, compile_kernel
from gsl.core.plant import Plant
from gsl.core.sine import sine_cosine

# Columns of the scratch array, one row a link: see `_place` and `_bias`.
_TURN, _AXIS, _ARM, _SPIN, _FLOW, _TURNING, _RUSH, _MOMENT, _FORCE = 0, 9, 12, 15, 18, 21, 24, 27, 30
_MASS, _FIRST, _SECOND, _PLACE, COLUMNS = 33, 34, 37, 43, 46


class Chain(NamedTuple):
    """Constants of the tree; link i hangs on motor i, in the order of the robot's motors, base axes = world axes.

    Attributes:
        parent: Motor above each motor, -1 for the base, shape (n,).
        order: Motors, parents before children, shape (n,).
        axis: Of each motor in its parent's axes, shape (n, 3).
        slides: Whether each motor slides along its axis in place of turning about it, shape (n,).
        origin: Of each link's frame in its parent's axes [m], shape (n, 3).
        mass: [kg], shape (n,).
        com: Centres of mass in link axes [m], shape (n, 3).
        inertia: About them in link axes [kg·m²], shape (n, 3, 3).
        armature: Rotor inertia that moves with the output [kg·m²], shape (n,).
        gravity: [m/s²], shape (3,).
    """

    parent: np.ndarray
    order: np.ndarray
    axis: np.ndarray
    slides: np.ndarray
    origin: np.ndarray
    mass: np.ndarray
    com: np.ndarray
    inertia: np.ndarray
    armature: np.ndarray
    gravity: np.ndarray


class Pushed(NamedTuple):
    """Forces from outside, k of them.

    Attributes:
        motor: That moves the link, shape (k,).
        point: Where it acts, in that motor's link axes [m], shape (k, 3).
        force: [N], shape (k, 3).
    """

    motor: np.ndarray
    point: np.ndarray
    force: np.ndarray


_latest: deque[tuple[Robot, Chain]] = deque(maxlen=8)  # by the robot itself, which is frozen; welding takes long


def chain(plant: Plant, armature: np.ndarray) -> Chain:
    """Return the tree of a plant.

    Args:
        plant: Its robot may have fixed joints.
        armature: Rotor inertia that moves with the output [kg·m²], shape (n_motors,).
    """
    links = _links(plant.robot)
    return links._replace(armature=np.asarray(armature, dtype=float), gravity=plant.gravity)


def _links(robot: Robot) -> Chain:
    """Return the tree of a robot without rotors and gravity; a replay with other servos has the same one."""
    for other, tree in tuple(_latest):
        if other is robot:
            return tree
    welded = lump(robot)
    joints = [welded.joint(name) for name in welded.motors]
    links = [welded.links[joint.child] for joint in joints]
    above = {joint.child: welded.motors.index(joint.name) for joint in joints}
    tree = Chain(
        parent=np.array([above.get(joint.parent, -1) for joint in joints]),
        order=np.array([welded.motors.index(joint.name) for joint in welded.joints]),
        axis=np.array([joint.axis for joint in joints], dtype=float),
        slides=np.array([joint.slides for joint in joints]),
        origin=np.array([joint.origin for joint in joints], dtype=float),
        mass=np.array([link.mass for link in links]),
        com=np.array([link.com for link in links], dtype=float),
        inertia=np.array([link.inertia for link in links], dtype=float),
        armature=np.zeros(len(joints)),
        gravity=np.zeros(3),
    )
    _latest.append((robot, tree))
    return tree


@compile_kernel
def nothing() -> Pushed:
    """Return no force from outside."""
    return Pushed(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)))


@compile_inner
def accelerate(
    chain: Chain, motion: np.ndarray, pushed: Pushed, torque: np.ndarray, work: np.ndarray, matrix: np.ndarray
) -> None:
    """Turn joint torques [N·m] into joint accelerations [rad/s²], in place.

    Args:
        chain: The tree.
        motion: Positions [rad] and velocities [rad/s], shape (2, n).
        pushed: Forces from outside.
        torque: Shape (n,), overwritten.
        work: Scratch, shape (n, COLUMNS).
        matrix: Scratch, shape (n, n).
    """
    for i in chain.order:
        _place(chain, i, motion[0, i], work)
        _bias(chain, i, motion[1, i], work)
    for k in range(len(pushed.motor)):
        _push(pushed.point[k], pushed.force[k], work[pushed.motor[k]])
    for index in range(len(chain.order) - 1, -1, -1):
        i = chain.order[index]
        row, above = work[i], chain.parent[i]
        for k in range(3):
            torque[i] -= row[_AXIS + k] * row[_MOMENT + k] + row[_ARM + k] * row[_FORCE + k]
        _inertia_row(chain, i, work, matrix)
        if above >= 0:
            for k in range(_MOMENT, _PLACE):
                work[above, k] += row[k]
    _solve(chain, matrix, torque)


@compile_inner
def _place(chain: Chain, i: int, angle: float, work: np.ndarray) -> None:
    """Fill in link i's rotation, origin and joint screw, and its own inertia about the base's origin."""
    row, above, axis = work[i], chain.parent[i], chain.axis[i]
    s, c = sine_cosine(0.0 * angle if chain.slides[i] else angle)
    t, x, y, z = 1.0 - c, axis[0], axis[1], axis[2]
    local = (
        c + t * x * x, t * x * y - s * z, t * x * z + s * y,
        t * x * y + s * z, c + t * y * y, t * y * z - s * x,
        t * x * z - s * y, t * y * z + s * x, c + t * z * z,
    )  # fmt: skip
    for k in range(3):
        if above >= 0:
            a, b, d = work[above, 3 * k], work[above, 3 * k + 1], work[above, 3 * k + 2]
            start = work[above, _PLACE + k]
        else:
            a, b, d, start = 1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2), 0.0
        row[_AXIS + k] = a * x + b * y + d * z
        row[_PLACE + k] = start + a * chain.origin[i, 0] + b * chain.origin[i, 1] + d * chain.origin[i, 2]
        row[3 * k] = a * local[0] + b * local[3] + d * local[6]
        row[3 * k + 1] = a * local[1] + b * local[4] + d * local[7]
        row[3 * k + 2] = a * local[2] + b * local[5] + d * local[8]
    for k in range(3):
        first, second = (k + 1) % 3, (k + 2) % 3
        row[_ARM + k] = row[_PLACE + first] * row[_AXIS + second] - row[_PLACE + second] * row[_AXIS + first]
    if chain.slides[i]:
        for k in range(3):
            row[_PLACE + k] += angle * row[_AXIS + k]
            row[_ARM + k], row[_AXIS + k] = row[_AXIS + k], 0.0 * angle
    _own_inertia(chain, i, row)


@compile_inner
def _own_inertia(chain: Chain, i: int, row: np.ndarray) -> None:
    """Fill in mass, first and second moment (xx, xy, xz, yy, yz, zz) about the base's origin (Steiner)."""
    m, com, inertia = chain.mass[i], chain.com[i], chain.inertia[i]
    centre = (
        row[_PLACE] + row[0] * com[0] + row[1] * com[1] + row[2] * com[2],
        row[_PLACE + 1] + row[3] * com[0] + row[4] * com[1] + row[5] * com[2],
        row[_PLACE + 2] + row[6] * com[0] + row[7] * com[1] + row[8] * com[2],
    )
    far = centre[0] * centre[0] + centre[1] * centre[1] + centre[2] * centre[2]
    row[_MASS] = m
    slot = _SECOND
    for a in range(3):
        row[_FIRST + a] = m * centre[a]
        for b in range(a, 3):
            total = 0.0
            for k in range(3):
                half = inertia[k, 0] * row[3 * b] + inertia[k, 1] * row[3 * b + 1] + inertia[k, 2] * row[3 * b + 2]
                total += row[3 * a + k] * half
            row[slot] = total + m * ((far if a == b else 0.0) - centre[a] * centre[b])
            slot += 1


@compile_inner
def _bias(chain: Chain, i: int, speed: float, work: np.ndarray) -> None:
    """Fill in link i's velocity, its acceleration at constant joint speeds, and the force which that takes."""
    row, above = work[i], chain.parent[i]
    for k in range(3):
        if above >= 0:
            row[_SPIN + k], row[_FLOW + k] = work[above, _SPIN + k], work[above, _FLOW + k]
            row[_TURNING + k], row[_RUSH + k] = work[above, _TURNING + k], work[above, _RUSH + k]
        else:
            row[_SPIN + k], row[_FLOW + k], row[_TURNING + k], row[_RUSH + k] = 0.0, 0.0, 0.0, -chain.gravity[k]
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        row[_TURNING + k] += speed * (row[_SPIN + a] * row[_AXIS + b] - row[_SPIN + b] * row[_AXIS + a])
        row[_RUSH + k] += speed * (
            row[_SPIN + a] * row[_ARM + b] - row[_SPIN + b] * row[_ARM + a]
            + row[_FLOW + a] * row[_AXIS + b] - row[_FLOW + b] * row[_AXIS + a]
        )  # fmt: skip
    for k in range(3):
        row[_SPIN + k] += speed * row[_AXIS + k]
        row[_FLOW + k] += speed * row[_ARM + k]
    p, turn = _momentum(row, _SPIN, _FLOW)
    force, moment = _momentum(row, _TURNING, _RUSH)
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        row[_FORCE + k] = force[k] + row[_SPIN + a] * p[b] - row[_SPIN + b] * p[a]
        row[_MOMENT + k] = (
            moment[k] + row[_SPIN + a] * turn[b] - row[_SPIN + b] * turn[a]
            + row[_FLOW + a] * p[b] - row[_FLOW + b] * p[a]
        )  # fmt: skip


@compile_inner
def _push(point: np.ndarray, force: np.ndarray, row: np.ndarray) -> None:
    """Take what a force from outside at a point of the link gives off the force that the link needs."""
    place = (
        row[_PLACE] + row[0] * point[0] + row[1] * point[1] + row[2] * point[2],
        row[_PLACE + 1] + row[3] * point[0] + row[4] * point[1] + row[5] * point[2],
        row[_PLACE + 2] + row[6] * point[0] + row[7] * point[1] + row[8] * point[2],
    )
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        row[_FORCE + k] -= force[k]
        row[_MOMENT + k] -= place[a] * force[b] - place[b] * force[a]


@compile_inner
def _momentum(row: np.ndarray, angular: int, linear: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return mass matrix times a spatial vector (columns `angular`, `linear` of the row): linear and angular part."""
    w0, w1, w2 = row[angular], row[angular + 1], row[angular + 2]
    v0, v1, v2 = row[linear], row[linear + 1], row[linear + 2]
    m, h0, h1, h2 = row[_MASS], row[_FIRST], row[_FIRST + 1], row[_FIRST + 2]
    xx, xy, xz = row[_SECOND], row[_SECOND + 1], row[_SECOND + 2]
    yy, yz, zz = row[_SECOND + 3], row[_SECOND + 4], row[_SECOND + 5]
    along = (m * v0 + w1 * h2 - w2 * h1, m * v1 + w2 * h0 - w0 * h2, m * v2 + w0 * h1 - w1 * h0)
    about = (
        xx * w0 + xy * w1 + xz * w2 + h1 * v2 - h2 * v1,
        xy * w0 + yy * w1 + yz * w2 + h2 * v0 - h0 * v2,
        xz * w0 + yz * w1 + zz * w2 + h0 * v1 - h1 * v0,
    )
    return along, about


@compile_inner
def _inertia_row(chain: Chain, i: int, work: np.ndarray, matrix: np.ndarray) -> None:
    """Fill in row i of M + A for joint i and those above it; row i of `work` holds the inertia of all that i moves."""
    force, moment = _momentum(work[i], _AXIS, _ARM)
    j = i
    while j >= 0:
        other = work[j]
        matrix[i, j] = (
            other[_AXIS] * moment[0] + other[_AXIS + 1] * moment[1] + other[_AXIS + 2] * moment[2]
            + other[_ARM] * force[0] + other[_ARM + 1] * force[1] + other[_ARM + 2] * force[2]
        )  # fmt: skip
        j = chain.parent[j]
    matrix[i, i] += chain.armature[i]


@compile_inner
def _solve(chain: Chain, matrix: np.ndarray, right: np.ndarray) -> None:
    """Solve (M + A) x = right in place by LᵀDL, over ancestors only."""
    n = len(right)
    for index in range(n - 1, -1, -1):
        k = chain.order[index]
        i = chain.parent[k]
        while i >= 0:
            share, j = matrix[k, i] / matrix[k, k], i
            while j >= 0:
                matrix[i, j] -= share * matrix[k, j]
                j = chain.parent[j]
            matrix[k, i] = share
            right[i] -= share * right[k]
            i = chain.parent[i]
    for i in range(n):
        right[i] /= matrix[i, i]
    for k in chain.order:
        i = chain.parent[k]
        while i >= 0:
            right[k] -= matrix[k, i] * right[i]
            i = chain.parent[i]
