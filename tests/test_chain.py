"""The chain model against Bullet, against sums of textbook Jacobians, and against itself in pieces."""

from dataclasses import replace

import numpy as np
import pytest

from gsl.core.body import Robot, lumped
from gsl.core.dynamics import forward_kinematics, jacobian, mass_matrix
from gsl.core.plant import Plant, Push, nominal
from gsl.robots.nao import nao
from gsl.worlds.chain import COLUMNS, accelerate, chain
from gsl.worlds.engine import Engine, Physics
from gsl.worlds.held import Held, Windows
from gsl.worlds.servo import COMMANDS
from gsl.worlds.start import resting

PERIOD, STEP = 0.02, 0.002
NAO = lumped(nao())


def with_heavy_links(robot: Robot) -> Robot:
    """The robot whose links carry what the rotors had: Bullet needs no compensation for it."""
    links = dict(robot.links)
    for joint in robot.joints:
        link = links[joint.child]
        links[joint.child] = replace(link, inertia=link.inertia + joint.armature * np.outer(joint.axis, joint.axis))
    return replace(robot, links=links, joints=tuple(replace(joint, armature=0.0) for joint in robot.joints))


def sweep(robot: Robot, ticks: int) -> np.ndarray:
    """Targets of all motors, each a sine of its own, shape (T, n)."""
    rng, n = np.random.default_rng(0), len(robot.motors)
    time = PERIOD * np.arange(ticks)
    middle = np.array([0.5 * robot.stance.get(name, 0.0) for name in robot.motors])
    return (
        middle
        + 0.15 * np.sin(2 * np.pi * np.outer(time, rng.uniform(0.3, 1.5, n))) * np.minimum(1, time / 0.5)[:, None]
    )


def window(targets: np.ndarray) -> Windows:
    padded = np.vstack([np.repeat(targets[:1], COMMANDS - 1, axis=0), targets])
    start = np.array([[targets[0], np.zeros(targets.shape[1])]])
    return Windows(np.ascontiguousarray(padded[::-1])[None], start, np.zeros(1))


def in_bullet(plant: Plant, targets: np.ndarray, step: float) -> np.ndarray:
    engine = Engine(plant, Physics(step, 50, PERIOD, floating=False))
    start = resting(lumped(plant.robot), targets[0], targets[0], floating=False)
    engine.load(start.reading, start.commands)
    seen = []
    for target in targets:
        engine.run(target)
        seen.append(engine.encoders(engine.read())[0])
    engine.close()
    return np.array(seen)


@pytest.mark.parametrize(
    "fields", [{}, {"coulomb": 0.1}, {"delay": 0.013}, {"load_friction": 0.1}, {"smoothing": 0.02}]
)
def test_it_is_pinned_to_bullet(fields: dict[str, float]) -> None:
    robot = with_heavy_links(NAO)
    plant = nominal(robot).with_servo(**{name: np.full(len(robot.motors), value) for name, value in fields.items()})
    targets = sweep(robot, 150)
    fine = 0.5 * STEP  # at 2 ms rotors that links carry make the nominal damping chatter
    difference = Held.of(plant, fine, PERIOD).replay(window(targets))[0] - in_bullet(plant, targets, fine)
    assert np.sqrt(np.mean(difference**2)) < 1e-6 and np.abs(difference).max() < 1e-5


def test_rotors_in_bullet_are_an_approximation_that_gets_better_with_the_step() -> None:
    plant, targets = nominal(NAO), sweep(NAO, 100)
    rms = [
        np.sqrt(
            np.mean((Held.of(plant, step, PERIOD).replay(window(targets))[0] - in_bullet(plant, targets, step)) ** 2)
        )
        for step in (0.002, 0.001, 0.0005)
    ]
    assert rms[0] < 5e-5 and rms[1] < 0.6 * rms[0] and rms[2] < 0.6 * rms[1]


def accelerations(plant: Plant, motion: np.ndarray, torque: np.ndarray, pushed: np.ndarray) -> np.ndarray:
    n, result = len(torque), torque.copy()
    accelerate(chain(plant, plant.servo.armature), motion, pushed, result, np.zeros((n, COLUMNS)), np.zeros((n, n)))
    return result


def test_torques_move_it_as_the_mass_matrix_says() -> None:
    rng, n, plant = np.random.default_rng(1), len(NAO.motors), nominal(NAO)
    motion = np.array([rng.uniform(-0.5, 0.5, n), rng.uniform(-2.0, 2.0, n)])
    torque, nothing = rng.uniform(-1.0, 1.0, n), np.zeros((n, 3))
    change = accelerations(plant, motion, torque, nothing) - accelerations(plant, motion, np.zeros(n), nothing)
    inertia = mass_matrix(NAO, dict(zip(NAO.motors, motion[0], strict=True)))[6:, 6:] + np.diag(plant.servo.armature)
    np.testing.assert_allclose(change, np.linalg.solve(inertia, torque), rtol=1e-9)


def test_a_push_acts_by_its_jacobian() -> None:
    rng, n, plant = np.random.default_rng(2), len(NAO.motors), nominal(NAO)
    angles, force = rng.uniform(-0.5, 0.5, n), np.array([3.0, -2.0, 1.0])
    motion, pushed = np.array([angles, np.zeros(n)]), np.zeros((n, 3))
    pushed[NAO.motors.index("LKneePitch")] = force
    named = dict(zip(NAO.motors, angles, strict=True))
    link = NAO.joint("LKneePitch").child
    linear = jacobian(NAO, forward_kinematics(NAO, named), link, NAO.links[link].com)[1][:, 6:]
    change = accelerations(plant, motion, np.zeros(n), pushed) - accelerations(plant, motion, np.zeros(n), 0.0 * pushed)
    by_torque = accelerations(plant, motion, linear.T @ force, 0.0 * pushed) - accelerations(
        plant, motion, np.zeros(n), 0.0 * pushed
    )
    np.testing.assert_allclose(change, by_torque, rtol=1e-9, atol=1e-12)


def test_a_push_ends() -> None:
    still = np.repeat(sweep(NAO, 1), 60, axis=0)
    pushed = replace(nominal(NAO), pushes=(Push("LFoot", np.array([5.0, 0.0, 0.0]), 0.2, 0.4),))
    path = (
        Held.of(pushed, STEP, PERIOD).replay(window(still))[0]
        - Held.of(nominal(NAO), STEP, PERIOD).replay(window(still))[0]
    )
    size = np.abs(path).max(axis=1)
    assert size[:10].max() == 0.0 and size[10:20].max() > 1e-3 and size[-1] < 0.02 * size.max()


def test_windows_do_not_know_of_each_other() -> None:
    targets, held = sweep(NAO, 60), Held.of(nominal(NAO), STEP, PERIOD)
    one, other = window(targets[:30]), window(targets[30:])
    both = Windows(*(np.concatenate(pair) for pair in zip(one, other, strict=True)))
    np.testing.assert_array_equal(held.replay(both), np.concatenate([held.replay(one), held.replay(other)]))


def test_what_diverges_is_not_a_number() -> None:
    n = len(NAO.motors)
    wild = nominal(NAO).with_servo(kd=np.full(n, 1e3), limit=np.full(n, np.inf), no_load_speed=np.full(n, np.inf))
    assert np.isnan(Held.of(wild, STEP, PERIOD).replay(window(sweep(NAO, 50)))).any()
