"""Inertia of a tree of rigid bodies, as sums over its links of textbook Jacobians."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from gsl.core.body import Joint, Robot, rotation


class Frames(NamedTuple):
    """Where the links are, in base axes.

    Attributes:
        turn: From link to base axes, by link, each of shape (3, 3).
        origin: Of the link frames [m], by link, each of shape (3,).
        axis: Of the joints, by joint, each of shape (3,).
    """

    turn: Mapping[str, np.ndarray]
    origin: Mapping[str, np.ndarray]
    axis: Mapping[str, np.ndarray]


def forward_kinematics(robot: Robot, angles: Mapping[str, float]) -> Frames:
    """Return the frames of a robot without fixed joints, at positions [rad], [m] by name; what is not named is at 0."""
    turn, origin, axis = {robot.base: np.eye(3)}, {robot.base: np.zeros(3)}, {}
    for joint in robot.joints:
        axis[joint.name] = turn[joint.parent] @ joint.axis
        origin[joint.child] = origin[joint.parent] + turn[joint.parent] @ joint.origin
        place = angles.get(joint.name, 0.0)
        if joint.slides:
            turn[joint.child] = turn[joint.parent]
            origin[joint.child] = origin[joint.child] + place * axis[joint.name]
        else:
            turn[joint.child] = turn[joint.parent] @ rotation(joint.axis, place)
    return Frames(turn, origin, axis)


def mass_matrix(robot: Robot, angles: Mapping[str, float]) -> np.ndarray:
    """Return the inertia for (base angular velocity, base linear velocity, motor velocities) in base axes.

    Rotor inertia is left out. Shape (6 + n_motors, 6 + n_motors); the base's frame is its link frame.
    """
    frames = forward_kinematics(robot, angles)
    total = np.zeros((6 + len(robot.motors),) * 2)
    for link in robot.links.values():
        angular, linear = jacobian(robot, frames, link.name, link.com)
        inertia = frames.turn[link.name] @ link.inertia @ frames.turn[link.name].T
        total += link.mass * linear.T @ linear + angular.T @ inertia @ angular
    return total


def gravity_torque(robot: Robot, angles: Mapping[str, float], gravity: np.ndarray) -> np.ndarray:
    """Return the motor torques that hold a robot against gravity, its base held [N·m], shape (n_motors,).

    Args:
        robot: Without fixed joints.
        angles: Of its joints by name [rad].
        gravity: In base axes [m/s²], shape (3,).
    """
    frames, torque = forward_kinematics(robot, angles), np.zeros(len(robot.motors))
    for link in robot.links.values():
        torque -= link.mass * jacobian(robot, frames, link.name, link.com)[1][:, 6:].T @ gravity
    return torque


def jacobian(robot: Robot, frames: Frames, link: str, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the angular and linear velocity of a point of a link per generalised velocity, each (3, 6 + n_motors)."""
    place = frames.origin[link] + frames.turn[link] @ point
    angular, linear = np.zeros((2, 3, 6 + len(robot.motors)))
    angular[:, :3], linear[:, 3:6] = np.eye(3), np.eye(3)
    linear[:, :3] = -_cross(place)
    for joint in _ancestors(robot, link):
        column = 6 + robot.motors.index(joint.name)
        if joint.slides:
            linear[:, column] = frames.axis[joint.name]
        else:
            angular[:, column] = frames.axis[joint.name]
            linear[:, column] = np.cross(frames.axis[joint.name], place - frames.origin[joint.child])
    return angular, linear


def _ancestors(robot: Robot, link: str) -> list[Joint]:
    """Joints between a link and the base."""
    above = {joint.child: joint for joint in robot.joints}
    joints = []
    while link in above:
        joints.append(above[link])
        link = above[link].parent
    return joints


def _cross(vector: np.ndarray) -> np.ndarray:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
