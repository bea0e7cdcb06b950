"""URDFs that people published: each is read as it was meant, or refused with the setting that helps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from both_engines import PERIOD, in_bullet, window
from commands import done, gsl, refused
from robots_of_files import as_bullet_reads, holding

from gsl.core.body import Robot, lump
from gsl.core.dynamics import forward_kinematics
from gsl.core.plant import nominal
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.log.files import check_log
from gsl.errors import InputError
from gsl.policies.limits import limits
from gsl.robots.catalogue import robot
from gsl.robots.urdf import urdf
from gsl.storage.trajectories import read
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.held import Held

SHORT = ("task=excite", "task.duration=1.6", "policy.repeats=1", "policy.motions=[steps_large]", "workers=1")
BODY = (
    "<inertial><origin xyz='0 0 0.05'/><mass value='0.5'/>"
    "<inertia ixx='0.001' iyy='0.001' izz='0.001' ixy='0' ixz='0' iyz='0'/></inertial>"
)
LIMIT = "<limit lower='-1' upper='1' effort='3' velocity='5'/>"
SOFT = "<safety_controller k_position='10' k_velocity='10' soft_lower_limit='{}' soft_upper_limit='{}'/>"


def joint(name: str, child: str, inside: str, *, parent: str = "base", kind: str = "revolute") -> str:
    ends = f"<parent link='{parent}'/><child link='{child}'/><origin xyz='0 0 0.1'/><axis xyz='0 1 0'/>"
    return f"<link name='{child}'>{BODY}</link><joint name='{name}' type='{kind}'>{ends}{inside}</joint>"


def written(folder: Path, *joints: str, head: str = "<robot name='r'>") -> str:
    text = f"<?xml version='1.0'?>\n{head}<link name='base'>{BODY}</link>{''.join(joints)}</robot>"
    (folder / "it.urdf").write_text(text)
    return str(folder / "it.urdf")


def of(folder: Path, *joints: str, head: str = "<robot name='r'>") -> Robot:
    return robot(written(folder, *joints, head=head))


@pytest.mark.parametrize(
    "head", ["<robot xmlns='http://www.ros.org' name='r'>", "<r:robot xmlns:r='http://www.ros.org' name='r'>"]
)
def test_a_namespace_changes_nothing(head: str, tmp_path: Path) -> None:
    plain = of(tmp_path, joint("j1", "a", LIMIT))
    file = Path(written(tmp_path, joint("j1", "a", LIMIT), head=head))
    if head.startswith("<r:"):
        file.write_text(file.read_text().replace("</robot>", "</r:robot>"))
    assert urdf(robot(str(file))) == urdf(plain)


def test_elements_of_another_namespace_are_none_of_the_robots(tmp_path: Path) -> None:
    more = "<link xmlns='http://gazebosim.org' name='sensor'/>"
    assert [*of(tmp_path, joint("j1", "a", LIMIT), more).links] == ["base", "a"]


def test_an_expression_that_xacro_has_left_is_named(tmp_path: Path) -> None:
    file = written(tmp_path, joint("${prefix}j1", "a", LIMIT))
    line = f"{file}: holds an expression of xacro that was not replaced, ${{prefix}}j1; expand it first: xacro it.urdf"
    assert refused("robot", file, folder=tmp_path).startswith(line)
    mesh = "<visual><geometry><mesh filename='$(find arm)/base.stl'/></geometry></visual>"
    assert of(tmp_path, joint("j1", "a", LIMIT).replace(BODY, mesh + BODY)).controlled == ("j1",)


MIMIC = "<mimic joint='{}' multiplier='{}' offset='{}'/>"


def test_a_follower_without_limits_has_those_of_its_leader(tmp_path: Path) -> None:
    body = of(tmp_path, joint("j1", "a", LIMIT), joint("j2", "b", MIMIC.format("j1", 1, 0)))
    assert (body.controlled, dict(body.coupled)) == (("j1",), {"j2": "j1"})
    first, second = body.joint("j1"), body.joint("j2")
    assert (second.lower, second.upper, second.effort, second.max_velocity) == (
        -1.0,
        1.0,
        first.effort,
        first.max_velocity,
    )
    assert body.remarks == ("joint j2 follows j1 and takes over its range, effort, velocity",)


def test_a_follower_keeps_the_limits_that_it_has(tmp_path: Path) -> None:
    own = "<limit lower='-0.5' upper='2' effort='0' velocity='7'/>"
    body = of(tmp_path, joint("j1", "a", LIMIT), joint("j2", "b", own + MIMIC.format("j1", -1, 0.5)))
    other = body.joint("j2")
    assert (other.lower, other.upper, other.effort, other.max_velocity) == (-1.5, 1.0, 3.0, 7.0)
    np.testing.assert_allclose([limits(body).lower, limits(body).upper], [[-1.0], [1.0]])
    assert body.remarks == ("joint j2 follows j1 and takes over its effort",)


def test_a_follower_of_a_follower_turns_as_bullet_turns_it(tmp_path: Path) -> None:
    chain = (
        joint("j1", "a", LIMIT),
        joint("j2", "b", LIMIT + MIMIC.format("j1", -2, 0.2), parent="a"),
        joint("j3", "c", LIMIT + MIMIC.format("j2", 0.5, -0.3), parent="base"),
    )
    file = written(tmp_path, *chain)
    body = robot(file)
    assert dict(body.coupled) == {"j3": "j1"}  # j2 goes twice as far, which no servo of ours does
    at = 0.4
    frames = forward_kinematics(lump(body), {"j1": at, "j3": at})
    angle = 0.5 * (-2.0 * at + 0.2) - 0.3
    expected = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    com = lump(body).links["c"].com
    np.testing.assert_allclose(frames.turn["c"] @ com, expected @ [0.0, 0.0, 0.05], atol=1e-12)
    place = -2.0 * 0.0 + 0.2  # where it follows to while its leader is at 0
    assert f"joint j2 is held at {place:g} rad (follows j1 by a factor of -2; only 1 and -1 can be driven)" in (
        body.remarks
    )
    with as_bullet_reads(Path(file)) as bullets:
        theirs = bullets.holding({"j1": at, "j2": place, "j3": angle})
    ours = dict(zip(body.motors, holding(body, {"j1": at, "j3": at}), strict=True))
    assert ours["j3"] == pytest.approx(-theirs["j3"], abs=1e-9) and ours["j1"] == pytest.approx(theirs["j1"], abs=1e-6)


def test_a_follower_of_a_held_joint_stands_where_that_one_puts_it(tmp_path: Path) -> None:
    more = (joint("j2", "b", MIMIC.format("j1", 0.5, 0.1)), joint("j3", "c", LIMIT))
    written(tmp_path, joint("j1", "a", LIMIT), *more)
    (tmp_path / "it.yaml").write_text("urdf: it.urdf\njoints: {j3: }\nheld: {j1: 0.6}\n")
    assert any(line.startswith("joint j2 is held at 0.4 rad") for line in robot(str(tmp_path / "it.yaml")).remarks)


def test_followers_in_a_circle_and_of_nobody_are_told(tmp_path: Path) -> None:
    circle = (joint("j1", "a", MIMIC.format("j2", 1, 0)), joint("j2", "b", MIMIC.format("j1", 1, 0)))
    line = "joints.j1: follows itself (<mimic>); one of these joints has to lead"
    assert refused("robot", written(tmp_path, *circle, joint("j3", "c", LIMIT)), folder=tmp_path).endswith(line)
    body = of(tmp_path, joint("j1", "a", LIMIT), joint("j2", "b", MIMIC.format("j9", 1, 0)))
    assert body.remarks == ("joint j2 is held at 0 rad (follows j9, which does not exist)",)


def test_commands_keep_soft_limits_and_the_body_can_go_beyond(tmp_path: Path) -> None:
    file = written(tmp_path, joint("j1", "a", LIMIT + SOFT.format(-0.3, 0.3)))
    body = robot(file)
    assert (body.joint("j1").lower, body.joint("j1").upper) == (-1.0, 1.0)
    assert "keep the soft limits of its <safety_controller>: -0.3 and 0.3 rad" in body.remarks[0]
    done("collect", "world=urdf", f"world.robot={file}", *SHORT, "name=x", folder=tmp_path)
    asked = [episode.action for episode in read(tmp_path / "runs/x/collect_real/trajectories.parquet").episodes]
    assert 0.2 < np.abs(np.concatenate(asked)).max() <= 0.3 + 1e-12
    (tmp_path / "back.urdf").write_text(urdf(body))
    assert robot(str(tmp_path / "back.urdf")).soft == body.soft
    space = BulletWorld(robot=file, effects={}, floating=False).make().action_space
    np.testing.assert_allclose([space.low, space.high], [[-0.3], [0.3]])


@pytest.mark.parametrize(
    ("soft", "kept"),
    [((-9, 0.3), (-1.0, 0.3)), ((0, 0.3), (0.0, 0.3)), ((0, 0), (-1.0, 1.0)), ((-0.2, 9), (-0.2, 1.0))],
)
def test_the_narrower_of_hard_and_soft_limits_counts(
    soft: tuple[float, float], kept: tuple[float, float], tmp_path: Path
) -> None:
    body = of(tmp_path, joint("j1", "a", LIMIT + SOFT.format(*soft)))
    assert body.bound_commands("j1") == kept and body.remarks


def test_soft_limits_of_a_follower_are_those_of_its_leader_turned_round(tmp_path: Path) -> None:
    follower = joint("j2", "b", LIMIT + MIMIC.format("j1", -1, 0.1) + SOFT.format(-0.2, 0.5))
    body = of(tmp_path, joint("j1", "a", LIMIT), follower)
    np.testing.assert_allclose(body.bound_commands("j2"), [-0.4, 0.3])
    np.testing.assert_allclose([limits(body).lower[0], limits(body).upper[0]], [-0.4, 0.3])


@pytest.mark.parametrize("soft", [(1.5, 2), (0.3, -0.3)])
def test_soft_limits_that_leave_nothing_are_refused(soft: tuple[float, float], tmp_path: Path) -> None:
    file = written(tmp_path, joint("j1", "a", LIMIT + SOFT.format(*soft)))
    line = "joints.j1: its soft limits {:g} and {:g} rad leave no range; mend its <safety_controller>".format(*soft)
    assert refused("robot", file, folder=tmp_path).endswith(line)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("effort='3'", "effort='1e9'", "has effort 1e+09, a placeholder; write its motor's peak torque [N·m] in <lim"),
        ("velocity='5'", "velocity='1e9'", "has velocity 1e+09, a placeholder; write its motor's speed without load"),
        ("effort='3'", "effort='1.79e308'", "has effort 1.79e+308, a placeholder; write its motor's peak torque [N"),
        ("lower='-1'", "lower='-1e9'", "its limits are -1e+09 and 1 rad, a placeholder; write lower and upper [rad]"),
        ("lower='-1' upper='1'", "", "has no range; write lower and upper [rad] in <limit>, or in a robot file (gsl"),
    ],
)
def test_limits_that_stand_for_none_are_placeholders(old: str, new: str, problem: str, tmp_path: Path) -> None:
    file = written(tmp_path, joint("j1", "a", LIMIT.replace(old, new)))
    words = ("collect", "world=urdf", f"world.robot={file}", "task=excite", "name=x")
    assert f"joints.j1: {problem}" in refused(*words, folder=tmp_path)


@pytest.mark.parametrize(("said", "lower", "upper"), [("upper='1'", 0.0, 1.0), ("lower='-1'", -1.0, 0.0)])
def test_an_end_of_a_range_that_is_left_out_is_0_as_in_the_format(
    said: str, lower: float, upper: float, tmp_path: Path
) -> None:
    own = of(tmp_path, joint("j1", "a", LIMIT.replace("lower='-1' upper='1'", said)))
    assert [(j.lower, j.upper) for j in own.joints if j.name == "j1"] == [(lower, upper)]


def test_a_robot_file_says_both_ends_of_a_range(tmp_path: Path) -> None:
    file = written(tmp_path, joint("j1", "a", LIMIT.replace("lower='-1' upper='1'", "")))
    said = refused("init", f"urdf={file}", "name=one", "lower=-1", folder=tmp_path)
    assert "joints.j1: has no upper; write lower and upper [rad] in <limit>" in said


def test_a_continuous_joint_needs_no_range_and_believes_no_placeholder(tmp_path: Path) -> None:
    for ends in ("", "lower='0' upper='0'", "lower='-1e16' upper='1e16'"):
        body = of(tmp_path, joint("j1", "a", LIMIT.replace("lower='-1' upper='1'", ends), kind="continuous"))
        np.testing.assert_allclose(body.bound_commands("j1"), [-2.0 * np.pi, 2.0 * np.pi])


def test_a_continuous_joint_turns_on_and_on_and_only_its_commands_have_ends(tmp_path: Path) -> None:
    wheel = joint("j1", "a", LIMIT, kind="continuous").replace("<axis xyz='0 1 0'/>", "<axis xyz='0 0 1'/>")
    follower = joint("j2", "b", LIMIT + "<mimic joint='j1' offset='0.5'/>", parent="a", kind="continuous")
    body = of(tmp_path, wheel, follower)
    assert body.bound_commands("j1") == (-1.0, 1.0)
    (tmp_path / "back.urdf").write_text(urdf(body))
    back = robot(str(tmp_path / "back.urdf"))
    targets = 4.0 * PERIOD * np.arange(500)[:, None] * [1.0, 1.0]
    driven = replace(lump(back), joints=tuple(replace(joint, armature=0.0) for joint in lump(back).joints))
    plant = nominal(driven)
    ours, theirs = Held.of(plant, 1e-3, PERIOD).replay(window(targets))[0], in_bullet(plant, targets, 1e-3)
    assert ours[:, 0].max() > 39.0 and np.abs(ours - theirs).max() < 1e-4
    rows = np.pad(targets, ((0, 1), (0, 0)), mode="edge")
    time = PERIOD * np.arange(len(rows))
    log = Trajectory(time, targets[:, :1], rows[:, :1], np.gradient(rows[:, :1], time, axis=0))
    check_log(Batch((log,), ("j1",), PERIOD, {}), lump(body), "a log of it")


def test_a_placeholder_in_a_robot_file_is_one_as_well(tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text("joints: {a: {effort: 1e9, velocity: 5}}\n")
    assert "joints.a: has effort 1e+09, a placeholder" in refused("robot", "arm.yaml", folder=tmp_path)


def test_a_missing_range_can_be_told_to_init(tmp_path: Path) -> None:
    file = written(tmp_path, joint("j1", "a", LIMIT.replace("lower='-1' upper='1'", "")))
    done("init", f"urdf={file}", "name=arm", "lower=-0.7", "upper=0.9", folder=tmp_path)
    said = gsl("collect", "--config-dir", "arm", "world=arm", *SHORT, "name=x", folder=tmp_path)
    assert said.code == 0, said.err
    assert robot(str(tmp_path / "arm/robot.yaml")).bound_commands("j1") == (-0.7, 0.9)


def test_friction_of_a_file_becomes_effects_of_the_world_that_init_writes(tmp_path: Path) -> None:
    drag = "<dynamics damping='0.1' friction='0.2'/>"
    file = written(tmp_path, joint("j1", "a", LIMIT + drag), joint("j2", "b", LIMIT + drag, parent="a"))
    done("init", f"urdf={file}", "name=arm", folder=tmp_path)
    done("collect", "--config-dir", "arm", "world=arm", *SHORT, "name=x", folder=tmp_path)
    config = yaml.safe_load((tmp_path / "runs/x/collect_real/config.yaml").read_text())
    assert config["world"]["effects"] == {
        "viscous_friction": [{"coefficient": 0.1, "joints": ["j1", "j2"]}],
        "coulomb_friction": [{"torque": 0.2, "joints": ["j1", "j2"]}],
    }


def test_a_floating_joint_is_a_base_that_is_held(tmp_path: Path) -> None:
    free = joint("free", "trunk", "", parent="base", kind="floating")
    body = of(tmp_path, free, joint("j1", "a", LIMIT, parent="trunk"))
    rigid = of(tmp_path, free.replace("floating", "fixed"), joint("j1", "a", LIMIT, parent="trunk"))
    assert body.controlled == ("j1",) and lump(body).links.keys() == lump(rigid).links.keys()
    assert any("free is rigid here (floating): the base of a robot without feet is held" in it for it in body.remarks)


TWICE = {
    "limit": LIMIT,
    "safety_controller": 2 * SOFT.format(-0.3, 0.3),
    "axis": "<axis xyz='0 0 1'/>",
    "dynamics": 2 * "<dynamics damping='1'/>",
    "origin": "<origin xyz='0 0 1'/>",
    "parent": "<parent link='base'/>",
}


@pytest.mark.parametrize("tag", TWICE)
def test_an_element_that_comes_twice_is_refused(tag: str, tmp_path: Path) -> None:
    file = written(tmp_path, joint("j1", "a", LIMIT + TWICE[tag]))
    with pytest.raises(InputError, match=f"joint 'j1': has 2 <{tag}> where one counts; keep one"):
        robot(file)


@pytest.mark.parametrize("tag", ["mass", "inertia"])
def test_a_mass_that_is_said_twice_is_refused(tag: str, tmp_path: Path) -> None:
    path = Path(written(tmp_path, joint("j1", "a", LIMIT)))
    path.write_text(path.read_text().replace(f"<{tag} ", f"<{tag} value='1'/><{tag} ", 1))
    with pytest.raises(InputError, match=f"has 2 <{tag}> where one counts; keep one"):
        robot(str(path))
