"""What a URDF says, element by element: links, joints and primitive shapes in its own frames, and what was left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar
from xml.etree import ElementTree as xml

import numpy as np

from gsl.core.body import Link
from gsl.core.budget import JOINTS, MOVING, URDF_BYTES, open_file, within
from gsl.core.validation import did_you_mean
from gsl.errors import InputError
from gsl.robots.joint_limits import ENDS
from gsl.robots.urdf_numbers import find_only, read_number, read_numbers, read_origin
from gsl.robots.urdf_remarks import remarks
from gsl.robots.urdf_shapes import Looks

T = TypeVar("T")

TURNING = ("revolute", "continuous")
SLIDING = "prismatic"
DRIVEN = (*TURNING, SLIDING)
_LIMITS = (*ENDS, "effort", "velocity")
_SOFT = {"lower": "soft_lower_limit", "upper": "soft_upper_limit"}
_LEFT = ("${", "$(")  # how an expression begins that xacro would have replaced
FLOATING = "floating"
KINDS = (*DRIVEN, "fixed")


@dataclass(frozen=True)
class Hinge:
    """A joint as it is written.

    Attributes:
        kind: One of `KINDS`.
        origin: Of the child's frame in the parent's [m], shape (3,).
        turn: From the child's axes to the parent's, shape (3, 3).
        axis: In the child's frame, of length 1, shape (3,).
        limit: What <limit> says: lower and upper, both or neither, effort, velocity.
        soft: What <safety_controller> says of the range that commands keep: lower, upper [rad].
        follows: Joint, multiplier and offset [rad] of <mimic>, if there is one.
        dynamics: What <dynamics> says: damping [N·m·s/rad], friction [N·m].

    If it slides, m stands for rad and N for N·m.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: np.ndarray
    turn: np.ndarray
    axis: np.ndarray
    limit: dict[str, float]
    soft: dict[str, float]
    follows: tuple[str, float, float] | None
    dynamics: dict[str, float] = field(default_factory=dict)

    @property
    def slides(self) -> bool:
        """Whether it moves along its axis."""
        return self.kind == SLIDING

    @property
    def unit(self) -> str:
        """Of its position."""
        return "m" if self.slides else "rad"


@dataclass(frozen=True)
class Description:
    """A whole file.

    Attributes:
        name: Of the robot.
        links: By name, the base first.
        hinges: Parents before children.
        remarks: What was left out.
        hulls: Files of the meshes that collide.
    """

    name: str
    links: dict[str, Link]
    hinges: tuple[Hinge, ...]
    remarks: tuple[str, ...]
    hulls: tuple[Path, ...] = ()


def read_description(path: Path, *, hulls: bool = False) -> Description:
    """Read a URDF.

    Args:
        path: Of the file.
        hulls: Whether meshes collide, as convex hulls.

    Raises:
        InputError: It cannot be read, or is not a tree of links with names, numbers and known joints.
    """
    root = _root(path)
    try:
        looks = Looks(path, root, hulls=hulls)
        links = {link.name: link for link in _each(root, "link", partial(_link, looks))}
        base, hinges = _tree(links, _each(root, "joint", _hinge))
        ordered = {name: links[name] for name in (base, *(hinge.child for hinge in hinges))}
        lines = (*looks.remarks(), *remarks(root, ordered.values(), hinges))
        return Description(root.get("name") or path.stem, ordered, hinges, lines, looks.hull_files())
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


def _root(path: Path) -> xml.Element:
    try:
        with open_file(path, URDF_BYTES) as file, within(f"{path}: reading it"):
            root = xml.parse(file).getroot()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (xml.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: is not XML, or damaged: {error}") from error
    if "xacro" in path.suffix or any("xacro" in str(node.tag) for node in root.iter()):
        raise InputError(f"{path}: holds xacro macros; expand them first: xacro {path.name} > robot.urdf")
    _strip_namespace(root)
    if root.tag != "robot":
        raise InputError(f"{path}: is no URDF: its root is <{root.tag}>, not <robot>")
    if left := next((text for node in root.iter() for text in _expressions(node)), ""):
        problem = f"holds an expression of xacro that was not replaced, {left[:40]}"
        raise InputError(f"{path}: {problem}; expand it first: xacro {path.name} > robot.urdf")
    if (count := max(len(root.findall("joint")), len(root.findall("link")))) > JOINTS:
        raise InputError(f"{path}: has {count:,} joints or links; {JOINTS} are read")
    if (count := sum(joint.get("type") != "fixed" for joint in root.findall("joint"))) > MOVING:
        raise InputError(f"{path}: has {count:,} joints that move; {MOVING} are simulated at most")
    return root


def _strip_namespace(root: xml.Element) -> None:
    """Take the root's own namespace off all elements that have it: a default xmlns changes nothing of a URDF."""
    space, brace, _ = root.tag.rpartition("}")
    for node in root.iter() if brace else ():
        if isinstance(node.tag, str):
            node.tag = node.tag.removeprefix(f"{space}}}")


def _expressions(node: xml.Element) -> list[str]:
    """Return the attributes in which xacro has left something to replace; files of meshes are not read anyway."""
    values = (value for name, value in node.attrib.items() if name != "filename")
    return [value for value in values if any(mark in value for mark in _LEFT)]


def _each(root: xml.Element, tag: str, read: Callable[[str, xml.Element], T]) -> list[T]:
    parts: list[T] = []
    names: set[str] = set()
    for node in root.findall(tag):
        name = node.get("name")
        if not name:
            raise ValueError(f"a <{tag}> has no name")
        if not name.isprintable():
            raise ValueError(f"the name of a {tag}, {name!r}, has marks that cannot be printed")
        if name in names:
            raise ValueError(f"two {tag}s are called '{name}'")
        names.add(name)
        try:
            parts.append(read(name, node))
        except ValueError as error:
            raise ValueError(f"{tag} '{name}': {error}") from error
    return parts


def _link(looks: Looks, name: str, node: xml.Element) -> Link:
    inertial = find_only(node, "inertial")
    shapes = looks.read(node)
    if inertial is None:
        return Link(name, 0.0, np.zeros(3), np.zeros((3, 3)), shapes)
    com, turn = read_origin(inertial)
    mass = read_number(find_only(inertial, "mass"), "value", "<mass>")
    tensor = find_only(inertial, "inertia")
    xx, xy, xz, yy, yz, zz = (
        read_number(tensor, f"i{pair}", "<inertia>") for pair in ("xx", "xy", "xz", "yy", "yz", "zz")
    )
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if mass < 0.0:
        raise ValueError("its mass is negative; no body is like that")
    return Link(name, mass, com, turn @ inertia @ turn.T, shapes)


def _hinge(name: str, node: xml.Element) -> Hinge:
    kind = node.get("type", "")
    if kind == FLOATING:  # the world says whether a base is free
        kind = "fixed"
    if kind not in KINDS:
        raise ValueError(f"type '{kind}' is not supported; there are {', '.join(KINDS)}")
    parent, child = (
        end.get("link", "") if (end := find_only(node, role)) is not None else "" for role in ("parent", "child")
    )
    if not (parent and child):
        raise ValueError("names no parent or no child link")
    axis = find_only(node, "axis")
    way = np.array(read_numbers(axis.get("xyz", ""), 3, "axis") if axis is not None else (1.0, 0.0, 0.0))
    if kind != "fixed" and not np.linalg.norm(way) > 1e-9:
        raise ValueError("its axis has no direction")
    limit, mimic = find_only(node, "limit"), find_only(node, "mimic")
    limits = {
        key: read_number(limit, key, "<limit>") for key in _LIMITS if limit is not None and limit.get(key) is not None
    }
    if {*ENDS} & set(limits) and kind != "continuous":
        limits = dict.fromkeys(ENDS, 0.0) | limits  # what the format says of one that is left out
    safety, follows = find_only(node, "safety_controller"), None
    soft = {
        key: read_number(safety, name, "<safety_controller>")
        for key, name in _SOFT.items()
        if safety is not None and safety.get(name) is not None
    }
    if mimic is not None:
        ratio, offset = (
            read_number(mimic, key, "<mimic>", missing) for key, missing in (("multiplier", 1.0), ("offset", 0.0))
        )
        follows = (mimic.get("joint", ""), ratio, offset)
    unit = way / np.linalg.norm(way) if way.any() else np.array([1.0, 0.0, 0.0])
    drag = find_only(node, "dynamics")
    dynamics = {
        key: read_number(drag, key, "<dynamics>")
        for key in ("damping", "friction")
        if drag is not None and drag.get(key) is not None
    }
    return Hinge(name, kind, parent, child, *read_origin(node), unit, limits, soft, follows, dynamics)


def _tree(links: dict[str, Link], hinges: Sequence[Hinge]) -> tuple[str, tuple[Hinge, ...]]:
    """Return the base and the joints, parents before children, in the file's order otherwise."""
    if not links:
        raise ValueError("it has no link")
    for hinge in hinges:
        for end in (hinge.parent, hinge.child):
            if end not in links:
                raise ValueError(f"joint '{hinge.name}': there is no link '{end}'{did_you_mean(end, links)}")
    children = [hinge.child for hinge in hinges]
    roots = [name for name in links if name not in children]
    if len(roots) != 1 or len(set(children)) != len(children):
        raise ValueError(f"it is no tree: {_knot(roots, children)}")
    ordered: list[Hinge] = []
    waiting, reached = list(hinges), {roots[0]}
    while ready := [hinge for hinge in waiting if hinge.parent in reached][:1]:
        ordered += ready
        reached.add(ready[0].child)
        waiting.remove(ready[0])
    if waiting:
        raise ValueError(f"it is no tree: {waiting[0].child} hangs in a loop")
    return roots[0], tuple(ordered)


def _knot(roots: Sequence[str], children: Sequence[str]) -> str:
    if len(roots) > 1:
        return f"{' and '.join(roots)} hang on nothing; one link alone is the base"
    twice = [name for name in children if children.count(name) > 1]
    return f"{twice[0]} is the child of two joints" if twice else "its links hang in a loop"
