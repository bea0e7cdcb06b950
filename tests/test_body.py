import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsl.core.body import Joint, Link, Robot, lumped, rotation, with_mass
from gsl.core.dynamics import forward_kinematics
from gsl.robots.nao import nao


def moments(robot: Robot) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, first and second moment of a whole robot about its base frame, link by link."""
    frames = forward_kinematics(
        robot, {joint.name: 0.0 if joint.fixed_at is None else joint.fixed_at for joint in robot.joints}
    )
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for name, link in robot.links.items():
        turn, place = frames.turn[name], frames.origin[name] + frames.turn[name] @ link.com
        mass, first = mass + link.mass, first + link.mass * place
        second += turn @ link.inertia @ turn.T + link.mass * (place @ place * np.eye(3) - np.outer(place, place))
    return mass, first, second


def test_welding_fixed_joints_keeps_mass_centre_of_mass_and_inertia() -> None:
    whole, welded = moments(nao()), moments(lumped(nao()))
    assert all(joint.fixed_at is None for joint in lumped(nao()).joints)
    for before, after in zip(whole, welded, strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-12, atol=1e-15)


def test_two_points_welded_turn_about_their_common_centre() -> None:
    point = Link("a", 2.0, np.zeros(3), np.zeros((3, 3)))
    pair = with_mass(point, 3.0, np.array([0.0, 0.0, 0.5]), np.zeros((3, 3)))
    assert pair.mass == 5.0
    np.testing.assert_allclose(pair.com, [0.0, 0.0, 0.3])
    np.testing.assert_allclose(pair.inertia, np.diag([1.0, 1.0, 0.0]) * (2.0 * 3.0 / 5.0) * 0.25, atol=1e-15)


def test_nothing_may_move_on_a_welded_link() -> None:
    links = {name: Link(name, 1.0, np.zeros(3), np.eye(3)) for name in "abc"}
    held = Joint("weld", "a", "b", np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.0, 0.0, 0.0, 0.0, fixed_at=0.0)
    hinge = Joint("hinge", "b", "c", np.zeros(3), np.array([1.0, 0.0, 0.0]), -1.0, 1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match="hinge moves on b"):
        lumped(Robot("chain", links, (held, hinge), ("hinge",)))


def test_rotation_agrees_with_the_rotation_vector() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        axis, angle = rng.standard_normal(3), rng.uniform(-4.0, 4.0)
        axis /= np.linalg.norm(axis)
        np.testing.assert_allclose(rotation(axis, angle), Rotation.from_rotvec(axis * angle).as_matrix(), atol=1e-14)
