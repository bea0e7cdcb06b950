"""The servo kernel against hand calculation, and one joint under it in time."""

import numpy as np
import pytest

from gsl.core.servo import ROW, Servo, numbers
from gsl.worlds.drive_train import TOOTH_STIFFNESS
from gsl.worlds.servo import BRISTLE, servo_torque
from gsl.worlds.servo_state import first_state, pack

STEP, PERIOD = 0.002, 0.02
INERTIA = 0.008  # of the joint's output in these tests [kg·m²]


def servo(**fields: float) -> np.ndarray:
    usual = {"kp": 10.0, "kd": 0.0, "limit": 5.0, "no_load_speed": 8.0, "armature": 0.007}
    return pack(Servo.of(**{name: np.array([value]) for name, value in {**usual, **fields}.items()}), 12.0)


def torque(parameters: np.ndarray, target: float, q: float, v: float, elapsed: float = 0.0) -> float:
    motion, result = np.array([[q], [v]]), np.zeros(1)
    state = first_state(np.array([[target]]), motion, STEP)
    servo_torque(parameters, state, motion, elapsed, STEP, PERIOD, result)
    return float(result[0])


def targets_seen(delay: float, commands: np.ndarray) -> np.ndarray:
    """What a servo with kp = 1 follows at each physics step while `commands` are issued, one a control period."""
    parameters, motion, result, seen = servo(kp=1.0, delay=delay, limit=1e9), np.zeros((2, 1)), np.zeros(1), []
    state = first_state(np.zeros((1, 1)), motion, STEP)
    for command in commands:
        state.commands[1:] = state.commands[:-1].copy()
        state.commands[0] = command
        for k in range(round(PERIOD / STEP)):
            servo_torque(parameters, state, motion, k * STEP, STEP, PERIOD, result)
            seen.append(result[0])
    return np.array(seen)


def test_every_number_stands_in_its_row() -> None:
    values = {name: np.full(2, 2.0 + k) for k, name in enumerate(Servo._fields)}
    rows = pack(Servo.of(**values), 12.0).rows
    for name, value in values.items():
        np.testing.assert_array_equal(rows[getattr(ROW, name)], value)


def test_a_number_that_is_not_set_does_nothing() -> None:
    assert numbers().keys() == set(Servo._fields)
    for name, array in Servo.of(kp=np.ones(3))._asdict().items():
        np.testing.assert_array_equal(array, np.full(3, 1.0 if name == "kp" else numbers()[name].inert))


def test_a_delay_of_whole_control_periods_is_an_exact_shift() -> None:
    commands = np.random.default_rng(0).standard_normal(12)
    direct = targets_seen(0.0, commands)
    np.testing.assert_array_equal(direct, np.repeat(commands, 10))
    for periods in (1, 2, 5):
        late = targets_seen(periods * PERIOD, commands)
        np.testing.assert_allclose(late[10 * periods :], direct[: -10 * periods], atol=1e-12)
        np.testing.assert_allclose(late[: 10 * periods], 0.0, atol=1e-12)


def test_the_delay_is_continuous_and_keeps_the_area_under_the_command() -> None:
    commands = np.r_[1.0, np.zeros(11)]
    delays = np.linspace(0.0, 0.05, 501)
    responses = np.array([targets_seen(delay, commands) for delay in delays])
    np.testing.assert_allclose(responses.sum(axis=1), 10.0, atol=1e-9)
    assert np.abs(np.diff(responses, axis=0)).max() <= (delays[1] - delays[0]) / STEP + 1e-9
    arrival = responses @ np.arange(120) * STEP / 10.0
    np.testing.assert_allclose(arrival - arrival[0], delays, atol=1e-9)


def test_driving_torque_falls_along_the_speed_line_and_braking_torque_does_not() -> None:
    parameters = servo(kp=1e3)
    for speed in (0.0, 2.0, 6.0, 8.0, 12.0):
        driving = 5.0 * max(0.0, 1.0 - speed / 8.0)
        assert torque(parameters, 9.0, 0.0, speed) == pytest.approx(driving)
        assert torque(parameters, -9.0, 0.0, -speed) == pytest.approx(-driving)
        assert torque(parameters, -9.0, 0.0, speed) == -5.0
        assert torque(parameters, 9.0, 0.0, -speed) == 5.0


def test_inside_the_limits_the_law_is_linear() -> None:
    assert torque(servo(kd=0.5, viscous=0.2), 0.3, 0.1, -1.0) == pytest.approx(10.0 * 0.2 + 0.5 + 0.2)


def joint_motion(parameters: np.ndarray, load: np.ndarray, *, target: float = 0.0, start: float = 0.0) -> np.ndarray:
    """Positions and velocities of one joint under `load` [N·m], integrated as Bullet does, shape (T, 2)."""
    motion, result, path = np.array([[start], [0.0]]), np.zeros(1), []
    state = first_state(np.array([[target]]), motion, STEP)
    for k, external in enumerate(load):
        elapsed = (k % 10) * STEP
        servo_torque(parameters, state, motion, elapsed, STEP, PERIOD, result)
        motion[1] += STEP * (result + external) / INERTIA
        motion[0] += STEP * motion[1]
        path.append(motion[:, 0].copy())
    return np.array(path)


def test_dry_friction_holds_below_the_coulomb_torque_without_creep() -> None:
    parameters = servo(kp=0.0, coulomb=0.2, viscous=0.05)
    path = joint_motion(parameters, 0.15 * np.minimum(1.0, np.arange(10_000) / 2_000))
    assert abs(path[-1, 0] - path[5_000, 0]) < 1e-6
    assert path[-1, 0] == pytest.approx(0.15 / 0.2 * BRISTLE, rel=1e-3)


def test_dry_friction_slips_above_the_coulomb_torque() -> None:
    parameters = servo(kp=0.0, coulomb=0.2)
    path = joint_motion(parameters, np.full(100, 0.3))
    np.testing.assert_allclose(np.diff(path[50:, 1]), STEP * 0.1 / INERTIA, rtol=1e-9)


def test_dry_friction_takes_energy_and_never_gives_more_than_its_bristle_holds() -> None:
    load = 0.5 * np.sin(np.arange(5_000) * STEP * 9.0)
    parameters = servo(kp=0.0, coulomb=0.2)
    path = joint_motion(parameters, load)
    work = np.cumsum(load * path[:, 1]) * STEP
    assert (0.5 * INERTIA * path[:, 1] ** 2 <= work + 0.5 * 0.2 * BRISTLE + 2e-3).all()


def test_play_passes_no_torque_inside_the_gap() -> None:
    parameters = servo(kp=0.0, play=0.04)
    path = joint_motion(parameters, np.full(5, 1e-4))
    free = np.cumsum(np.cumsum(np.full(5, 1e-4 / INERTIA)) * STEP) * STEP
    np.testing.assert_allclose(path[:, 0], free, rtol=1e-12)


def test_a_load_that_turns_moves_the_rotor_through_the_play() -> None:
    """The encoder is at the output: the output stays where the gain puts it, the rotor crosses the gap."""
    parameters, gaps, outputs = servo(viscous=0.3, play=0.04), [], []
    for load in (0.3, -0.3):
        motion, result = np.array([[0.0], [0.0]]), np.zeros(1)
        state = first_state(np.zeros((1, 1)), motion, STEP)
        for _ in range(5_000):
            servo_torque(parameters, state, motion, 0.0, STEP, PERIOD, result)
            motion[1] += STEP * (result + load) / INERTIA
            motion[0] += STEP * motion[1]
        gaps.append(state.memory[1, 0] - motion[0, 0])
        outputs.append(motion[0, 0])
    assert gaps[1] - gaps[0] == pytest.approx(0.04 + 2.0 * 0.3 / TOOTH_STIFFNESS, rel=1e-3)
    assert outputs[0] - outputs[1] == pytest.approx(2.0 * 0.3 / 10.0, rel=1e-3)


def test_energy_does_not_grow_in_the_play() -> None:
    """Two masses fly at each other through the gap again and again, with no drive."""
    parameters = servo(kp=0.0, play=0.02)
    motion, result = np.array([[0.0], [0.5]]), np.zeros(1)
    state = first_state(np.zeros((1, 1)), np.zeros((2, 1)), STEP)
    rotor, energies = 0.7 * 0.007, []
    for _ in range(5_000):
        servo_torque(parameters, state, motion, 0.0, STEP, PERIOD, result)
        motion[1] += STEP * result / INERTIA
        motion[0] += STEP * motion[1]
        apart = abs(state.memory[1, 0] - motion[0, 0]) < 0.01
        if apart:
            energies.append(0.5 * (INERTIA * motion[1, 0] ** 2 + rotor * state.memory[2, 0] ** 2))
    assert max(energies) <= energies[0] * 1.02
    assert energies[-1] < 0.9 * energies[0]
