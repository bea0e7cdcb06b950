"""Remarks on a URDF: what of it is not read, and what looks wrong in it but can be simulated."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING
from xml.etree import ElementTree as xml

import numpy as np

from gsl.core.body import Link
from gsl.robots.joint_limits import ENDS

if TYPE_CHECKING:
    from gsl.robots.urdf_xml import Hinge

FAR = 4.0 * math.pi  # a limit beyond this is hardly in radians [rad]
ROUNDED = 1.01  # by which a moment of a thin plate may exceed the other two as it is written


def remarks(root: xml.Element, links: Iterable[Link], hinges: Iterable[Hinge]) -> list[str]:
    """Return what there is to say of a file and what it holds."""
    return [*_dynamics(root), *_floating(root), *_limits(hinges), *_soft(hinges), *_inertias(links)]


def _limits(hinges: Iterable[Hinge]) -> Iterator[str]:
    for hinge in hinges:
        ends = [hinge.limit[key] for key in ENDS if key in hinge.limit]
        if hinge.kind == "revolute" and ends and max(map(abs, ends)) > FAR:
            values = " and ".join(f"{end:g}" for end in ends)
            yield f"joint {hinge.name} has the limits {values} rad: are they in degrees? A URDF's are in radians"


def _soft(hinges: Iterable[Hinge]) -> Iterator[str]:
    for hinge in hinges:
        narrower = [key for key, end in hinge.soft.items() if end != hinge.limit.get(key)]
        if any(hinge.soft.values()) and narrower:
            ends = " and ".join(f"{hinge.soft[key]:g}" for key in ENDS if key in hinge.soft)
            yield f"commands of joint {hinge.name} keep the soft limits of its <safety_controller>: {ends} {hinge.unit}"
        elif not any(hinge.soft.values()) and hinge.soft:
            yield f"joint {hinge.name} has soft limits of 0 in its <safety_controller>: taken as not set"


def _inertias(links: Iterable[Link]) -> Iterator[str]:
    for link in links:
        first, second, greatest = np.linalg.eigvalsh(link.inertia)
        if greatest > ROUNDED * (first + second):
            three = ", ".join(f"{moment:.3g}" for moment in (first, second, greatest))
            yield (
                f"link {link.name} has the principal moments {three} kg·m²: no body has one that is more than the "
                "other two together; look at its <inertia>"
            )


def _dynamics(root: xml.Element) -> list[str]:
    joints = [joint.get("name", "") for joint in root.findall("joint") if joint.find("dynamics") is not None]
    if not joints:
        return []
    names = ", ".join(joints)
    return [f"<dynamics> of {names} is friction, an effect of the world: gsl init writes it into the world's file"]


def _floating(root: xml.Element) -> Iterator[str]:
    for joint in root.findall("joint"):
        if joint.get("type") == "floating":
            yield f"joint {joint.get('name', '')} is rigid here (floating): the base of a robot without feet is held"
