"""Excitations keep the limits of any robot and are functions of their names; collect plays them."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import followed, held
from commands import done, gsl

from gsl.core.body import Joint, Link, Robot, Shape, lump
from gsl.core.dynamics import forward_kinematics
from gsl.core.layout import Layout
from gsl.policies.excitation import MENU, VARIANTS, Excitation
from gsl.policies.limits import MARGIN, breach, limits
from gsl.policies.sides import inwards, pairs
from gsl.robots.nao import nao
from gsl.storage.trajectories import read

pytestmark = pytest.mark.slow

PERIOD = 0.02
SMALL = ("collect", "task=excite", "workers=1", "name=x", "policy.motions=[triangle_slow]", "task.duration=1.5")
ALL = [(motion, variant) for motion in MENU for variant in VARIANTS]
LARGE_STEPS = "steps_large"


def pendulum() -> Robot:
    """Two links below a heavy base, hinges about y, with other ranges, speeds and gains than the NAO's."""
    y, down = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -0.3])
    inertia = 1e-3 * np.eye(3)
    links = [Link(name, mass, 0.5 * down, inertia) for name, mass in (("base", 5.0), ("upper", 0.7), ("lower", 0.4))]
    joints = (
        Joint("hip", "base", "upper", np.zeros(3), y, -2.9, 0.4, 1.5, 20.0, 0.05),
        Joint("knee", "upper", "lower", down, y, 0.0, 0.6, 12.0, 0.5, 0.01),
    )
    gains = {"hip": (20.0, 1.0), "knee": (60.0, 0.5)}
    return Robot("pendulum", {link.name: link for link in links}, joints, ("hip", "knee"), gains=gains)


ROBOTS: dict[str, Callable[[], Robot]] = {"nao": nao, f"{__name__}.pendulum": pendulum}


def played(motion: Any, variant: Any, robot: str = "nao", **settings: Any) -> np.ndarray:
    return Excitation(robot=robot, **settings).commands(motion, variant, PERIOD)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("amplitude", [1.0, 0.3])
@pytest.mark.parametrize("duration", [1.5, 3.5, 9.0])
@pytest.mark.parametrize(("motion", "variant"), ALL)
def test_every_motion_keeps_the_limits(
    robot: str, motion: str, variant: str, amplitude: float, duration: float
) -> None:
    bounds, body = limits(ROBOTS[robot]()), ROBOTS[robot]()
    targets = played(motion, variant, robot, amplitude=amplitude, duration=duration)
    joints = [body.joint(name) for name in body.controlled]
    lower, upper, fastest = np.array([(joint.lower, joint.upper, joint.max_velocity) for joint in joints]).T
    assert targets.shape == (round(duration / PERIOD), len(joints))
    assert (targets >= lower + MARGIN - 1e-12).all() and (targets <= upper - MARGIN + 1e-12).all()
    assert breach(bounds, targets, PERIOD) is None
    if not motion.startswith("steps"):
        assert (np.abs(np.diff(targets, axis=0)) <= 0.5 * fastest * PERIOD + 1e-12).all()


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(("motion", "variant"), ALL)
def test_every_motion_begins_and_ends_at_rest(robot: str, motion: str, variant: str) -> None:
    targets, rest = played(motion, variant, robot), limits(ROBOTS[robot]()).rest
    still = round(0.2 / PERIOD)
    np.testing.assert_array_equal(targets[: still + 1], np.tile(rest, (still + 1, 1)))
    np.testing.assert_array_equal(targets[-1], rest)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(("motion", "variant"), ALL)
def test_every_joint_moves_in_every_motion_and_in_each_variant_otherwise(robot: str, motion: str, variant: str) -> None:
    targets = played(motion, variant, robot)
    assert (np.ptp(targets, axis=0) > 1e-3).all()
    other = played(motion, VARIANTS[1 - VARIANTS.index(variant)], robot)
    assert (np.abs(targets - other).max(axis=0) > 1e-3).all()


def test_the_same_name_gives_the_same_bytes_and_amplitude_is_a_factor() -> None:
    first, again = (played("chirp", "a").tobytes() for _ in range(2))
    assert first == again
    rest, whole, half = limits(nao()).rest, played("triangle_slow", "b"), played("triangle_slow", "b", amplitude=0.5)
    np.testing.assert_allclose(half - rest, 0.5 * (whole - rest), atol=1e-12)


def test_over_the_programme_no_joint_is_a_copy_of_another() -> None:
    policy, layout = Excitation(robot="nao"), Layout(nao().controlled, {}, PERIOD)
    runs = [policy.start(piece.parameters, layout) for piece in policy.programme]
    targets = np.vstack([[run.act(np.zeros(0)) for _ in range(run.ticks)] for run in runs])
    assert len(targets) * PERIOD == pytest.approx(70.0)
    assert np.abs(np.corrcoef(targets.T) - np.eye(targets.shape[1])).max() < 0.7


def test_the_programme_repeats_what_it_is_told_and_only_that() -> None:
    programme = Excitation(robot="nao", repeats=3).programme
    by_label = {
        piece.label: [other.parameters for other in programme if other.label == piece.label] for piece in programme
    }
    assert {label: len(parameters) for label, parameters in by_label.items()} == {
        f"{motion}_{variant}": 3 if motion in ("steps_large", "triangle_medium") and variant == "a" else 1
        for motion, variant in ALL
    }
    assert all((parameter == parameters[0]).all() for parameters in by_label.values() for parameter in parameters)


@pytest.mark.parametrize("variant", VARIANTS)
def test_only_large_steps_ask_for_more_than_the_torque_limit(variant: str) -> None:
    body = nao()
    full = np.array([body.joint(name).effort / body.gains[name][0] for name in body.controlled])
    small, large = (np.abs(np.diff(played(name, variant), axis=0)) / full for name in ("steps_small", LARGE_STEPS))
    assert small.max() <= 0.6 + 1e-9
    assert (large.max(axis=0) > 1.0).all()
    for jumps in (small, large):
        sizes = [np.unique(np.round(column[column > 0.0], 9)) for column in jumps.T]
        assert min(map(len, sizes)) >= 3
        pauses = [np.diff(np.flatnonzero(column)) * PERIOD for column in jumps.T]
        assert min(map(np.min, pauses)) >= 0.4 - 1e-9


@pytest.mark.parametrize("variant", VARIANTS)
def test_one_by_one_moves_one_joint_at_a_time(variant: str) -> None:
    away = played("one_by_one", variant) != limits(nao()).rest
    assert away.sum(axis=1).max() == 1


@pytest.mark.parametrize("variant", VARIANTS)
def test_mirrored_is_a_mirror_image_and_then_its_opposite(variant: str) -> None:
    way = played("mirrored", variant) - limits(nao()).rest
    names, half = nao().controlled, len(way) // 2
    left, right = names.index("LShoulderRoll"), names.index("RShoulderRoll")
    np.testing.assert_allclose(way[:half, right], -way[:half, left], atol=1e-12)
    later = way[half + 5 :]
    assert (np.sign(later[:, right]) == np.sign(later[:, left])).all()


def test_sides_are_read_off_the_geometry() -> None:
    names = nao().controlled
    signs_seen = {(names[left], names[right]): sign for left, right, sign in pairs(nao())}
    signs = {"HipRoll": -1, "HipPitch": 1, "KneePitch": 1, "AnklePitch": 1, "AnkleRoll": -1}
    signs |= {"ShoulderPitch": 1, "ShoulderRoll": -1}
    assert signs_seen == {(f"L{joint}", f"R{joint}"): sign for joint, sign in signs.items()}
    inner = dict(zip(names, inwards(nao(), {}), strict=True))
    assert (inner["LHipRoll"], inner["RHipRoll"], inner["LKneePitch"]) == (-1.0, 1.0, 0.0)
    assert pairs(pendulum()) == () and not inwards(pendulum(), {}).any()


@pytest.mark.parametrize(("motion", "variant"), ALL)
def test_each_leg_stays_on_its_own_side(motion: str, variant: str) -> None:
    body = lump(nao())
    for targets in played(motion, variant)[::5]:
        angles = dict(zip(body.motors, targets[body.drive].tolist(), strict=True))
        frames = forward_kinematics(body, angles)
        for side, foot, sign in (("left", "LFoot", 1.0), ("right", "RFoot", -1.0)):
            corners = [_corners(shape) for shape in body.links[foot].shapes if shape.collides]
            places = frames.origin[foot] + np.vstack(corners) @ frames.turn[foot].T
            assert (sign * places[:, 1]).min() > 0.005, side


def _corners(shape: Shape) -> np.ndarray:
    return np.array(shape.centre) + 0.5 * np.array(shape.size) * np.array(list(itertools.product((-1, 1), repeat=3)))


@pytest.mark.parametrize("motion", ["triangle_fast", "chirp", "poses", "mirrored", "one_by_one"])
def test_a_good_servo_follows(motion: str) -> None:
    world, targets, body = held(), played(motion, "a"), nao()
    seen = followed(world.make(), targets)[1:]
    positions, speeds = seen[:, world.layout["position"]], seen[:, world.layout["velocity"]]
    fastest = np.array([body.joint(name).max_velocity for name in body.controlled])
    assert np.sqrt(np.mean((positions - targets) ** 2)) < 0.025
    assert (np.abs(speeds) < fastest).all()
    assert limits(body).lower.shape == positions.shape[1:]
    assert (positions > limits(body).lower + MARGIN).all() and (positions < limits(body).upper - MARGIN).all()


def test_collect_plays_the_programme_and_says_which_episode_is_which(tmp_path: Path) -> None:
    done(*SMALL, "role=sim", folder=tmp_path)
    batch = read(tmp_path / "runs/x/collect_sim/trajectories.parquet", joints=nao().controlled)
    assert [(episode["policy"], episode["motion"], episode["variant"]) for episode in batch.metadata["episodes"]] == [
        ("triangle_slow_a", "triangle_slow", "a"),
        ("triangle_slow_b", "triangle_slow", "b"),
    ]
    for variant, episode in zip(VARIANTS, batch.episodes, strict=True):
        np.testing.assert_array_equal(episode.action, played("triangle_slow", variant, duration=1.5))
        assert episode.grounded_action is None and np.ptp(episode.sensors["base.position.z"]) == 0.0
    metrics = json.loads((tmp_path / "runs/x/collect_sim/metrics.json").read_text())
    assert (metrics["episodes"], metrics["seconds"], metrics["value"]) == (2, 3.0, None)
    assert "2 episodes, no falls" in done("runs", folder=tmp_path).out


def test_repeats_are_the_same_commands_from_another_start(tmp_path: Path) -> None:
    more = ("policy.variants=[a]", "policy.repeated=[triangle_slow]", "policy.repeats=2")
    done(*SMALL, *more, folder=tmp_path)
    first, again = read(tmp_path / "runs/x/collect_real/trajectories.parquet").episodes
    np.testing.assert_array_equal(first.action, again.action)
    assert not np.array_equal(first.position, again.position)


@pytest.mark.parametrize("role", ["real", "sim"])
def test_the_task_chooses_policy_and_air_but_the_user_has_the_last_word(role: str, tmp_path: Path) -> None:
    def composed(*more: str) -> Any:
        return json.loads(done("collect", "--cfg", "job", "--json", "task=excite", *more, folder=tmp_path).out)

    plain = composed(f"role={role}")
    assert plain["policy"]["_target_"].endswith("Excitation") and plain["policy"]["duration"] == 3.5
    assert (plain["world"]["floating"], plain["action_noise"]) == (False, 0.0)
    other = composed("policy=walk_engine", "world=nao_weak", "world.floating=true", "action_noise=0.01")
    assert other["policy"]["_target_"].endswith("WalkEngine") and "torque_limit" in other["world"]["effects"]
    assert (other["world"]["floating"], other["action_noise"]) == (True, 0.01)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("policy.motions=[jump]", "policy.motions.0 = jump: must be one of 'steps_small'"),
        ("policy.variants=[]", "policy.variants = "),
        ("policy.amplitude=2", "policy.amplitude = 2: must be at most 1"),
        ("policy.duration=1", "policy.duration = 1: must be at least 1.5 (s)"),
        ("policy.robot=pepper", "policy.robot: no robot called 'pepper'; there is go2, nao, pendulum"),
        (f"policy.robot={__name__}.pendulum", f"policy.robot = {__name__}.pendulum: has other joints than the world's"),
    ],
)
def test_what_cannot_be_played_is_one_clear_line(tmp_path: Path, arguments: str, line: str) -> None:
    said = gsl("collect", "task=excite", "workers=1", *arguments.split(), folder=tmp_path)
    assert said.code == 2 and len(said.lines) == 1, said
    assert said.lines[0].startswith(f"gsl collect: {line}"), said.lines


@pytest.mark.parametrize("command", ["evaluate", "optimize", "iterate", "survey"])
def test_only_collect_excites(tmp_path: Path, command: str) -> None:
    said = gsl(command, "task=excite", folder=tmp_path)
    assert said.lines == [f"gsl {command}: task = excite: is not for gsl {command}, which cannot take its policy"]
