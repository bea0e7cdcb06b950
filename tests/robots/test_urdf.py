import numpy as np
import pytest

from gsl.core.body import lump
from gsl.core.dynamics import forward_kinematics
from gsl.core.plant import nominal
from gsl.robots.nao import nao
from gsl.robots.urdf import principal_axes, urdf
from gsl.worlds.engine import Engine
from gsl.worlds.physics import Physics
from gsl.worlds.rotor import carry_inertia, rotors
from gsl.worlds.start import resting


@pytest.fixture
def engine():
    engine = Engine(nominal(nao()), Physics(0.002, 50, 0.02, floating=True))
    yield engine
    engine.close()


def matrix(engine: Engine, quaternion: tuple) -> np.ndarray:
    return np.array(engine.bullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)


def test_bullet_knows_the_masses_and_inertias_that_were_written(engine: Engine) -> None:
    robot = lump(nao())
    start = resting(robot, np.zeros(16), np.zeros(16), floating=True)
    engine.load(start.reading, start.commands)
    carried = rotors(robot, nominal(nao()).servo.armature, floating=True).carried
    extra, links = carry_inertia(robot, carried), engine.links
    total = 0.0
    for name, link in robot.links.items():
        info = engine.bullet.getDynamicsInfo(engine.body, links[name], physicsClientId=engine.client)
        turn = matrix(engine, info[4])
        total += info[0]
        assert info[0] == pytest.approx(link.mass, rel=1e-9)
        np.testing.assert_allclose(info[3], link.com, atol=1e-9)
        np.testing.assert_allclose(
            turn @ np.diag(info[2]) @ turn.T, link.inertia + extra.get(name, 0.0), atol=1e-9, rtol=1e-6
        )
    assert total == pytest.approx(nao().mass, rel=1e-9)


def test_bullet_puts_every_link_where_our_kinematics_put_it(engine: Engine) -> None:
    robot, rng = lump(nao()), np.random.default_rng(0)
    for _ in range(20):
        positions = np.array([rng.uniform(robot.joint(name).lower, robot.joint(name).upper) for name in robot.motors])
        start = resting(robot, positions, positions, floating=True)
        engine.load(start.reading, start.commands)
        frames = forward_kinematics(robot, dict(zip(robot.motors, positions, strict=True)))
        for name in list(robot.links)[1:]:
            state = engine.bullet.getLinkState(
                engine.body, engine.links[name], computeForwardKinematics=1, physicsClientId=engine.client
            )
            np.testing.assert_allclose(np.array(state[4]) - start.reading.place, frames.origin[name], atol=1e-6)
            np.testing.assert_allclose(matrix(engine, state[5]), frames.turn[name], atol=1e-6)


def test_principal_axes_are_a_rotation_that_restores_the_tensor() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        root = rng.standard_normal((3, 3))
        moments, axes = principal_axes(root @ root.T)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        np.testing.assert_allclose(axes @ np.diag(moments) @ axes.T, root @ root.T, atol=1e-12)


def test_lines_fit_into_bullets_reader_and_only_visuals_are_left_out() -> None:
    full, bare = urdf(nao()), urdf(nao(), visuals=False)
    assert max(map(len, full.splitlines())) < 8191
    assert "<visual>" in full and "<visual>" not in bare
    assert full.count("<collision>") == bare.count("<collision>") == 2
