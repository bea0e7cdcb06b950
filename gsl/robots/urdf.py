"""URDF text of a robot, each link's inertia in its principal axes; urdf_xml.py reads such text."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np
from scipy.spatial.transform import Rotation

from gsl.core.body import MESH, Joint, Link, Robot, Shape
from gsl.robots.frames import euler, rpy
from gsl.robots.joint_limits import is_endless
from gsl.robots.meshes import draw_parts, hull_of, write_stl

_ALONG = {"x": (0.0, np.pi / 2, 0.0), "y": (np.pi / 2, 0.0, 0.0), "z": (0.0, 0.0, 0.0)}


def urdf(robot: Robot, *, visuals: bool = True, meshes: Path | None = None) -> str:
    """Return the robot as URDF text; fixed joints stay joints.

    Args:
        robot: To be written.
        visuals: Whether what only shows is written too.
        meshes: Folder that the parts of its meshes are written to, as STL files; without it meshes are left out.

    Raises:
        InputError: A mesh cannot be read.
    """
    root = xml.Element("robot", name=robot.name)
    for link in robot.links.values():
        _add_link(root, link, visuals, meshes)
    for joint in robot.joints:
        _add_joint(root, joint, robot.soft.get(joint.name))
    xml.indent(root)  # Bullet reads lines of at most 8191 characters
    return xml.tostring(root, encoding="unicode") + "\n"


def principal_axes(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the principal moments [kg·m²], shape (3,), and the rotation from principal to link axes, shape (3, 3)."""
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes = axes * np.array([1.0, 1.0, -1.0])
    return moments, axes


def _add_link(root: xml.Element, link: Link, visuals: bool, meshes: Path | None) -> None:
    node = xml.SubElement(root, "link", name=link.name)
    inertial = xml.SubElement(node, "inertial")
    moments, axes = principal_axes(link.inertia)
    _origin(inertial, link.com, rpy(axes))
    xml.SubElement(inertial, "mass", value=_text(link.mass))
    if 2 * moments.max() > moments.sum():  # Bullet would set such an inertia to zero; the world sets the true moments
        moments = np.full(3, moments.max())
    names = {"ixx": moments[0], "iyy": moments[1], "izz": moments[2], "ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
    xml.SubElement(inertial, "inertia", {name: _text(value) for name, value in names.items()})
    for shape in link.shapes:
        for role, wanted in (("visual", visuals and shape.shown), ("collision", shape.collides)):
            if wanted and shape.kind == MESH:
                _add_mesh(node, role, shape, meshes)
            elif wanted:
                _add_shape(node, role, shape)


def _add_mesh(node: xml.Element, role: str, shape: Shape, folder: Path | None) -> None:
    if folder is None:
        return
    for part in [hull_of(shape)] if role == "collision" or shape.collides else draw_parts(shape):
        file = folder / f"mesh_{len(list(folder.iterdir()))}.stl"
        write_stl(file, part)
        element = xml.SubElement(node, role)
        xml.SubElement(xml.SubElement(element, "geometry"), "mesh", filename=str(file))
        _add_colour(element, role, part.colour or shape.colour)


def _add_shape(node: xml.Element, role: str, shape: Shape) -> None:
    element = xml.SubElement(node, role)
    _origin(element, shape.centre, _attitude(shape))
    geometry = xml.SubElement(element, "geometry")
    if shape.kind == "box":
        xml.SubElement(geometry, "box", size=_text(*shape.size))
    elif shape.kind == "sphere":
        xml.SubElement(geometry, "sphere", radius=_text(*shape.size))
    else:
        radius, length = shape.size
        xml.SubElement(geometry, "cylinder", radius=_text(radius), length=_text(length))
    _add_colour(element, role, shape.colour)


def _add_colour(element: xml.Element, role: str, colour: Sequence[float]) -> None:
    if role == "visual":
        name = "rgb_" + "_".join(f"{round(255 * c)}" for c in colour)
        xml.SubElement(xml.SubElement(element, "material", name=name), "color", rgba=_text(*colour, 1.0))


def _attitude(shape: Shape) -> Sequence[float] | np.ndarray:
    """Return roll, pitch and yaw of a shape, a cylinder's axis included [rad]."""
    if not any(shape.turn):
        return _ALONG[shape.along]
    return rpy(euler(*shape.turn) @ euler(*_ALONG[shape.along]))


def _add_joint(root: xml.Element, joint: Joint, soft: tuple[float, float] | None) -> None:
    fixed = joint.fixed_at is not None
    endless = is_endless(joint)
    kind = "fixed" if fixed else "prismatic" if joint.slides else "continuous" if endless else "revolute"
    node = xml.SubElement(root, "joint", name=joint.name, type=kind)
    xml.SubElement(node, "parent", link=joint.parent)
    xml.SubElement(node, "child", link=joint.child)
    turn = Rotation.from_rotvec(joint.axis * joint.fixed_at).as_euler("xyz") if fixed else (0.0, 0.0, 0.0)
    _origin(node, joint.origin, turn)
    xml.SubElement(node, "axis", xyz=_text(*joint.axis))
    ends = {} if endless else {"lower": joint.lower, "upper": joint.upper}
    limit = {**ends, "effort": joint.effort, "velocity": joint.max_velocity}
    xml.SubElement(node, "limit", {name: _text(value) for name, value in limit.items()})
    if soft is not None:
        keep = {"soft_lower_limit": _text(soft[0]), "soft_upper_limit": _text(soft[1])}
        xml.SubElement(node, "safety_controller", {**keep, "k_velocity": "0"})


def _origin(
    node: xml.Element, xyz: Sequence[float] | np.ndarray, rpy: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)
) -> None:
    xml.SubElement(node, "origin", xyz=_text(*xyz), rpy=_text(*rpy))


def _text(*values: float) -> str:
    return " ".join(format(float(value), ".12g") for value in values)
