"""Bullet with the compensation against exact models of the same robot with true rotors."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gsl.core.body import Robot, lump
from gsl.core.dynamics import forward_kinematics, jacobian, mass_matrix
from gsl.core.plant import GRAVITY, Plant, nominal
from gsl.robots.nao import nao
from gsl.worlds.engine import Engine
from gsl.worlds.physics import Physics
from gsl.worlds.rotor import carry_inertia
from gsl.worlds.start import resting

pytestmark = pytest.mark.slow

JOINTS = ("LHipPitch", "LKneePitch")  # parallel axes
SOFT = 1e-3  # N·m/rad: so small a gain makes a target a torque


def leg() -> Robot:
    """The NAO's torso with a thigh and a stiff lower leg on two parallel axes, far from their limits."""
    whole = nao()
    hip = replace(whole.joint("LHipPitch"), parent="torso", lower=-20.0, upper=20.0)
    knee = replace(whole.joint("LKneePitch"), lower=-20.0, upper=20.0)
    stiff = tuple(replace(whole.joint(name), fixed_at=0.0) for name in ("LAnklePitch", "LAnkleRoll"))
    links = {name: whole.links[name] for name in ("torso", "LThigh", "LTibia", "LAnkle", "LFoot")}
    gains = dict.fromkeys(JOINTS, (SOFT, 0.0))
    return lump(Robot("leg", links, (hip, knee, *stiff), JOINTS, gains=gains))


def torque_driven(robot: Robot) -> Plant:
    """Servos that pass on a torque: target x gain."""
    endless, n = np.full(len(robot.motors), 1e9), len(robot.motors)
    return nominal(robot).with_servo(kp=np.full(n, SOFT), kd=np.zeros(n), limit=endless, no_load_speed=endless)


def exact(robot: Robot, extra: Callable[[np.ndarray], np.ndarray], torques: np.ndarray, period: float) -> np.ndarray:
    """Integrate (M + extra) a + C v + g = torque by Runge-Kutta, a row of angles at the end of each torque's period."""

    def inertia(q: np.ndarray) -> np.ndarray:
        return mass_matrix(robot, dict(zip(robot.motors, q, strict=True)))[6:, 6:] + extra(q)

    def acceleration(q: np.ndarray, v: np.ndarray, torque: np.ndarray) -> np.ndarray:
        h, frames = 1e-5, forward_kinematics(robot, dict(zip(robot.motors, q, strict=True)))
        slopes = np.array([(inertia(q + h * unit) - inertia(q - h * unit)) / (2.0 * h) for unit in np.eye(len(q))])
        bias = np.einsum("kij,k,j->i", slopes, v, v) - 0.5 * np.einsum("ijk,j,k->i", slopes, v, v)
        for name, link in robot.links.items():
            bias += GRAVITY * link.mass * jacobian(robot, frames, name, link.com)[1][2, 6:]
        return np.linalg.solve(inertia(q), torque - SOFT * q - bias)

    q, v, h, path = np.zeros(len(robot.motors)), np.zeros(len(robot.motors)), 0.002, []
    for torque in torques:
        for _ in range(round(period / h)):
            k1v, k1q = acceleration(q, v, torque), v
            k2v, k2q = acceleration(q + h / 2 * k1q, v + h / 2 * k1v, torque), v + h / 2 * k1v
            k3v, k3q = acceleration(q + h / 2 * k2q, v + h / 2 * k2v, torque), v + h / 2 * k2v
            k4v, k4q = acceleration(q + h * k3q, v + h * k3v, torque), v + h * k3v
            q, v = q + h / 6 * (k1q + 2 * k2q + 2 * k3q + k4q), v + h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
        path.append(q)
    return np.array(path)


def in_bullet(plant: Plant, torques: np.ndarray, period: float) -> np.ndarray:
    engine = Engine(plant, Physics(0.002, 50, period, floating=False))
    start = resting(engine.robot, np.zeros(len(torques[0])), np.zeros(len(torques[0])), floating=False)
    engine.load(start.reading, start.commands)
    path = []
    for torque in torques:
        engine.run(torque / SOFT)
        path.append(engine.read().motion[0])
    engine.close()
    return np.array(path)


def test_parallel_axes_turn_as_with_true_rotors() -> None:
    robot, period = leg(), 0.02
    armature = nominal(robot).servo.armature
    torques = np.repeat([[0.9, 0.0], [-0.6, 0.5], [0.3, -0.7], [0.4, 0.4]], 6, axis=0)
    truth = exact(robot, lambda q: np.diag(armature), torques, period)
    both = np.outer([1.0, 0.0], [1.0, 0.0]) * armature[0] + np.outer([1.0, 1.0], [1.0, 1.0]) * armature[1]
    errors = {
        "compensated": in_bullet(torque_driven(robot), torques, period) - truth,
        "on the links": exact(robot, lambda q: both, torques, period) - truth,
        "left out": exact(robot, lambda q: 0.0 * both, torques, period) - truth,
    }
    rms = {name: float(np.sqrt(np.mean(error**2))) for name, error in errors.items()}
    assert rms["compensated"] < 0.06 * rms["on the links"]
    assert rms["compensated"] < 0.01 * rms["left out"]


def test_servos_do_not_chatter() -> None:
    """After a disturbance a held robot comes to rest from one physics step to the next."""
    robot = lump(nao())
    engine = Engine(nominal(nao()), Physics(0.002, 50, 0.002, floating=False))
    stance = np.array([robot.stance.get(name, 0.0) for name in robot.motors])
    start = resting(robot, stance, stance, floating=False)
    engine.load(start.reading, start.commands)
    for _ in range(25):
        engine.run(stance + 0.1)
    for _ in range(250):
        engine.run(stance)
    for _ in range(5):
        engine.run(stance)
        assert np.abs(engine.read().motion[1]).max() < 1e-3
    engine.close()


def momentum(engine: Engine) -> np.ndarray:
    """Angular momentum about the origin, then linear momentum, in world axes; a rotor turns on its joint alone."""
    reading, robot = engine.read(), engine.robot
    turn = np.array(engine.bullet.getMatrixFromQuaternion(reading.quaternion)).reshape(3, 3)
    named = dict(zip(robot.motors, reading.motion[0], strict=True))
    speeds = np.r_[reading.gyro, turn.T @ reading.velocity, reading.motion[1]]
    moved = mass_matrix(robot, named) @ speeds
    linear = turn @ moved[3:6]
    return np.r_[turn @ moved[:3] + np.cross(reading.place, linear), linear]


def drift(step: float, *, spin: float, movement: float) -> float:
    """Greatest change of angular momentum [N·m·s] in 0.3 s of free flight without gravity, limbs in motion."""
    robot = lump(nao())
    engine = Engine(nominal(nao()), Physics(step, 50, 0.02, floating=True))
    stance = np.array([robot.stance.get(name, 0.0) for name in robot.motors])
    start = resting(robot, stance, stance, floating=True)
    reading = start.reading._replace(place=np.array([0.0, 0.0, 1.0]), gyro=spin * np.array([0.3, 1.0, 0.5]))
    engine.load(reading, start.commands)
    engine.bullet.setGravity(0.0, 0.0, 0.0, physicsClientId=engine.client)
    before, worst, rng = momentum(engine), 0.0, np.random.default_rng(0)
    for _ in range(15):
        engine.run(stance + movement * rng.standard_normal(16))
        worst = max(worst, float(np.abs(momentum(engine) - before)[:3].max()))
    engine.close()
    return worst


@pytest.mark.parametrize(("spin", "movement"), [(0.0, 0.2), (2.0, 0.0), (2.0, 0.2)])
def test_a_robot_in_free_flight_keeps_its_angular_momentum(spin: float, movement: float) -> None:
    """Without the torque on the base it would change by 0.07 to 0.09 N·m·s; what is left vanishes with the step."""
    coarse, fine = drift(0.002, spin=spin, movement=movement), drift(0.0005, spin=spin, movement=movement)
    assert coarse < 0.02
    assert fine < 0.5 * coarse


def test_a_robot_in_free_flight_keeps_its_speed() -> None:
    robot = lump(nao())
    engine = Engine(nominal(nao()), Physics(0.0005, 50, 0.02, floating=True))
    stance = np.array([robot.stance.get(name, 0.0) for name in robot.motors])
    start = resting(robot, stance, stance, floating=True)
    engine.load(
        start.reading._replace(place=np.array([0.0, 0.0, 1.0]), velocity=np.array([0.4, 0.0, 0.1])), start.commands
    )
    engine.bullet.setGravity(0.0, 0.0, 0.0, physicsClientId=engine.client)
    before, rng = momentum(engine)[3:], np.random.default_rng(0)
    for _ in range(15):
        engine.run(stance + 0.2 * rng.standard_normal(16))
    after = momentum(engine)[3:]
    engine.close()
    np.testing.assert_allclose(after, before, atol=0.002 * robot.mass)


def test_inertia_on_a_link_is_about_its_axis_alone() -> None:
    robot = lump(nao())
    extra = carry_inertia(robot, np.ones(16))
    for name in robot.motors:
        joint = robot.joint(name)
        assert joint.axis @ extra[joint.child] @ joint.axis == pytest.approx(1.0)
        assert np.trace(extra[joint.child]) == pytest.approx(1.0)
