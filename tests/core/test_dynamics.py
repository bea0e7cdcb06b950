from pathlib import Path

import numpy as np
import pytest

from gsl.core.body import Joint, Link, Robot, lump
from gsl.core.dynamics import forward_kinematics, jacobian, mass_matrix
from gsl.core.plant import nominal
from gsl.robots.nao import nao
from gsl.robots.urdf import urdf
from gsl.worlds.engine import Engine
from gsl.worlds.physics import Physics
from gsl.worlds.start import resting

Y = np.array([0.0, 1.0, 0.0])


def double_pendulum(first: float, second: float, length: float) -> Robot:
    """Two point masses below a heavy base, hinges about y."""
    point, none = np.array([0.0, 0.0, -length]), np.zeros((3, 3))
    links = (Link("base", 5.0, np.zeros(3), np.eye(3)), Link("a", first, point, none), Link("b", second, point, none))
    joints = (
        Joint("hip", "base", "a", np.zeros(3), Y, -9.0, 9.0, 9.0, 9.0),
        Joint("knee", "a", "b", point, Y, -9.0, 9.0, 9.0, 9.0),
    )
    return Robot("pendulum", {link.name: link for link in links}, joints, ("hip", "knee"))


def test_double_pendulum_has_its_textbook_inertia() -> None:
    m1, m2, length, knee = 0.7, 0.4, 0.3, 0.9
    matrix = mass_matrix(double_pendulum(m1, m2, length), {"hip": -0.5, "knee": knee})[6:, 6:]
    last = m2 * length**2
    coupled = last * (1.0 + np.cos(knee))
    expected = [[m1 * length**2 + 2.0 * last * (1.0 + np.cos(knee)), coupled], [coupled, last]]
    np.testing.assert_allclose(matrix, expected, rtol=1e-12)


def test_kinetic_energy_is_that_of_the_links() -> None:
    robot, rng = lump(nao()), np.random.default_rng(0)
    angles, speeds = rng.uniform(-0.5, 0.5, 16), rng.standard_normal(22)
    named = dict(zip(robot.motors, angles, strict=True))
    frames, energy = forward_kinematics(robot, named), 0.0
    for name, link in robot.links.items():
        angular, linear = (part @ speeds for part in jacobian(robot, frames, name, link.com))
        turn = frames.turn[name]
        energy += 0.5 * (link.mass * linear @ linear + angular @ turn @ link.inertia @ turn.T @ angular)
    assert 0.5 * speeds @ mass_matrix(robot, named) @ speeds == pytest.approx(energy, rel=1e-12)


def test_jacobian_is_the_derivative_of_a_points_place() -> None:
    robot, rng, h = lump(nao()), np.random.default_rng(1), 1e-6
    angles, point = rng.uniform(-0.5, 0.5, 16), np.array([0.02, 0.01, -0.03])

    def place(at: np.ndarray) -> np.ndarray:
        frames = forward_kinematics(robot, dict(zip(robot.motors, at, strict=True)))
        return frames.origin["LFoot"] + frames.turn["LFoot"] @ point

    frames = forward_kinematics(robot, dict(zip(robot.motors, angles, strict=True)))
    linear = jacobian(robot, frames, "LFoot", point)[1][:, 6:]
    numeric = [(place(angles + h * unit) - place(angles - h * unit)) / (2.0 * h) for unit in np.eye(16)]
    np.testing.assert_allclose(linear, np.array(numeric).T, atol=1e-8)


def test_the_whole_robot_falls_as_one_mass() -> None:
    robot = lump(nao())
    matrix = mass_matrix(robot, robot.stance)
    np.testing.assert_allclose(matrix[3:6, 3:6], robot.mass * np.eye(3), atol=1e-12)
    assert np.linalg.eigvalsh(matrix).min() > 0.0


def test_joint_inertia_agrees_with_bullets(tmp_path: Path) -> None:
    robot, rng = lump(nao()), np.random.default_rng(2)
    engine = Engine(nominal(nao()), Physics(0.002, 50, 0.02, floating=False))
    start = resting(robot, np.zeros(16), np.zeros(16), floating=False)
    engine.load(start.reading, start.commands)
    b, client, order = engine.bullet, engine.client, np.argsort(engine.joints)
    (tmp_path / "bare.urdf").write_text(urdf(robot, visuals=False))
    flags = b.URDF_USE_INERTIA_FROM_FILE
    bare = b.loadURDF(str(tmp_path / "bare.urdf"), useFixedBase=True, flags=flags, physicsClientId=client)
    for _ in range(5):
        angles = rng.uniform(-0.3, 0.3, 16)
        theirs = b.calculateMassMatrix(bare, angles[order].tolist(), physicsClientId=client)
        ours = mass_matrix(robot, dict(zip(robot.motors, angles, strict=True)))[6:, 6:]
        np.testing.assert_allclose(theirs, ours[np.ix_(order, order)], atol=1e-8)
    engine.close()
