import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsl.core.body import Joint, Link, Robot, lump, rotation, with_mass
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
    whole, welded = moments(nao()), moments(lump(nao()))
    assert all(joint.fixed_at is None for joint in lump(nao()).joints)
    for before, after in zip(whole, welded, strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-12, atol=1e-15)


def test_two_points_welded_turn_about_their_common_centre() -> None:
    point = Link("a", 2.0, np.zeros(3), np.zeros((3, 3)))
    pair = with_mass(point, 3.0, np.array([0.0, 0.0, 0.5]), np.zeros((3, 3)))
    assert pair.mass == 5.0
    np.testing.assert_allclose(pair.com, [0.0, 0.0, 0.3])
    np.testing.assert_allclose(pair.inertia, np.diag([1.0, 1.0, 0.0]) * (2.0 * 3.0 / 5.0) * 0.25, atol=1e-15)


def welded_and_hinged(held_at: float) -> Robot:
    """Link b is held on a, c moves on b, d is held on c."""
    links = {name: Link(name, 1.0, np.zeros(3), np.eye(3)) for name in "abcd"}
    along, out = np.array([1.0, 0.0, 0.0]), np.array([0.3, 0.0, 0.1])
    held = Joint("weld", "a", "b", out, along, 0.0, 0.0, 0.0, 0.0, fixed_at=held_at)
    hinge = Joint("hinge", "b", "c", out, along, -1.0, 1.0, 1.0, 1.0)
    tip = Joint("tip", "c", "d", out, along, 0.0, 0.0, 0.0, 0.0, fixed_at=0.0)
    return Robot("chain", links, (held, hinge, tip), ("hinge",))


def test_what_moves_on_a_welded_link_moves_on_the_one_that_carries_it() -> None:
    body = lump(welded_and_hinged(0.0))
    (hinge,) = body.joints
    assert (hinge.parent, hinge.child, [*body.links]) == ("a", "c", ["a", "c"])
    np.testing.assert_allclose(hinge.origin, [0.6, 0.0, 0.2])
    assert [link.mass for link in body.links.values()] == [2.0, 2.0]


def test_nothing_may_move_on_a_link_that_is_held_at_an_angle() -> None:
    with pytest.raises(ValueError, match="hinge moves on b"):
        lump(welded_and_hinged(0.2))


def test_rotation_agrees_with_the_rotation_vector() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        axis, angle = rng.standard_normal(3), rng.uniform(-4.0, 4.0)
        axis /= np.linalg.norm(axis)
        np.testing.assert_allclose(rotation(axis, angle), Rotation.from_rotvec(axis * angle).as_matrix(), atol=1e-14)
