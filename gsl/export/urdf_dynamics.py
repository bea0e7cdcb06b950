"""A simulator as URDF: joints with `<dynamics damping friction>` and `<limit effort>`, all else as the robot has it."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np

from gsl.export.parts import Export, Simulator, text, unheld
from gsl.robots.urdf import urdf

HELD = ("coulomb", "viscous", "limit")
REMARKS = {name: "no element of URDF has it; MJCF or Isaac Lab do" for name in ("kp", "kd", "armature")}


def export_urdf(simulator: Simulator, own: Path | None) -> Export:
    """Return the robot's URDF with what the simulator has learned of its joints.

    Args:
        simulator: The simulator.
        own: URDF that the robot was read from, whose meshes and comments stay; none for a robot of gsl's.
    """
    plant = simulator.plant
    parser = xml.XMLParser(target=xml.TreeBuilder(insert_comments=True))
    root = xml.fromstring(urdf(plant.robot)) if own is None else xml.parse(own, parser).getroot()
    for joint in root.iter("joint"):
        name = joint.get("name", "")
        if name not in plant.robot.motors:
            continue
        k = plant.robot.motors.index(name)
        _element(joint, "dynamics", damping=plant.servo.viscous[k], friction=plant.servo.coulomb[k])
        if np.isfinite(plant.servo.limit[k]):
            _element(joint, "limit", effort=plant.servo.limit[k])
    xml.indent(root)
    return Export(
        {f"{simulator.name}.urdf": xml.tostring(root, encoding="unicode") + "\n"}, unheld(plant, HELD, REMARKS)
    )


def _element(joint: xml.Element, tag: str, **values: float) -> None:
    element = joint.find(tag)
    element = xml.SubElement(joint, tag) if element is None else element
    for name, value in values.items():
        element.set(name, text(float(value)))
