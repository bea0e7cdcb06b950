"""Which joints of a description are driven, which follow another, which are held; and the robot that comes of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np

from gsl.core.body import Joint, Robot, lump, rotation
from gsl.core.setting import component, setting
from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError
from gsl.robots.defaults import armature_of, lone_servos, unknown_loads, with_gains
from gsl.robots.frames import Mount, align
from gsl.robots.joint_limits import ENDS, FREE, is_endless, is_range, limits_problem
from gsl.robots.mimic import Follows, leader_of, limits_like_leader
from gsl.robots.urdf_xml import DRIVEN, TURNING, Description, Hinge

ENDLESS = 2.0 * math.pi  # limit of the commands of a continuous joint, either way [rad]

Number = float | None


@component
class JointSettings:
    """What is known of a controlled joint, over what the URDF says; of a slide in m for rad and N for N·m."""

    kp: Annotated[Number, setting("proportional gain", unit="N·m/rad", gt=0)] = None
    kd: Annotated[Number, setting("derivative gain", unit="N·m·s/rad", ge=0)] = None
    effort: Annotated[Number, setting("peak torque", unit="N·m", gt=0)] = None
    velocity: Annotated[Number, setting("speed without load", unit="rad/s", gt=0)] = None
    armature: Annotated[Number, setting("inertia of the rotor at the output", unit="kg·m²", ge=0)] = None
    lower: Annotated[Number, setting("least position", unit="rad")] = None
    upper: Annotated[Number, setting("greatest position", unit="rad")] = None
    torque_constant: Annotated[float, setting("at the output", unit="N·m/A", gt=0)] = 1.0
    inertia: Annotated[Number, setting("of the load of a lone servo, its rotor's by default", unit="kg·m²", gt=0)] = (
        None
    )


def from_description(
    description: Description,
    joints: Mapping[str, JointSettings] | None,
    held: Mapping[str, float],
    stance: Mapping[str, float],
) -> Robot:
    """Return the robot of a URDF.

    Args:
        description: What the file says.
        joints: The controlled joints in order, with what is known of them; None for all that move and follow no other.
        held: Where others are held [rad], or [m] if they slide.
        stance: A usual posture [rad], [m].

    Raises:
        ConfigError: A joint does not exist, cannot be driven, or lacks a limit; or a link that moves has no mass.
    """
    hinges = {hinge.name: hinge for hinge in description.hinges}
    chosen = joints if joints is not None else {name: JointSettings() for name in drivable(description.hinges)}
    _check(chosen, held, hinges)
    follows = {hinge.name: leader for hinge in description.hinges if (leader := leader_of(hinge, hinges))}
    coupled = {
        name: way.leader
        for name, way in follows.items()
        if way.leader in chosen and abs(way.ratio) == 1.0 and hinges[name].slides == hinges[way.leader].slides
    }
    driven = {name: _make_driven(hinges[name], settings) for name, settings in chosen.items()}
    mounts, remarks, soft = [], [*description.remarks], dict[str, tuple[float, float]]()
    for hinge in description.hinges:
        if hinge.name in coupled:
            way = follows[hinge.name]
            own, missing = limits_like_leader(hinge, way, driven[way.leader])
            remarks += [f"joint {hinge.name} follows {way.leader} and takes over its {missing}"] if missing else []
            mounts.append(_couple(own, way, chosen[way.leader]))
            soft |= _soft(hinge, mounts[-1].joint, way)
        elif hinge.name in chosen:
            mounts.append(Mount(driven[hinge.name], hinge.turn))
            soft |= _soft(hinge, driven[hinge.name], Follows(hinge.name, 1.0, 0.0))
        else:
            mounts.append(_hold(hinge, place := _place(hinge, held, follows, hinges)))
            if hinge.kind != "fixed" and hinge.name not in held:
                remarks.append(_remark(hinge, place, follows.get(hinge.name), hinges))
    if sliding := [mount.joint.name for mount in mounts if mount.joint.slides]:
        remarks.append(f"joints that slide, their commands in m and forces in N: {', '.join(sliding)}")
    links, placed = align(description.links, mounts)
    robot = Robot(
        description.name, links, placed, tuple(chosen), coupled, stance=dict(stance), remarks=tuple(remarks), soft=soft,
        torque_constant=_torque_constants(chosen, coupled),
    )  # fmt: skip
    _check_masses(robot)
    leaders = {name: chosen[coupled.get(name, name)] for name in robot.motors}
    return with_gains(robot, {name: (settings.kp, settings.kd) for name, settings in leaders.items()})


def lone(name: str, joints: Mapping[str, JointSettings]) -> Robot:
    """Return servos of unknown load: a robot without a body.

    Raises:
        ConfigError: No joint is named, or one has no limits of torque and speed.
    """
    if not joints:
        raise ConfigError("joints", "names no joint; without a urdf they have to be named")
    nowhere, endless = np.zeros(3), {"lower": -ENDLESS, "upper": ENDLESS}
    hinges = [
        Hinge(joint, "revolute", "base", joint, nowhere, np.eye(3), np.array([0.0, 1.0, 0.0]), endless, {}, None)
        for joint in joints
    ]
    driven = {hinge.name: _make_driven(hinge, joints[hinge.name]) for hinge in hinges}
    inertias = {joint: joints[joint].inertia or driven[joint].armature for joint in joints}
    links, placed = lone_servos(driven, inertias)
    remark = "no body: every joint turns a load of its own, which effects of the base's links may put off its axis"
    robot = Robot(
        name, links, placed, tuple(joints), ranges=unknown_loads(driven), remarks=(remark,),
        torque_constant=_torque_constants(joints, {}),
    )  # fmt: skip
    return with_gains(robot, {joint: (settings.kp, settings.kd) for joint, settings in joints.items()})


def drivable(hinges: Sequence[Hinge]) -> list[str]:
    """Return the joints that can be controlled: all that turn or slide and follow no other."""
    return [hinge.name for hinge in hinges if hinge.kind in DRIVEN and hinge.follows is None]


def _check(chosen: Mapping[str, JointSettings], held: Mapping[str, float], hinges: Mapping[str, Hinge]) -> None:
    for name in (*chosen, *held):
        if name not in hinges:
            role = "joints" if name in chosen else "held"
            raise ConfigError(f"{role}.{name}", f"the URDF has no such joint{did_you_mean(name, hinges, listed=True)}")
    for name in held:
        if name in chosen or hinges[name].kind == "fixed":
            why = "is controlled" if name in chosen else "is fixed"
            raise ConfigError(f"held.{name}", f"the joint {why}; leave it out")
    for name, settings in chosen.items():
        hinge = hinges[name]
        if settings.inertia is not None:
            raise ConfigError(f"joints.{name}.inertia", "is for servos without a body; the URDF says it of the links")
        if hinge.kind not in DRIVEN:
            raise ConfigError(f"joints.{name}", f"is {hinge.kind}: it cannot be controlled; leave it out")
        if hinge.follows:
            raise ConfigError(f"joints.{name}", f"follows {hinge.follows[0]} (<mimic>); control that one")
    if not chosen:
        raise ConfigError("joints", "the URDF has no joint that turns or slides, so nothing can be controlled")


def _make_driven(hinge: Hinge, settings: JointSettings) -> Joint:
    own = {"effort": settings.effort, "velocity": settings.velocity, "lower": settings.lower, "upper": settings.upper}
    limit = {**hinge.limit, **_turns(hinge), **{key: value for key, value in own.items() if value is not None}}
    if problem := limits_problem(limit, slides=hinge.slides):
        raise ConfigError(f"joints.{hinge.name}", problem)
    lower, upper = limit["lower"], limit["upper"]
    if hinge.kind == "continuous" and settings.lower is None and settings.upper is None:
        lower, upper = -FREE, FREE
    effort, velocity = limit["effort"], limit["velocity"]
    armature = armature_of(effort, velocity) if settings.armature is None else settings.armature
    origin, axis = hinge.origin, hinge.axis
    place, limits = (hinge.name, hinge.parent, hinge.child, origin, axis), (lower, upper, velocity, effort, armature)
    return Joint(*place, *limits, slides=hinge.slides)


def _turns(hinge: Hinge) -> dict[str, float]:
    """Return the range of the commands of a continuous joint, of which a URDF need not say one."""
    if hinge.kind != "continuous":
        return {}
    own = {key: hinge.limit[key] for key in ENDS} if is_range(hinge.limit, slides=False) else {}
    return own or {"lower": -ENDLESS, "upper": ENDLESS}


def _soft(hinge: Hinge, joint: Joint, follows: Follows) -> dict[str, tuple[float, float]]:
    """Return the range that commands of a joint keep, by name; none where its <safety_controller> leaves it open."""
    ends = hinge.soft
    if not any(ends.values()):  # 0 and 0 are the defaults: nothing is said
        if not is_endless(joint):
            return {}
        ends = _turns(hinge)
    own = (ends.get("lower", -math.inf), ends.get("upper", math.inf))
    lower, upper = sorted(follows.ratio * (end - follows.offset) for end in own)
    lower, upper = max(lower, joint.lower), min(upper, joint.upper)
    if not (own[0] < own[1] and lower < upper):
        problem = f"its soft limits {own[0]:g} and {own[1]:g} {hinge.unit} leave no range; mend its <safety_controller>"
        raise ConfigError(f"joints.{hinge.name}", problem)
    return {hinge.name: (lower, upper)}


def _couple(hinge: Hinge, follows: Follows, leader: JointSettings) -> Mount:
    """Return a joint that follows another, turned and shifted such that its position is that of the leader."""
    joint = _make_driven(hinge, replace(leader, lower=None, upper=None))
    lower, upper = sorted(follows.ratio * (end - follows.offset) for end in (joint.lower, joint.upper))
    shifted = _move_to(hinge, follows.offset)
    axis = follows.ratio * joint.axis
    return Mount(replace(joint, origin=shifted.origin, axis=axis, lower=lower, upper=upper), shifted.turn)


def _hold(hinge: Hinge, place: float) -> Mount:
    """Return a joint that does not move, its frames those that it has where it is held."""
    held = _move_to(hinge, place)
    joint = Joint(hinge.name, hinge.parent, hinge.child, held.origin, hinge.axis, 0.0, 0.0, 0.0, 0.0, fixed_at=0.0)
    return Mount(joint, held.turn)


def _move_to(hinge: Hinge, place: float) -> Hinge:
    """Return a joint with the frame that its child has where it is at `place` [rad], or [m] if it slides."""
    if hinge.slides:
        return replace(hinge, origin=hinge.origin + hinge.turn @ hinge.axis * place)
    return replace(hinge, turn=hinge.turn @ rotation(hinge.axis, place)) if hinge.kind in TURNING else hinge


def _place(
    hinge: Hinge, held: Mapping[str, float], follows: Mapping[str, Follows], hinges: Mapping[str, Hinge]
) -> float:
    """Return where a joint is held [rad], or [m] if it slides.

    That is where the user says, else where it follows its leader to, else as near to 0 as it goes.
    """
    if hinge.name in held:
        return held[hinge.name]
    at, way = 0.0, follows.get(hinge.name)
    if way is not None and way.leader in hinges:
        at = way.ratio * _place(hinges[way.leader], held, {}, hinges) + way.offset
    lower, upper = hinge.limit.get("lower", -math.inf), hinge.limit.get("upper", math.inf)
    return min(max(at, lower), upper) if lower < upper else lower if math.isfinite(lower) else at


def _remark(hinge: Hinge, place: float, follows: Follows | None, hinges: Mapping[str, Hinge]) -> str:
    why = "not controlled"
    if follows and follows.leader not in hinges:
        why = f"follows {follows.leader}, which does not exist"
    elif follows and abs(follows.ratio) != 1.0:
        why = f"follows {follows.leader} by a factor of {follows.ratio:g}; only 1 and -1 can be driven"
    elif follows and hinge.slides != hinges[follows.leader].slides:
        why = f"follows {follows.leader}, of which one turns and the other slides"
    return f"joint {hinge.name} is held at {place:g} {hinge.unit} ({why})"


def _torque_constants(chosen: Mapping[str, JointSettings], coupled: Mapping[str, str]) -> dict[str, float]:
    return {name: chosen[coupled.get(name, name)].torque_constant for name in (*chosen, *coupled)}


def _check_masses(robot: Robot) -> None:
    body = lump(robot)
    for joint in body.joints:
        moments = np.linalg.eigvalsh(body.links[joint.child].inertia)
        if moments[0] < -1e-9 * moments[-1]:
            problem = f"it moves the link '{joint.child}', with a principal moment of inertia of {moments[0]:.3g} kg·m²"
            raise ConfigError(f"joints.{joint.name}", f"{problem}; no body has one below 0: mend its <inertial>")
        if body.links[joint.child].mass <= 0.0:
            problem = f"it moves the link '{joint.child}', which has no mass; give that an <inertial>"
            raise ConfigError(f"joints.{joint.name}", problem)
