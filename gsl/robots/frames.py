"""Frames that are all parallel to the base's while the joints are at zero: how a tree with turned frames becomes ours.

A joint of ours has an origin but no rotation: where a description turns a child's frame, the child is told in the axes
that it has at zero instead. Masses, torques and joint angles are the same; only a link's own axes are others.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gsl.core.body import Joint, Link, Shape


class Mount(NamedTuple):
    """A joint as most descriptions have it.

    Attributes:
        joint: Its origin is in the parent's axes, its axis in the child's.
        turn: From the child's axes to the parent's at zero, shape (3, 3).
    """

    joint: Joint
    turn: np.ndarray


def euler(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return the matrix that turns about fixed x, then y, then z [rad], shape (3, 3)."""
    matrix: np.ndarray = Rotation.from_euler("xyz", (roll, pitch, yaw)).as_matrix()
    return matrix


def rpy(turn: np.ndarray) -> tuple[float, float, float]:
    """Return the angles that `euler` makes a matrix of [rad]."""
    with warnings.catch_warnings():  # at a pitch of a quarter turn only the sum of the others counts: any will do
        warnings.simplefilter("ignore", UserWarning)
        roll, pitch, yaw = Rotation.from_matrix(turn).as_euler("xyz").tolist()
    return roll, pitch, yaw


def align(links: Mapping[str, Link], mounts: Iterable[Mount]) -> tuple[dict[str, Link], tuple[Joint, ...]]:
    """Return the same tree in frames parallel to the base's.

    Args:
        links: By name, the base first.
        mounts: Parents before children.
    """
    turns, joints = {next(iter(links)): np.eye(3)}, []
    for joint, turn in mounts:
        above = turns[joint.parent]
        turns[joint.child] = here = above @ turn
        joints.append(replace(joint, origin=above @ joint.origin, axis=here @ joint.axis))
    return {name: turn_link(links[name], turn) for name, turn in turns.items()}, tuple(joints)


def turn_link(link: Link, turn: np.ndarray) -> Link:
    """Return a link in other axes, `turn` leading from its own to those, shape (3, 3)."""
    if np.array_equal(turn, np.eye(3)):
        return link
    shapes = tuple(_turn_shape(shape, turn) for shape in link.shapes)
    return replace(link, com=turn @ link.com, inertia=turn @ link.inertia @ turn.T, shapes=shapes)


def _turn_shape(shape: Shape, turn: np.ndarray) -> Shape:
    return replace(shape, centre=tuple(turn @ np.array(shape.centre)), turn=rpy(turn @ euler(*shape.turn)))
