"""A simulator as MJCF: the whole robot, its joints' properties, and a position actuator for every motor."""

from __future__ import annotations

from xml.etree import ElementTree as xml

import numpy as np

from gsl.core.body import MESH, Joint, Link, Robot, Shape, lump
from gsl.export.parts import UNLIMITED, Export, Simulator, text, unheld
from gsl.robots.frames import euler

HELD = ("kp", "kd", "limit", "coulomb", "viscous", "armature", "offset", "smoothing", "gravity")
REMARKS = {
    "no_load_speed": "force limits of MuJoCo do not fall with speed",
    "delay": "hold the command back in your loop, or use the actuators' delay of MuJoCo 3.5 and later",
    "sensor_delay": "hold positions back in your loop",
    "quantum": "round the command in your loop",
}
_ALONG = {"x": (0.0, np.pi / 2, 0.0), "y": (-np.pi / 2, 0.0, 0.0), "z": (0.0, 0.0, 0.0)}


def export_mjcf(simulator: Simulator) -> Export:
    """Return one file: control i is the desired position of motor i [rad], in the order of the robot's motors."""
    plant = simulator.plant
    robot, root = lump(plant.robot), xml.Element("mujoco", model=plant.robot.name)
    missing = unheld(plant, HELD, REMARKS)
    xml.SubElement(root, "compiler", angle="radian", autolimits="true", balanceinertia="true")
    xml.SubElement(
        root, "option", timestep=text(simulator.step), integrator="implicitfast", gravity=text(*plant.gravity)
    )
    world = xml.SubElement(root, "worldbody")
    if simulator.floating:
        xml.SubElement(
            world, "geom", name="ground", type="plane", size="0 0 1", conaffinity="0",
            friction=text(plant.contact.foot_friction * plant.contact.ground_friction, 0.005, 0.0001),
        )  # fmt: skip
    _add_body(world, robot, robot.links[robot.base], None, simulator)
    actuators = xml.SubElement(root, "actuator")
    for k, name in enumerate(plant.robot.motors):
        _add_actuator(actuators, simulator, k, name)
    xml.indent(root)
    return Export({f"{simulator.name}.xml": xml.tostring(root, encoding="unicode") + "\n"}, missing)


def _add_body(above: xml.Element, robot: Robot, link: Link, joint: Joint | None, simulator: Simulator) -> None:
    place = joint.origin if joint is not None else np.zeros(3)
    if joint is None and simulator.floating:
        place = np.array([0.0, 0.0, 2.0 * robot.upright_height])
    node = xml.SubElement(above, "body", name=link.name, pos=text(*place))
    if joint is not None:
        _add_joint(node, joint, simulator)
    elif simulator.floating:
        xml.SubElement(node, "freejoint", name="base")
    if link.mass > 0.0:
        i = link.inertia
        full = text(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
        xml.SubElement(node, "inertial", pos=text(*link.com), mass=text(link.mass), fullinertia=full)
    for shape in link.shapes:
        if shape.kind != MESH:
            _add_geom(node, shape)
    for below in robot.joints:
        if below.parent == link.name:
            _add_body(node, robot, robot.links[below.child], below, simulator)


def _add_joint(node: xml.Element, joint: Joint, simulator: Simulator) -> None:
    servo, motors = simulator.plant.servo, simulator.plant.robot.motors
    k = motors.index(joint.name)
    low, high = max(joint.lower, servo.lower_stop[k]), min(joint.upper, servo.upper_stop[k])
    xml.SubElement(
        node, "joint", name=joint.name, type="slide" if joint.slides else "hinge",
        axis=text(*joint.axis), range=text(low, high),
        armature=text(servo.armature[k]), damping=text(servo.viscous[k]), frictionloss=text(servo.coulomb[k]),
    )  # fmt: skip


def _add_geom(node: xml.Element, shape: Shape) -> None:
    sizes = {
        "box": [edge / 2.0 for edge in shape.size],
        "sphere": list(shape.size),
        "cylinder": [shape.size[0], shape.size[-1] / 2.0],
    }
    turn = euler(*shape.turn) @ (euler(*_ALONG[shape.along]) if shape.kind == "cylinder" else np.eye(3))
    xml.SubElement(
        node, "geom", type=shape.kind, size=text(*sizes[shape.kind]), pos=text(*shape.centre),
        xyaxes=text(*turn[:, 0], *turn[:, 1]), rgba=text(*shape.colour, 1.0), contype="0",
        conaffinity="1" if shape.collides else "0",
    )  # fmt: skip


def _add_actuator(actuators: xml.Element, simulator: Simulator, k: int, name: str) -> None:
    """Add force = kp (control + offset - q) - kd dq/dt within the limit; a filter on the control if it is smoothed."""
    servo = simulator.plant.servo
    kp, kd, offset, limit = (float(values[k]) for values in (servo.kp, servo.kd, servo.offset, servo.limit))
    low, high = simulator.plant.robot.bound_commands(name)
    settings: dict[str, str] = {"gainprm": text(kp), "biastype": "affine", "biasprm": text(kp * offset, -kp, -kd)}
    if limit < UNLIMITED:
        settings["forcerange"] = text(-limit, limit)
    if servo.smoothing[k] > 0.0:
        settings |= {"dyntype": "filterexact", "dynprm": text(servo.smoothing[k])}
    xml.SubElement(actuators, "general", {"name": name, "joint": name, "ctrlrange": text(low, high), **settings})
