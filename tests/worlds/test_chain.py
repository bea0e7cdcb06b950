"""The chain model against Bullet, against sums of textbook Jacobians, and against itself in pieces."""

from dataclasses import replace

import numpy as np
import pytest
from both_engines import PERIOD, in_bullet, window
from learned_servos import EVERYTHING, lawful, some_law, with_fields

from gsl.core.body import Robot, lump
from gsl.core.dynamics import forward_kinematics, jacobian, mass_matrix
from gsl.core.lanes import LANES
from gsl.core.plant import Plant, Push, nominal
from gsl.robots.nao import nao
from gsl.worlds.chain import COLUMNS, Pushed, accelerate, chain, nothing
from gsl.worlds.held import Held, Windows
from gsl.worlds.servo import encoder_motion, servo_torque
from gsl.worlds.servo_state import COMMANDS, first_state

STEP = 0.002
NAO = lump(nao())


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


def test_a_learned_law_acts_as_in_bullet() -> None:
    plant, fine = nominal(with_heavy_links(NAO)), 0.5 * STEP
    plant, targets = lawful(plant, some_law(plant)), sweep(NAO, 150)
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


def accelerations(plant: Plant, motion: np.ndarray, torque: np.ndarray, pushed: Pushed) -> np.ndarray:
    n, result = len(torque), torque.copy()
    accelerate(chain(plant, plant.servo.armature), motion, pushed, result, np.zeros((n, COLUMNS)), np.zeros((n, n)))
    return result


def test_torques_move_it_as_the_mass_matrix_says() -> None:
    rng, n, plant = np.random.default_rng(1), len(NAO.motors), nominal(NAO)
    motion = np.array([rng.uniform(-0.5, 0.5, n), rng.uniform(-2.0, 2.0, n)])
    torque, free = rng.uniform(-1.0, 1.0, n), nothing()
    change = accelerations(plant, motion, torque, free) - accelerations(plant, motion, np.zeros(n), free)
    inertia = mass_matrix(NAO, dict(zip(NAO.motors, motion[0], strict=True)))[6:, 6:] + np.diag(plant.servo.armature)
    np.testing.assert_allclose(change, np.linalg.solve(inertia, torque), rtol=1e-9)


def test_pushes_act_by_their_jacobians_and_add_up() -> None:
    rng, n, plant, link = np.random.default_rng(2), len(NAO.motors), nominal(NAO), NAO.joint("LKneePitch").child
    angles, points, forces = rng.uniform(-0.5, 0.5, n), rng.uniform(-0.1, 0.1, (2, 3)), rng.uniform(-3.0, 3.0, (2, 3))
    motion, frames = (
        np.array([angles, np.zeros(n)]),
        forward_kinematics(NAO, dict(zip(NAO.motors, angles, strict=True))),
    )
    torque = sum(jacobian(NAO, frames, link, p)[1][:, 6:].T @ f for p, f in zip(points, forces, strict=True))
    pushed = Pushed(np.repeat(NAO.motors.index("LKneePitch"), 2), points, forces)
    np.testing.assert_allclose(
        accelerations(plant, motion, np.zeros(n), pushed),
        accelerations(plant, motion, torque, nothing()),
        rtol=1e-9,
        atol=1e-12,
    )


def test_a_push_ends() -> None:
    still = np.repeat(sweep(NAO, 1), 60, axis=0)
    pushed = replace(nominal(NAO), pushes=(Push("LFoot", np.array([5.0, 0.0, 0.0]), 0.2, 0.4),))
    path = (
        Held.of(pushed, STEP, PERIOD).replay(window(still))[0]
        - Held.of(nominal(NAO), STEP, PERIOD).replay(window(still))[0]
    )
    size = np.abs(path).max(axis=1)
    assert size[:10].max() == 0.0 and size[10:20].max() > 1e-3 and size[-1] < 0.02 * size.max()


def test_pushes_act_as_in_bullet() -> None:
    """On one link twice, on one that is welded to another, on the base, and not in whole physics steps."""
    robot = with_heavy_links(nao())
    pushes = (
        Push("LFoot", np.array([3.0, 1.0, -2.0]), 0.2013, 0.4),
        Push("LFoot", np.array([0.0, -2.0, 1.0]), 0.3, 0.3507),
        Push("LHand", np.array([1.0, 0.0, 2.0]), 0.1, 0.25),
        Push(robot.base, np.array([9.0, 0.0, 0.0]), 0.1, 0.3),
    )
    plant, fine = replace(nominal(robot), pushes=pushes), 0.5 * STEP
    targets = np.repeat(sweep(robot, 1), 40, axis=0)
    pushed = Held.of(plant, fine, PERIOD).replay(window(targets))[0]
    assert np.abs(pushed - Held.of(nominal(robot), fine, PERIOD).replay(window(targets))[0]).max() > 1e-3
    assert np.abs(pushed - in_bullet(plant, targets, fine)).max() < 1e-5


def test_windows_do_not_know_of_each_other() -> None:
    targets, held = sweep(NAO, 60), Held.of(nominal(NAO), STEP, PERIOD)
    first, second = window(targets[:30]), window(targets[30:])
    both = Windows(*(np.concatenate(pair) for pair in zip(first, second, strict=True)))
    np.testing.assert_array_equal(held.replay(both), np.concatenate([held.replay(first), held.replay(second)]))


def test_what_diverges_is_not_a_number_and_disturbs_no_other_window() -> None:
    n, calm = len(NAO.motors), window(sweep(NAO, 50))
    held = Held.of(nominal(NAO), STEP, PERIOD)
    wild = Windows(calm.commands, np.stack([calm.motion[:, 0], np.full((1, n), 900.0)], axis=1), calm.clock)
    replays = held.replay(Windows(*(np.concatenate(three) for three in zip(calm, wild, calm, strict=True))))
    assert np.isnan(replays[1]).any() and (np.diff(np.isnan(replays[1]).astype(int), axis=0) >= 0).all()
    np.testing.assert_array_equal(replays[[0, 2]], np.repeat(held.replay(calm), 2, axis=0))


@pytest.mark.parametrize("learned", [False, True])
@pytest.mark.parametrize(("count", "beside"), [(1, False), (2 * LANES - 3, False), (LANES + 1, True)])
def test_lanes_have_the_bits_of_one_robot_alone(count: int, beside: bool, learned: bool) -> None:
    """Against the same kernel with floats, with all that a servo can have, a law included."""
    rng, n = np.random.default_rng(3), len(NAO.motors)
    plant = with_fields(NAO, EVERYTHING)
    if learned:
        plant = lawful(plant, some_law(plant))
    many = [window(sweep(NAO, 20) + 0.1 * rng.standard_normal(n)) for _ in range(count)]
    if beside:
        many = [with_beside(log, 0.1 * rng.standard_normal((*log.commands.shape[:2], 2 * n))) for log in many]
    held = Held.of(plant, STEP, PERIOD)
    replays = held.replay(Windows(*(np.concatenate(parts) for parts in zip(*many, strict=True))))
    np.testing.assert_array_equal(replays, [alone(held, windows) for windows in many])


def with_beside(windows: Windows, others: np.ndarray) -> Windows:
    """The window with desired speeds and feed-forward torques beside its targets."""
    return windows._replace(commands=np.concatenate([windows.commands, others], axis=2))


@pytest.mark.parametrize("learned", [False, True])
def test_commands_of_zero_beside_the_targets_change_no_bit(learned: bool) -> None:
    plant, log = with_fields(NAO, EVERYTHING), window(sweep(NAO, 30))
    plant = lawful(plant, some_law(plant)) if learned else plant
    zero = with_beside(log, np.zeros((*log.commands.shape[:2], 2 * len(NAO.motors))))
    for accurate in (False, True):
        held = Held.of(plant, STEP, PERIOD, accurate)
        assert held.replay(zero).tobytes() == held.replay(log).tobytes()
    assert alone(held, zero).tobytes() == alone(held, log).tobytes()


def alone(held: Held, windows: Windows) -> np.ndarray:
    n, motion, positions = len(held.bias), windows.motion[0].copy(), []
    state, encoders, torque = (
        first_state(windows.commands[0, windows.length :], motion, STEP),
        np.empty_like(motion),
        np.empty(n),
    )
    work, matrix, substeps = np.zeros((n, COLUMNS)), np.zeros((n, n)), round(PERIOD / STEP)
    for t in range(windows.length):
        state.commands[:] = windows.commands[0, windows.length - 1 - t :][:COMMANDS]
        for k in range(substeps):
            servo_torque(held.servo, state, motion, k * STEP, STEP, substeps * STEP, torque)
            accelerate(held.tree, motion, nothing(), torque, work, matrix)
            motion[1] += STEP * torque
            motion[0] += STEP * motion[1]
        encoder_motion(held.servo, state, motion, STEP, encoders)
        positions.append(encoders[0].copy())
        state.clock[0] += substeps * STEP
    return np.array(positions)


def test_what_diverges_is_not_a_number() -> None:
    n = len(NAO.motors)
    wild = nominal(NAO).with_servo(kd=np.full(n, 1e3), limit=np.full(n, np.inf), no_load_speed=np.full(n, np.inf))
    assert np.isnan(Held.of(wild, STEP, PERIOD).replay(window(sweep(NAO, 50)))).any()
