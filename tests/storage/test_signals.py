"""Signals without a simulator: what is wrong is seen with row and joint, what only looks odd is not."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsl.core.trajectory import Trajectory
from gsl.storage.signals.check import check_signals, mend_signals

PERIOD, ROWS = 0.02, 300
JOINTS = ("shoulder", "elbow", "wrist")
TIME = PERIOD * np.arange(ROWS + 1)
Change = Callable[[np.ndarray], np.ndarray]


def log(
    *, position: Change | None = None, action: Change | None = None, velocity: Change | None = None, noise: float = 1e-3
) -> list[Trajectory]:
    """Two episodes of a robot that follows sines late and with the noise of an encoder."""
    made = []
    for seed in (0, 1):
        rng = np.random.default_rng(seed)
        wave = [0.6 * np.sin(2.0 * np.pi * f * TIME + seed) for f in (0.5, 0.8, 1.1)]
        late = [0.6 * np.sin(2.0 * np.pi * f * (TIME - 0.05) + seed) for f in (0.5, 0.8, 1.1)]
        measured = np.column_stack(late) + noise * rng.standard_normal((ROWS + 1, 3))
        speed = np.gradient(measured, TIME, axis=0)
        commands = np.column_stack(wave)[:-1]
        measured = position(measured) if position else measured
        commands = action(commands) if action else commands
        made.append(Trajectory(TIME, commands, measured, velocity(speed) if velocity else speed))
    return made


def kinds(episodes: list[Trajectory]) -> list[tuple[str, tuple[str, ...]]]:
    return [(finding.kind, finding.joints) for finding in check_signals(episodes, JOINTS)]


def column(k: int, change: Change) -> Change:
    def changed(x: np.ndarray) -> np.ndarray:
        x = x.copy()
        x[:, k] = change(x[:, k])
        return x

    return changed


def put(row: int, value: float) -> Change:
    def changed(x: np.ndarray) -> np.ndarray:
        x = x.copy()
        x[row] += value
        return x

    return changed


def frozen(x: np.ndarray) -> np.ndarray:
    return np.r_[x[:100], np.full(len(x) - 100, x[100])]


def stale(x: np.ndarray, rows: int = 2) -> np.ndarray:
    return x[np.arange(len(x)) // rows * rows]


def test_a_log_in_order_has_no_findings() -> None:
    assert kinds(log()) == []
    assert kinds(log(noise=0.0)) == []
    assert kinds(log(position=lambda x: np.round(x / 0.0015) * 0.0015)) == []


def test_an_angle_that_wraps_is_seen_and_joined() -> None:
    episodes = log(position=column(1, lambda x: np.mod(x, 2.0 * np.pi)))
    assert kinds(episodes) == [("wrap", ("elbow",))]
    apart = mend_signals(episodes)[0].position[:, 1] - log()[0].position[:, 1]
    assert np.ptp(apart) < 1e-9


def test_an_encoder_that_wraps_at_its_own_range_is_seen() -> None:
    assert kinds(log(position=column(1, lambda x: np.mod(x, np.deg2rad(300.0))))) == [("wrap", ("elbow",))]


def test_a_command_that_jumps_with_its_position_is_no_wrap() -> None:
    square = np.where(np.sin(2.0 * np.pi * 0.3 * TIME) > 0.0, 1.5, -1.5)
    asked, reached = np.column_stack([square] * 3)[:-1], np.column_stack([np.r_[0.0, square[:-1]]] * 3)
    assert "wrap" not in [kind for kind, _ in kinds([Trajectory(TIME, asked, reached, np.zeros_like(reached))])]


def test_a_sample_that_jumps_and_is_back_is_a_glitch_with_its_row() -> None:
    (finding,) = check_signals(log(position=column(2, put(57, 0.3))), JOINTS)
    assert (finding.kind, finding.joints, finding.row, finding.times) == ("glitch", ("wrist",), 57, 2)
    mended = mend_signals(log(position=column(2, put(57, 0.3))))[0].position[57, 2]
    assert abs(mended - log()[0].position[57, 2]) < 0.02


def test_steps_tops_and_noise_are_no_glitches() -> None:
    step = np.where(TIME > 1.0, 0.8, 0.0) - np.where(np.abs(TIME - 1.04) < 0.011, 0.1, 0.0)
    rough = 0.003 * np.random.default_rng(0).standard_normal(ROWS + 1)
    for extra in (step, rough, np.abs(np.sin(9.0 * TIME))):
        assert kinds(log(position=column(0, lambda x, extra=extra: x + extra), action=None)) in ([], [("velocity", ())])


@pytest.mark.parametrize(("row", "words"), [(0, "this row"), (1, "the next row")])
def test_commands_that_are_positions_are_copies(row: int, words: str) -> None:
    episodes = [
        Trajectory(TIME, episode.position[row : row + ROWS], episode.position, episode.velocity) for episode in log()
    ]
    (finding,) = check_signals(episodes, JOINTS)
    assert (finding.kind, finding.joints) == ("copy", JOINTS)
    assert words in finding.sentence


def test_a_position_that_is_another_joints_is_a_copy_unless_both_are_commanded_alike() -> None:
    def copied(x: np.ndarray) -> np.ndarray:
        return x[:, [0, 1, 1]]

    assert ("copy", ("elbow", "wrist")) in kinds(log(position=copied))
    assert kinds(log(position=copied, action=copied, velocity=copied)) == []


def test_frozen_and_stale_positions_are_seen() -> None:
    (finding,) = check_signals(log(position=column(0, frozen)), JOINTS)
    assert (finding.kind, finding.joints, finding.row) == ("frozen", ("shoulder",), 100)
    for rows, ordinal in ((2, "second"), (3, "third")):
        (finding,) = check_signals(log(position=column(0, partial(stale, rows=rows))), JOINTS)
        assert (finding.kind, finding.joints) == ("stale", ("shoulder",)) and f"every {ordinal} row" in finding.problem


def test_a_joint_at_its_stop_and_one_that_sticks_are_not_frozen() -> None:
    assert kinds(log(position=column(0, lambda x: np.minimum(x, 0.1)), noise=0.0)) == []
    small = column(0, lambda x: 0.05 * x)
    assert (
        kinds(log(action=small, position=column(0, lambda x: np.full_like(x, 0.3)), velocity=column(0, np.zeros_like)))
        == []
    )


def test_a_velocity_of_another_sign_or_joint_is_seen() -> None:
    assert kinds(log(velocity=column(1, np.negative))) == [("velocity", ("elbow",))]
    swapped = kinds(log(velocity=lambda x: x[:, [0, 2, 1]]))
    assert swapped == [("velocity", ("elbow",)), ("velocity", ("wrist",))]


def turning(*, order: str = "xyzw", gyro: str = "body", speed: str = "world") -> list[Trajectory]:
    """A base that turns and moves, by default as the contract wants it."""
    angles = np.column_stack([0.2 * np.sin(2.0 * TIME), 0.3 * np.sin(3.0 * TIME), 1.5 * TIME])
    turns = Rotation.from_euler("xyz", angles)
    rates = np.vstack([(turns[:-1].inv() * turns[1:]).as_rotvec() / PERIOD, np.zeros((1, 3))])
    rates[-1] = rates[-2]
    place = np.column_stack([np.sin(TIME), 0.5 * TIME, 0.3 + 0.0 * TIME])
    moving = np.gradient(place, TIME, axis=0)
    quaternion = turns.as_quat()[:, [0, 1, 2, 3] if order == "xyzw" else [3, 0, 1, 2]]
    cases = {
        "base.orientation": ("xyzw", quaternion),
        "gyro": ("xyz", rates if gyro == "body" else turns.apply(rates)),
        "base.position": ("xyz", place),
        "base.velocity": ("xyz", moving if speed == "world" else turns.inv().apply(moving)),
    }
    sensors = {f"{name}.{axis}": values[:, k] for name, (axes, values) in cases.items() for k, axis in enumerate(axes)}
    episode = log()[0]
    return [Trajectory(TIME, episode.action, episode.position, episode.velocity, sensors=sensors)]


def test_the_order_of_a_quaternion_and_the_axes_of_rates_are_seen() -> None:
    assert kinds(turning()) == []
    for wrong, words in (
        ({"order": "wxyz"}, "w, x, y, z"),
        ({"gyro": "world"}, "gyro.x"),
        ({"speed": "body"}, "base.velocity.x"),
    ):
        (finding,) = check_signals(turning(**wrong), JOINTS)
        assert finding.kind == "base_frame"
        assert words in finding.sentence
