"""A robot as data: links, joints and motors of a tree of rigid bodies, in SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

MESH = "mesh"


@dataclass(frozen=True)
class Shape:
    """A shape on a link [m]: a `box` of full edges, a `sphere` (radius,), a `cylinder` (radius, length) or a `mesh`.

    A mesh is in a file, scaled by `size`; it collides as its convex hull. A shape is turned by `turn`: roll, pitch and
    yaw about the link's x, y and z, in this order [rad].
    """

    kind: str
    size: tuple[float, ...]
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    collides: bool = False
    colour: tuple[float, float, float] = (0.9, 0.9, 0.92)
    along: str = "z"  # a cylinder's axis
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    file: str = ""
    shown: bool = True


@dataclass(frozen=True)
class Link:
    """A rigid body.

    Attributes:
        mass: [kg].
        com: Centre of mass in link axes [m], shape (3,).
        inertia: About the centre of mass in link axes [kg·m²], shape (3, 3).
        shapes: What it looks like and what it collides with.
    """

    name: str
    mass: float
    com: np.ndarray
    inertia: np.ndarray
    shapes: tuple[Shape, ...] = ()

    @property
    def looks(self) -> tuple[Shape, ...]:
        """The shapes that show."""
        return tuple(shape for shape in self.shapes if shape.shown)


LONGEST = 0.25  # way of a slide that counts as much as a radian of a hinge, at most [m]: about the arm of a robot
_USUAL = 2.0  # range of a hinge [rad]: the whole way of a short slide counts as much


@dataclass(frozen=True)
class Joint:
    """A hinge between two links, or a slide; with `fixed_at` [rad] it is rigid at that angle.

    All units of a slide are those of a hinge with m for rad and N for N·m: [m], [m/s], [N], [N/m], [kg].

    Attributes:
        origin: Of the child's frame in the parent's axes [m], shape (3,).
        axis: Unit vector, or as long as `lever`, shape (3,).
        lower, upper: Position limits [rad].
        max_velocity: [rad/s].
        effort: Peak torque [N·m].
        armature: Inertia of the rotor seen at the output [kg·m²].
        slides: Whether it slides along its axis in place of turning about it.
    """

    name: str
    parent: str
    child: str
    origin: np.ndarray
    axis: np.ndarray
    lower: float
    upper: float
    max_velocity: float
    effort: float
    armature: float = 0.0
    fixed_at: float | None = None
    slides: bool = False

    @property
    def size(self) -> float:
        """What counts as much as a radian of a hinge: 1 [rad], or a length [m] of a slide that fits its range.

        Margins, amplitudes and noise that are said in radians are by so much smaller for a slide.
        """
        lever = self.lever
        return min(LONGEST, lever * (self.upper - self.lower) / _USUAL) / lever if self.slides else 1.0

    @property
    def lever(self) -> float:
        """Metres in the unit of a slide's position: 1, or its size in angles (`core.slides`); 1 of a hinge."""
        return float(np.linalg.norm(self.axis)) if self.slides else 1.0


@dataclass(frozen=True)
class Robot:
    """A tree of links with its motors.

    Attributes:
        links: By name; the first one is the base.
        joints: Parents before children.
        controlled: Joints that an action names, in order.
        coupled: Further motors and the controlled joint whose command drives each.
        groups: Names for sets of motors, the scopes of effects.
        feet: Links whose ground contact is felt, by side.
        gains: Nominal proportional [N·m/rad] and derivative [N·m·s/rad] servo gains by motor.
        no_load_speed: Factor on max_velocity at which motoring torque vanishes.
        supply_voltage: Of the battery without load [V].
        torque_constant: Of the motors, seen at the output [N·m/A], by motor.
        encoder_side: Where the joint encoders sit, `output` or `motor`.
        encoder_step: Resolution of the joint encoders [rad].
        stance: A usual posture [rad] by joint, the one at which approximations are exact.
        upright_height: Base height below which it lies on the ground [m].
        torque_unit: Size of its servos against the NAO's: by so much more or less their friction differs.
        ranges: Documented ranges that differ from those of a NAO's class, by effect and parameter: (lower, upper).
        soft: Ranges that commands keep, within those that the motors can move in [rad], by motor: (lower, upper).
        remarks: What was left out or assumed when the robot was read from a file.
    """

    name: str
    links: Mapping[str, Link]
    joints: tuple[Joint, ...]
    controlled: tuple[str, ...]
    coupled: Mapping[str, str] = field(default_factory=dict)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    feet: Mapping[str, str] = field(default_factory=dict)
    gains: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    no_load_speed: float = 1.15
    supply_voltage: float = 12.0
    torque_constant: Mapping[str, float] = field(default_factory=dict)
    encoder_side: str = "output"
    encoder_step: float = 0.0
    stance: Mapping[str, float] = field(default_factory=dict)
    upright_height: float = 0.0
    torque_unit: float = 1.0
    ranges: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    soft: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def base(self) -> str:
        """Name of the root link."""
        return next(iter(self.links))

    @property
    def motors(self) -> tuple[str, ...]:
        """Every driven joint: the controlled ones, then the coupled ones."""
        return (*self.controlled, *self.coupled)

    @property
    def drive(self) -> np.ndarray:
        """For each motor the index of the action that drives it, shape (n_motors,)."""
        return np.array([self.controlled.index(self.coupled.get(name, name)) for name in self.motors])

    def mask(self, joints: str | Sequence[str]) -> np.ndarray:
        """Return which motors a scope names, shape (n_motors,): `all`, a group of the robot, joint names or a mix.

        Raises:
            KeyError: with the name that is neither a group nor a motor.
        """
        names: set[str] = set()
        for word in (joints,) if isinstance(joints, str) else joints:
            names |= set(self._members(word))
        return np.array([motor in names for motor in self.motors])

    def list_joints(self, joints: str | Sequence[str]) -> list[str]:
        """Return the controlled joints that a scope names, see `mask`."""
        return [name for name, acts in zip(self.controlled, self.mask(joints), strict=False) if acts]

    def _members(self, word: str) -> Sequence[str]:
        if word == "all":
            return self.motors
        if word in self.groups:
            return self.groups[word]
        if word in self.motors:
            return (word, *(motor for motor, driver in self.coupled.items() if driver == word))
        raise KeyError(word)

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return sum(link.mass for link in self.links.values())

    def joint(self, name: str) -> Joint:
        """Return the joint called `name`."""
        return next(joint for joint in self.joints if joint.name == name)

    @property
    def slides(self) -> tuple[str, ...]:
        """The motors that slide."""
        return tuple(name for name in self.motors if self.joint(name).slides)

    @property
    def sizes(self) -> np.ndarray:
        """What counts as much as a radian of each motor, see `Joint.size`, shape (n_motors,)."""
        return np.array([self.joint(name).size for name in self.motors])

    def bound_commands(self, name: str) -> tuple[float, float]:
        """Return the range that commands of a motor keep [rad]."""
        joint = self.joint(name)
        lower, upper = self.soft.get(name, (joint.lower, joint.upper))
        return max(lower, joint.lower), min(upper, joint.upper)


def rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the matrix that turns by `angle` [rad] about a unit `axis`, shape (3, 3) (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def with_mass(link: Link, mass: float, com: np.ndarray, inertia: np.ndarray) -> Link:
    """Return `link` with another rigid body (mass, com, inertia about com; link axes) welded on."""
    total = link.mass + mass
    joint_com = (link.mass * link.com + mass * com) / total if total > 0.0 else link.com
    moved = [
        _move_inertia(i, m, c - joint_com) for i, m, c in ((link.inertia, link.mass, link.com), (inertia, mass, com))
    ]
    return replace(link, mass=total, com=joint_com, inertia=np.sum(moved, axis=0))


def carrier(robot: Robot, link: str, point: np.ndarray) -> tuple[str, np.ndarray]:
    """Return the link that a link is welded to by fixed joints, if any, and a point of it in that one's axes [m]."""
    fixed = {joint.child: joint for joint in robot.joints if joint.fixed_at is not None}
    while link in fixed:
        joint = fixed[link]
        point = joint.origin + rotation(joint.axis, joint.fixed_at or 0.0) @ point
        link = joint.parent
    return link, point


def lump(robot: Robot) -> Robot:
    """Return the same robot with every fixed joint's child welded into its parent.

    Joints may move on a welded link if it is held at 0: its axes are then those of its parent.
    """
    links, joints = dict(robot.links), list(robot.joints)
    for joint in reversed(robot.joints):  # children before parents
        if joint.fixed_at is None:
            continue
        turn, child = rotation(joint.axis, joint.fixed_at), links.pop(joint.child)
        links[joint.parent] = _weld(links[joint.parent], child, turn, joint.origin)
        joints.remove(joint)
        joints = [_carry(other, joint) if other.parent == joint.child else other for other in joints]
    return replace(robot, links=links, joints=tuple(joints))


def _carry(other: Joint, joint: Joint) -> Joint:
    """Return a joint that moves on the link which `joint` welds to its parent, as one of that parent."""
    if joint.fixed_at != 0.0:
        raise ValueError(f"{other.name} moves on {joint.child}, which is held at an angle")
    return replace(other, parent=joint.parent, origin=joint.origin + other.origin)


def _weld(parent: Link, child: Link, turn: np.ndarray, origin: np.ndarray) -> Link:
    whole = with_mass(parent, child.mass, origin + turn @ child.com, turn @ child.inertia @ turn.T)
    shapes = tuple(replace(s, centre=tuple(origin + turn @ np.array(s.centre))) for s in child.shapes)
    return replace(whole, shapes=parent.shapes + shapes)


def _move_inertia(inertia: np.ndarray, mass: float, offset: np.ndarray) -> np.ndarray:
    """Steiner: inertia about a point `offset` away from the centre of mass."""
    return inertia + mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
