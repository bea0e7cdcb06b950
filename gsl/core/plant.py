"""A plant is what a world is made of, as data: robot, servos, contact, sensors. An effect maps a plant to a plant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gsl.core.body import Robot
from gsl.core.servo import Servo
from gsl.core.servo_law import ServoLaw

GRAVITY = 9.81  # [m/s²]
Hook = Callable[[np.ndarray, float], np.ndarray]
_HARD = 100.0  # hardness of what is hard per mass that a slide moves [1/kg]: a hinge of 0.01 kg·m² has 1


@dataclass(frozen=True)
class Contact:
    """Of foot and ground.

    Attributes:
        foot_friction, ground_friction: Coefficients of friction; Bullet multiplies them.
        stiffness, damping: Of the ground as a spring [N/m], [N·s/m]; None for a hard one.
        roughness: Greatest height of the ground's random bumps [m]; 0 for a plane.
        spacing: Distance of the bumps [m].
    """

    foot_friction: float = 0.8
    ground_friction: float = 1.0
    stiffness: float | None = None
    damping: float = 0.0
    roughness: float = 0.0
    spacing: float = 0.1


@dataclass(frozen=True)
class Sensors:
    """What the log shows of the joints; each of shape (n_motors,).

    Attributes:
        encoder_noise: Standard deviation of the logged positions [rad].
        bias: Added to the logged positions [rad].
    """

    encoder_noise: np.ndarray
    bias: np.ndarray


@dataclass(frozen=True)
class Push:
    """A force on a link's centre of mass for some time.

    Attributes:
        link: Name of the link.
        force: In world axes [N], shape (3,).
        start, end: From the start of the episode [s].
    """

    link: str
    force: np.ndarray
    start: float
    end: float


@dataclass(frozen=True)
class Plant:
    """Robot, servos, contact, sensors, and what the surroundings do.

    Attributes:
        gravity: In world axes [m/s²], shape (3,).
        pushes: Forces from outside.
        action_noise: Standard deviation of the noise on each motor's target [rad], shape (n_motors,).
        torque_noise: Standard deviations of the noise on each motor's torque [N·m]: drawn at every physics step, drawn
            once an episode; shape (2, n_motors).
        law: What the servos do beyond their parameters, if that was learned.
        hook: A user's own joint torque: (motion (2, n_motors), time since the episode began [s]) -> (n_motors,) [N·m].
    """

    robot: Robot
    servo: Servo
    contact: Contact
    sensors: Sensors
    gravity: np.ndarray
    action_noise: np.ndarray
    torque_noise: np.ndarray
    pushes: tuple[Push, ...] = ()
    law: ServoLaw | None = None
    hook: Hook | None = None

    def mask(self, joints: str | Sequence[str]) -> np.ndarray:
        """Return which motors a scope names, see `Robot.mask`."""
        return self.robot.mask(joints)

    def with_servo(self, **numbers: np.ndarray) -> Plant:
        """Return the plant with other numbers of the servos."""
        return replace(self, servo=self.servo._replace(**numbers))


def hardness(robot: Robot) -> np.ndarray:
    """Return how hard stops and teeth are against those of a hinge, shape (n_motors,): 1 of all that turn.

    Those of a slide are as hard against the mass that it moves as those of a hinge against its inertia, so that they
    are as stable at one physics step.
    """
    moved = {joint.child: robot.links[joint.child].mass for joint in robot.joints}
    for joint in reversed(robot.joints):
        if joint.parent in moved:
            moved[joint.parent] += moved[joint.child]
    joints = [robot.joint(name) for name in robot.motors]
    return np.array(
        [_HARD * (moved[joint.child] * joint.lever**2 + joint.armature) if joint.slides else 1.0 for joint in joints]
    )


def nominal(robot: Robot) -> Plant:
    """Return the plant of a robot with nothing but its sourced constants."""
    joints = [robot.joint(name) for name in robot.motors]
    gains = np.array([robot.gains[name] for name in robot.motors])
    zero = np.zeros(len(joints))
    servo = Servo.of(
        kp=gains[:, 0],
        kd=gains[:, 1],
        limit=np.array([joint.effort for joint in joints]),
        no_load_speed=robot.no_load_speed * np.array([joint.max_velocity for joint in joints]),
        armature=np.array([joint.armature for joint in joints]),
        torque_constant=np.array([robot.torque_constant.get(name, 1.0) for name in robot.motors]),
        motor_encoder=zero + (robot.encoder_side == "motor"),
    )
    sensors = Sensors(encoder_noise=zero, bias=zero)
    return Plant(
        robot,
        servo,
        Contact(),
        sensors,
        gravity=np.array([0.0, 0.0, -GRAVITY]),
        action_noise=zero,
        torque_noise=np.zeros((2, len(joints))),
    )


def noiseless(plant: Plant) -> Plant:
    """Return a plant without the noise of encoders, actions and torques."""
    sensors = replace(plant.sensors, encoder_noise=np.zeros_like(plant.sensors.encoder_noise))
    still = {name: np.zeros_like(getattr(plant, name)) for name in ("action_noise", "torque_noise")}
    return replace(plant, sensors=sensors, **still)
