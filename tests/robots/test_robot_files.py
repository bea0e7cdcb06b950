"""A robot from a file is the robot of the file: against Bullet, against ours read back, and in every error."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commands import done
from robots_of_files import as_bullet_reads, holding

from gsl.core.body import Robot, lump
from gsl.core.dynamics import forward_kinematics, mass_matrix
from gsl.core.plant import nominal
from gsl.diagnosis.hypothesis.candidates import library
from gsl.errors import GslError
from gsl.robots.catalogue import names, robot
from gsl.robots.urdf import urdf
from gsl.worlds.chain import COLUMNS, accelerate, chain, nothing

EXAMPLE = Path(__file__).parents[2] / "examples/arm.urdf"
FINGER = "left_finger"


def poses(body: Robot, count: int = 5) -> list[dict[str, float]]:
    rng = np.random.default_rng(0)
    joints = [body.joint(name) for name in body.motors]
    return [{joint.name: rng.uniform(joint.lower, joint.upper) for joint in joints} for _ in range(count)]


def chain_acceleration(body: Robot, angles: dict[str, float]) -> np.ndarray:
    """Of the released robot at rest, as the compiled chain has it [rad/s²]."""
    plant, n = nominal(body), len(body.motors)
    motion, torque = np.array([[angles[name] for name in body.motors], np.zeros(n)]), np.zeros(n)
    tree = chain(plant, plant.servo.armature)
    accelerate(tree, motion, nothing(), torque, np.zeros((n, COLUMNS)), np.zeros((n, n)))
    return torque


@pytest.mark.parametrize("name", names())
def test_what_is_written_is_read_back(name: str, tmp_path: Path) -> None:
    ours, file = robot(name), tmp_path / "it.urdf"
    file.write_text(urdf(ours))
    back = robot(str(file))
    first, second = lump(ours), lump(back)
    assert [*first.links] == [*second.links] and set(back.motors) == set(ours.motors)
    for link in first.links:
        assert second.links[link].mass == pytest.approx(first.links[link].mass, rel=1e-11)
        np.testing.assert_allclose(second.links[link].com, first.links[link].com, atol=1e-11)
        np.testing.assert_allclose(second.links[link].inertia, first.links[link].inertia, rtol=1e-6, atol=1e-12)
    for joint in first.motors:
        mine, theirs = first.joint(joint), second.joint(joint)
        np.testing.assert_allclose([*theirs.axis, *theirs.origin], [*mine.axis, *mine.origin], atol=1e-11)
        limits = [(at.lower, at.upper, at.effort, at.max_velocity) for at in (mine, theirs)]
        np.testing.assert_allclose(limits[1], limits[0], rtol=1e-11)
    for pose in poses(ours):
        by_name = dict(zip(back.motors, holding(back, pose), strict=True))
        np.testing.assert_allclose([by_name[joint] for joint in ours.motors], holding(ours, pose), atol=1e-9)


def test_turned_frames_weigh_what_bullet_weighs(tmp_path: Path) -> None:
    ours, bare = robot(str(EXAMPLE)), tmp_path / "arm.urdf"
    bare.write_text("\n".join(line for line in EXAMPLE.read_text().splitlines() if "<mesh" not in line))
    with as_bullet_reads(bare) as bullets:  # Bullet refuses a file whose mesh is missing
        for pose in poses(ours):
            theirs = pose | {"right_finger": -pose[FINGER], "slide": 0.01}
            held = bullets.holding(theirs)
            held["right_finger"] *= -1.0  # ours turns about the opposite axis, so that it goes with its leader
            pose["right_finger"] = pose[FINGER]
            np.testing.assert_allclose(holding(ours, pose), [held[name] for name in ours.motors], atol=1e-6)
            at = [bullets.joints.index(name) for name in ours.motors]
            signs = np.array([-1.0 if name == "right_finger" else 1.0 for name in ours.motors])
            inertia = bullets.inertia(theirs)[np.ix_(at, at)] * np.outer(signs, signs)
            np.testing.assert_allclose(mass_matrix(lump(ours), pose)[6:, 6:], inertia, atol=2e-7)


def test_the_chain_falls_as_the_textbook_says() -> None:
    ours = robot(str(EXAMPLE))
    armature = np.diag([ours.joint(name).armature for name in ours.motors])
    for pose in poses(ours):
        inertia = mass_matrix(lump(ours), pose)[6:, 6:] + armature
        np.testing.assert_allclose(inertia @ chain_acceleration(ours, pose), -holding(ours, pose), atol=1e-9)


def test_what_is_left_open_is_derived_and_what_is_left_out_is_told() -> None:
    ours = robot(str(EXAMPLE))
    assert ours.controlled == ("turn", "shoulder", "elbow", FINGER) and dict(ours.coupled) == {"right_finger": FINGER}
    elbow = ours.joint("elbow")
    assert elbow.armature == pytest.approx(0.02 * 2.0 / 6.0) and ours.gains["elbow"][0] == pytest.approx(2.0 / 0.2)
    np.testing.assert_allclose(ours.bound_commands("turn"), [-2.0 * np.pi, 2.0 * np.pi])
    remarks = " | ".join(ours.remarks)
    assert (
        "column.stl" in remarks
        and "<dynamics> of elbow is friction, an effect of the world" in remarks
        and "slide is held at 0.01 m (follows left_finger by a factor of 0.02; only 1 and -1 can be driven)" in remarks
    )


def test_a_joint_that_follows_goes_the_other_way_by_the_same_angle() -> None:
    body = lump(robot(str(EXAMPLE)))
    frames = forward_kinematics(body, {FINGER: 0.5, "right_finger": 0.5})
    ahead = body.links["left"].com / np.linalg.norm(body.links["left"].com)
    left, right = (frames.turn["fore"].T @ frames.turn[side] @ ahead for side in ("left", "right"))
    np.testing.assert_allclose(left + right, 2.0 * np.cos(0.5) * ahead, atol=1e-12)
    assert np.linalg.norm(left - right) == pytest.approx(2.0 * np.sin(0.5))


@pytest.fixture
def written(tmp_path: Path) -> Callable[[str], Path]:
    (tmp_path / "arm.urdf").write_text(EXAMPLE.read_text())

    def write(text: str) -> Path:
        (tmp_path / "robot.yaml").write_text(text)
        return tmp_path / "robot.yaml"

    return write


def test_friction_and_rotors_of_a_strong_robot_may_be_larger(written: Callable[[str], Path]) -> None:
    text = "urdf: arm.urdf\nranges: {armature: {inertia: [0, 0.2]}}\njoints: {elbow: {effort: 150, velocity: 5}}"
    strong, usual = robot(str(written(text))), robot(str(EXAMPLE))
    assert strong.ranges["coulomb_friction"] == {"torque": (0.0, pytest.approx(0.3 * 150.0 / 3.35))}
    assert strong.ranges["armature"] == {"inertia": (0.0, 0.2)}
    assert "coulomb_friction" not in usual.ranges


def test_a_file_beside_it_chooses_joints_and_says_what_is_known(written: Callable[[str], Path]) -> None:
    text = """
        urdf: arm.urdf
        name: my arm
        joints: {elbow: {kp: 7, kd: 0.1, armature: 0.003, effort: 1.5}, shoulder: }
        held: {turn: 0.4}
        groups: {both: [elbow, shoulder]}
        ranges: {command_latency: {delay: [0, 0.12]}}
    """
    ours = robot(str(written(text)))
    assert (ours.name, ours.controlled, dict(ours.coupled)) == ("my_arm", ("elbow", "shoulder"), {})
    elbow = ours.joint("elbow")
    assert (ours.gains["elbow"], elbow.armature, elbow.effort) == ((7.0, 0.1), 0.003, 1.5)
    assert ours.ranges["servo_gain"]["kp"][0] == pytest.approx(0.2 / 0.9)  # the shoulder's
    assert ours.joint("shoulder").effort == 3.0
    latency = next(candidate for candidate in library(ours) if candidate.effect == "command_latency")
    np.testing.assert_allclose(latency.documented[:, 0], [0.0, 0.12])
    whole = robot(str(EXAMPLE))
    for pose in poses(ours):
        rest = {"turn": 0.4, FINGER: 0.0, "right_finger": 0.0}
        expected = dict(zip(whole.motors, holding(whole, pose | rest), strict=True))
        np.testing.assert_allclose(holding(ours, pose), [expected[name] for name in ours.controlled], atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "remark"),
    [
        (
            "lower='-1' upper='1'",
            "lower='-90' upper='90'",
            "joint j has the limits -90 and 90 rad: are they in degrees?",
        ),
        ("izz='1'", "izz='3'", "link b has the principal moments 1, 1, 3 kg·m²: no body has one that is more than"),
        ("izz='1'", "izz='2'", None),
    ],
)
def test_what_looks_wrong_in_a_urdf_is_a_remark(old: str, new: str, remark: str | None, tmp_path: Path) -> None:
    (tmp_path / "it.urdf").write_text(but(old, new))
    remarks = robot(str(tmp_path / "it.urdf")).remarks
    assert remarks == () if remark is None else remarks[0].startswith(remark)


def test_a_robot_without_shapes_has_no_picture(tmp_path: Path) -> None:
    (tmp_path / "nobody.yaml").write_text("joints: {a: {effort: 1, velocity: 5}}")
    said = done("robot", "nobody.yaml", folder=tmp_path)
    assert "remark: no picture" in said.out and not said.err
    assert [path.name for path in (tmp_path / "runs/robot").iterdir()] == ["nobody.urdf"]


def test_servos_without_a_body_turn_loads_of_their_own(written: Callable[[str], Path]) -> None:
    ours = robot(str(written("joints: {a: {effort: 1, velocity: 5}, b: {effort: 2, velocity: 5, inertia: 0.02}}")))
    inertia = mass_matrix(lump(ours), {})[6:, 6:]
    np.testing.assert_allclose(inertia, np.diag([ours.joint("a").armature, 0.02]), atol=1e-15)
    np.testing.assert_allclose(holding(ours, {"a": 0.3, "b": -1.0}), 0.0, atol=1e-12)
    load = next(
        candidate
        for candidate in library(ours)
        if candidate.effect == "centre_of_mass" and candidate.fixed["link"] == "b_load"
    )
    assert load.documented[1].max() * 9.81 == pytest.approx(0.5 * 2.0)  # of the greatest torque


WHOLE = (
    "<robot><link name='a'/>"
    "<link name='b'><inertial><mass value='1'/>"
    "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>"
    "<joint name='j' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/>"
    "<limit lower='-1' upper='1' effort='1' velocity='1'/></joint></robot>"
)

SLIDE = WHOLE.replace("revolute", "prismatic")


def but(old: str, new: str) -> str:
    """The robot of two links with something else in it."""
    assert old in WHOLE
    return WHOLE.replace(old, new)


def with_more(name: str) -> str:
    joint = WHOLE[WHOLE.index("<joint") : WHOLE.index("</robot>")]
    return but("</robot>", joint.replace("'j'", f"'{name}'") + "</robot>")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "is not XML, or damaged: no element found"),
        ("<robot", "is not XML, or damaged: unclosed token"),
        ("PK\x03\x04", "is not XML, or damaged"),
        ("<mujoco/>", "is no URDF: its root is <mujoco>, not <robot>"),
        (
            "<robot xmlns:xacro='http://ros.org/xacro'><xacro:macro/></robot>",
            "holds xacro macros; expand them first: xacro it.urdf",
        ),
        ("<robot/>", "it has no link"),
        ("<robot><link/></robot>", "a <link> has no name"),
        ("<robot><link name='a'/><link name='a'/></robot>", "two links are called 'a'"),
        ("<robot><link name='a'/><link name='b'/></robot>", "it is no tree: a and b hang on nothing; one link alone"),
        (but("child link='b'", "child link='c'"), "joint 'j': there is no link 'c'"),
        (but("<child link='b'/>", ""), "joint 'j': names no parent or no child link"),
        (but("effort='1'", ""), "joints.j: has no effort; write its motor's peak torque [N·m] in <limit>, or in a"),
        (but("effort='1'", "effort='0'"), "joints.j: has effort 0, a placeholder; write its motor's peak torque"),
        (but("velocity='1'", "velocity='0'"), "joints.j: has velocity 0, a placeholder; write its motor's speed"),
        (but("upper='1'", "upper='-1'"), "joints.j: its limits are -1 and -1 rad: it could not move"),
        (but("upper='1'", "upper='one'"), "joint 'j': upper of <limit> must be a finite number, not 'one'"),
        (but("upper='1'", "upper='nan'"), "joint 'j': upper of <limit> must be a finite number, not 'nan'"),
        (but("0 0 1", "0 0 0"), "joint 'j': its axis has no direction"),
        (but("0 0 1", "0 1"), "joint 'j': axis must be 3 finite numbers, not '0 1'"),
        (
            but("revolute", "planar"),
            "joint 'j': type 'planar' is not supported; there are revolute, continuous, pr",
        ),
        (but("revolute", "fixed"), "joints: the URDF has no joint that turns or slides, so nothing can be controlled"),
        (
            SLIDE.replace("effort='1'", "effort='1e6'"),
            "joints.j: has effort 1e+06, a placeholder; write its motor's peak force [N] in <limit>, or in a robot",
        ),
        (SLIDE.replace("velocity='1'", ""), "joints.j: has no velocity; write its motor's speed without load [m/s] in"),
        (
            SLIDE.replace("upper='1'", "upper='100'"),
            "joints.j: its limits are -1 and 100 m, a placeholder; write lower",
        ),
        (SLIDE.replace("lower='-1' upper='1'", ""), "joints.j: has no range; write lower and upper [m] in <limit>, or"),
        (but("mass value='1'", "mass value='0'"), "joints.j: it moves the link 'b', which has no mass; give that an"),
        (
            but("izz='1'", "izz='-1'"),
            "joints.j: it moves the link 'b', with a principal moment of inertia of -1",
        ),
        (but("izz='1'", ""), "link 'b': <inertia> lacks izz"),
        (with_more("j"), "two joints are called 'j'"),
        (with_more("k"), "it is no tree: b is the child of two joints"),
        (but("parent link='a'", "parent link='b'"), "it is no tree: b hangs in a loop"),
    ],
)
def test_a_urdf_that_describes_no_robot(text: str, line: str, tmp_path: Path) -> None:
    file = tmp_path / "it.urdf"
    file.write_text(text)
    with pytest.raises(GslError) as error:
        robot(str(file))
    assert str(error.value).startswith(f"{file}: {line}") and "\n" not in str(error.value)
    assert error.value.exit_code == 2


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("urdf: none.urdf", "urdf = none.urdf: there is no such file, as seen from the robot's file"),
        (
            "{",
            "is not YAML, or damaged: while parsing a flow node expected the node content, but found '<stream end>'",
        ),
        ("- arm", "says nothing of a robot; see docs/howto/own-robot.md"),
        ("urdf: arm.urdf\ngain: 3", "gain: no such setting"),
        ("urdf: arm.urdf\njoints: {elbo: {}}", "joints.elbo: the URDF has no such joint; did you mean elbow?"),
        ("urdf: arm.urdf\njoints: {elbow: {kp: -1}}", "joints.elbow.kp = -1: must be above 0"),
        ("urdf: arm.urdf\njoints: {elbow: 3}", "joints.elbow = 3: must map its settings to values"),
        ("urdf: arm.urdf\njoints: {slide: {}}", "joints.slide: follows left_finger (<mimic>); control that one"),
        ("urdf: arm.urdf\njoints: {right_finger: }", "joints.right_finger: follows left_finger (<mimic>); control"),
        ("urdf: arm.urdf\nheld: {wrist: 1}", "held.wrist: the URDF has no such joint"),
        ("urdf: arm.urdf\nheld: {elbow: 1}", "held.elbow: the joint is controlled; leave it out"),
        ("urdf: arm.urdf\nheld: {table: 1}", "held.table: the joint is fixed; leave it out"),
        ("urdf: arm.urdf\njoints: {elbow: {inertia: 1}}", "joints.elbow.inertia: is for servos without a body"),
        ("urdf: arm.urdf\nencoder_side: left", "encoder_side = left: must be one of 'output' or 'motor'"),
        ("urdf: arm.urdf\ngroups: {hand: [finger]}", "groups.hand: 'finger' is no controlled joint; did you mean"),
        ("urdf: arm.urdf\nranges: {backlash: {size: [0, 1]}}", "ranges.backlash.size: the effect has no parameter"),
        ("urdf: arm.urdf\nranges: {slack: {}}", "ranges.slack: no effect of this name"),
        ("urdf: arm.urdf\nranges: {backlash: {width: [1, 0]}}", "ranges.backlash.width: 1 to 0 is no range"),
        ("urdf: arm.urdf\nranges: {command_latency: {delay: [0, 1]}}", "0 to 1 is no range that it can have, 0.3 at"),
        ("name: lone", "joints: names no joint; without a urdf they have to be named"),
        ("joints: {a: {}}", "joints.a: has no effort"),
    ],
)
def test_a_robot_file_that_does_not_fit(text: str, line: str, written: Callable[[str], Path]) -> None:
    with pytest.raises(GslError) as error:
        robot(str(written(text)))
    assert line in str(error.value) and "\n" not in str(error.value) and error.value.exit_code == 2
