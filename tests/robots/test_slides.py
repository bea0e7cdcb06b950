"""Joints that slide: what physics says of them, in Bullet and in the chain model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from both_engines import PERIOD, in_bullet, window

from gsl.commandline.init import write_configuration
from gsl.core.body import Robot, lump
from gsl.core.dynamics import Frames, forward_kinematics, gravity_torque, mass_matrix
from gsl.core.plant import Plant, nominal
from gsl.errors import ConfigError, InputError
from gsl.policies.excitation import MENU, Excitation
from gsl.policies.limits import breach, limits
from gsl.policies.sides import Pair, pairs
from gsl.report.console import Console
from gsl.report.shown import scale_of
from gsl.robots.catalogue import robot
from gsl.robots.frames import euler
from gsl.robots.urdf import urdf
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.drive_train import STOP_STIFFNESS
from gsl.worlds.fits import check_hinges
from gsl.worlds.held import Held

pytestmark = pytest.mark.slow

STEP, GRAVITY = 0.002, 9.81
MASS = 0.7
LIFT = """<robot name="lift">
<link name="base"><inertial><mass value="5"/>{inertia}</inertial></link>
<link name="cage"><inertial><mass value="{mass}"/>{inertia}</inertial></link>
<joint name="rise" type="prismatic"><parent link="base"/><child link="cage"/><origin rpy="0 {tilt} 0"/>
<axis xyz="0 0 2"/><limit lower="-0.2" upper="0.3" effort="30" velocity="0.8"/></joint>
</robot>"""
GANTRY = """<robot name="gantry">
<link name="base"><inertial><mass value="5"/>{inertia}</inertial></link>
<link name="cart"><inertial><origin xyz="0 0.02 0"/><mass value="1.5"/>{inertia}</inertial></link>
<link name="pole"><inertial><origin xyz="0.03 0 -0.2"/><mass value="0.4"/>{inertia}</inertial></link>
<link name="bob"><inertial><origin xyz="0 0.01 -0.02"/><mass value="0.2"/>{inertia}</inertial></link>
<link name="mate"><inertial><mass value="0.1"/>{inertia}</inertial></link>
<joint name="way" type="prismatic"><parent link="base"/><child link="cart"/><origin rpy="0.2 0.3 0" xyz="0 0 0.3"/>
<axis xyz="1 0 0"/><limit lower="-0.5" upper="0.5" effort="40" velocity="1.5"/></joint>
<joint name="swing" type="revolute"><parent link="cart"/><child link="pole"/><origin xyz="0 0 -0.05"/>
<axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5" effort="4" velocity="6"/></joint>
<joint name="reach" type="prismatic"><parent link="pole"/><child link="bob"/><origin xyz="0 0 -0.4" rpy="0 0 0.4"/>
<axis xyz="0.2 0 -1"/><limit lower="-0.02" upper="0.02" effort="15" velocity="0.6"/></joint>
<joint name="grip" type="prismatic"><parent link="bob"/><child link="mate"/><origin rpy="0 0 1"/>
<axis xyz="0 1 0"/><limit lower="-0.05" upper="0.05" effort="15" velocity="0.6"/>
<mimic joint="reach" multiplier="-1" offset="0.01"/></joint>
</robot>"""
INERTIA = '<inertia ixx="0.004" iyy="0.003" izz="0.002" ixy="0" ixz="0" iyz="0"/>'


@pytest.fixture
def made(tmp_path: Path) -> Callable[[str], Path]:
    def make(text: str, **values: float) -> Path:
        file = tmp_path / "it.urdf"
        file.write_text(text.format(**{"inertia": INERTIA, "mass": MASS, "tilt": 0.0, **values}))
        return file

    return make


def play(plant: Plant, targets: np.ndarray, step: float = STEP) -> tuple[np.ndarray, np.ndarray]:
    """Positions after every control period in the chain model and in Bullet, each of shape (T, n_motors)."""
    replayed = Held.of(plant, step, PERIOD).replay(window(targets))[0]
    return replayed, in_bullet(plant, targets, step)


def wander(body: Robot, ticks: int = 150) -> np.ndarray:
    rng, time = np.random.default_rng(0), PERIOD * np.arange(ticks)
    waves = np.sin(2.0 * np.pi * np.outer(time, rng.uniform(0.3, 1.5, len(body.motors))))
    return 0.15 * body.sizes * waves * np.minimum(1.0, time / 0.5)[:, None]


def bare(body: Robot) -> Robot:
    """Without rotors, which Bullet has to be helped with."""
    return replace(body, joints=tuple(replace(joint, armature=0.0) for joint in body.joints))


@pytest.mark.parametrize("tilt", [0.0, 1.0])
def test_a_servo_that_lifts_settles_below_its_target_by_weight_over_stiffness(
    made: Callable[..., Path], tilt: float
) -> None:
    plant = nominal(lump(robot(str(made(LIFT, tilt=tilt)))))
    ends = [path[-1, 0] for path in play(plant, np.full((100, 1), 0.1))]
    droop = MASS * GRAVITY * np.cos(tilt) / plant.servo.kp[0]
    assert ends == pytest.approx([0.1 - droop] * 2, abs=1e-6) and droop > 0.002


def test_without_force_it_falls_as_everything_does(made: Callable[..., Path]) -> None:
    plant = nominal(bare(lump(robot(str(made(LIFT))))))
    plant = plant.with_servo(kp=np.zeros(1), kd=np.zeros(1))
    steps = np.arange(1, 11) * round(PERIOD / STEP)
    fallen = -0.5 * GRAVITY * STEP**2 * steps * (steps + 1)  # semi-implicit Euler steps
    for path in play(plant, np.zeros((10, 1))):
        np.testing.assert_allclose(path[:, 0], fallen, atol=1e-9)


def test_its_rotor_is_inert_and_weighs_nothing(made: Callable[..., Path]) -> None:
    body = lump(robot(str(made(LIFT))))
    heavy = replace(body, joints=tuple(replace(joint, armature=2.0) for joint in body.joints))
    plant = nominal(heavy).with_servo(kp=np.zeros(1), kd=np.zeros(1))
    for path in play(plant, np.zeros((10, 1))):
        later = np.diff(path[4:, 0], 2) / PERIOD**2  # Bullet's compensation has found it by then
        np.testing.assert_allclose(later, -GRAVITY * MASS / (MASS + 2.0), rtol=1e-3)


@pytest.mark.parametrize("fields", [{}, {"coulomb": 0.5}, {"delay": 0.013}, {"load_friction": 0.1}])
def test_the_chain_is_pinned_to_bullet(made: Callable[..., Path], fields: dict[str, float]) -> None:
    body = bare(lump(robot(str(made(GANTRY)))))
    plant = nominal(body).with_servo(**{name: np.full(len(body.motors), value) for name, value in fields.items()})
    chain, bullet = play(plant, wander(body), 0.5 * STEP)
    assert np.ptp(bullet, axis=0).min() > 0.002
    np.testing.assert_allclose(chain, bullet, atol=1e-9)


@pytest.mark.parametrize(
    "fields", [{}, {"coulomb": 0.5}, {"play": 0.004}, {"compliance": 1e-4}, {"lower_stop": -0.005}]
)
def test_with_rotors_they_agree_far_below_a_millimetre(made: Callable[..., Path], fields: dict[str, float]) -> None:
    body = lump(robot(str(made(GANTRY))))
    sliding, plant = np.array([name in body.slides for name in body.motors]), nominal(body)
    plant = plant.with_servo(
        **{name: np.where(sliding, value, getattr(plant.servo, name)) for name, value in fields.items()}
    )
    chain, bullet = play(plant, wander(body))
    np.testing.assert_allclose(chain, bullet, atol=3e-3 if "play" in fields else 5e-4)


def test_a_hard_stop_holds_what_presses_on_it(made: Callable[..., Path]) -> None:
    plant = nominal(lump(robot(str(made(LIFT)))))
    plant, pressed = plant.with_servo(lower_stop=np.array([-0.05])), 30.0 + MASS * GRAVITY
    hard = 100.0 * (MASS + 0.02 * 30.0 / 0.8)
    for path in play(plant, np.r_[[[0.0]], np.full((100, 1), -0.2)]):  # with all its force
        assert path[-1, 0] == pytest.approx(-0.05 - pressed / (STOP_STIFFNESS * hard), abs=1e-6)


def test_its_inertia_and_its_weight_are_those_of_differences(made: Callable[..., Path]) -> None:
    body, rng = lump(robot(str(made(GANTRY)))), np.random.default_rng(1)
    gravity = np.array([0.0, 0.0, -GRAVITY])

    def centres(pose: np.ndarray) -> np.ndarray:
        frames = forward_kinematics(body, dict(zip(body.motors, pose, strict=True)))
        return np.array([frames.origin[n] + frames.turn[n] @ link.com for n, link in body.links.items()])

    masses = np.array([link.mass for link in body.links.values()])
    for pose in 0.3 * body.sizes * rng.uniform(-1.0, 1.0, (5, len(body.motors))):
        named = dict(zip(body.motors, pose, strict=True))
        slopes = [(centres(pose + step) - centres(pose - step)) / 2e-5 for step in 1e-5 * np.eye(len(pose))]
        weights = [-float(masses @ slope @ gravity) for slope in slopes]
        np.testing.assert_allclose(gravity_torque(body, named, gravity), weights, atol=1e-8)
        slides = [body.motors.index(name) for name in body.slides]
        inertia = [[float(masses @ (slopes[i] * slopes[k]).sum(axis=1)) for k in slides] for i in slides]
        np.testing.assert_allclose(mass_matrix(body, named)[6:, 6:][np.ix_(slides, slides)], inertia, atol=1e-8)


def test_a_follower_goes_the_other_way_from_its_offset(made: Callable[..., Path]) -> None:
    body = robot(str(made(GANTRY)))
    assert dict(body.coupled) == {"grip": "reach"} and body.slides == ("way", "reach", "grip")
    frames = [forward_kinematics(lump(body), {"reach": place, "grip": place}) for place in (0.0, 0.01)]
    axis = euler(0.2, 0.3, 0.0) @ [-np.sin(1.4), np.cos(1.4), 0.0]  # turned by 0.4 and by 1 about z, on the tilted way

    def apart(frame: Frames) -> np.ndarray:
        return frame.origin["mate"] - frame.origin["bob"]

    np.testing.assert_allclose(apart(frames[0]), 0.01 * axis, atol=1e-12)
    np.testing.assert_allclose(apart(frames[1]), 0.0, atol=1e-12)


def test_what_is_written_is_read_back(made: Callable[..., Path], tmp_path: Path) -> None:
    ours = robot(str(made(GANTRY)))
    (tmp_path / "back.urdf").write_text(urdf(ours))
    back = robot(str(tmp_path / "back.urdf"))
    assert [(j.name, j.slides) for j in back.joints] == [(j.name, j.slides) for j in ours.joints]


def test_what_is_left_open_fits_its_way(made: Callable[..., Path]) -> None:
    body = robot(str(made(GANTRY)))
    way, reach = body.joint("way"), body.joint("reach")
    assert (way.size, reach.size, body.joint("swing").size) == (0.25, pytest.approx(0.02), 1.0)
    assert body.gains["way"][0] == pytest.approx(40.0 / (0.2 * 0.25))
    assert reach.armature == pytest.approx(0.02 * 15.0 / 0.6)
    assert "joints that slide, their commands in m and forces in N: way, reach, grip" in body.remarks


def test_an_excitation_moves_it_within_its_range(made: Callable[..., Path]) -> None:
    file = str(made(GANTRY))
    bounds, played = limits(robot(file)), Excitation(robot=file)
    for motion in MENU:
        path = played.commands(motion, "a", PERIOD)
        assert breach(bounds, path, PERIOD) is None
    reach = bounds.joints.index("reach")
    largest = played.commands("steps_large", "a", PERIOD)[:, reach]
    assert 0.003 < np.ptp(largest) < 0.04
    beyond = np.tile(bounds.rest, (3, 1))
    beyond[2, reach] = 0.021
    broken = breach(bounds, beyond, PERIOD)
    assert broken is not None and broken.problem == "the target of 0.021 m is above the limit, 0.02 m"


def test_it_starts_near_where_it_should(made: Callable[..., Path]) -> None:
    env = BulletWorld(robot=str(made(GANTRY)), effects={}, floating=False, settle=0.0).make()
    starts = np.array([env.reset(seed=seed)[0][:3] for seed in range(20)])
    env.close()
    spread = starts.std(axis=0)
    assert spread[2] < 0.0012 and 0.003 < spread[0] < 0.015 and 0.015 < spread[1] < 0.05


@pytest.mark.parametrize(("axis", "sign"), [("0 1 0", -1.0), ("1 0 0", 1.0)])
def test_sides_mirror_slides_by_their_direction(tmp_path: Path, axis: str, sign: float) -> None:
    links = "".join(
        f"<link name='{name}'><inertial><mass value='1'/>{INERTIA}</inertial></link>" for name in ("base", "l", "r")
    )
    joints = "".join(
        f"<joint name='j{name}' type='prismatic'><parent link='base'/><child link='{name}'/><axis xyz='{axis}'/>"
        f"<origin xyz='0 {y} 0'/><limit lower='0' upper='0.1' effort='5' velocity='1'/></joint>"
        for name, y in (("l", 0.2), ("r", -0.2))
    )
    (tmp_path / "it.urdf").write_text(f"<robot name='it'>{links}{joints}</robot>")
    assert pairs(robot(str(tmp_path / "it.urdf"))) == (Pair(0, 1, sign),)


def test_people_read_millimetres() -> None:
    assert scale_of("reach", ("reach",)) == (1000.0, "mm") and scale_of("swing", ("reach",)).unit == "°"


def test_a_log_of_it_on_the_ground_is_not_compared(made: Callable[..., Path]) -> None:
    with pytest.raises(InputError) as error:
        check_hinges(robot(str(made(GANTRY))), "walks")
    line = "on the ground no log of joints that slide is compared, and way, reach, grip slide; log the robot in the air"
    assert str(error.value) == f"walks: {line}"


def test_placeholders_of_a_slide(made: Callable[..., Path]) -> None:
    file = made(LIFT)
    file.write_text(file.read_text().replace('effort="30" velocity="0.8"', 'effort="0" velocity="1000"'))
    with pytest.raises(InputError, match=r"rise: has effort 0, a placeholder and velocity 1000, a placeholder; write"):
        robot(str(file))


def test_mixed_limits_are_asked_for_where_they_are_missing(made: Callable[..., Path], tmp_path: Path) -> None:
    file = made(GANTRY)
    file.write_text(file.read_text().replace('effort="4" velocity="6"', 'velocity="6"'))
    with pytest.raises(InputError, match=r"joints.swing: has no effort; write its motor's peak torque \[N·m\] in"):
        robot(str(file))
    out = tmp_path / "mine"
    write_configuration([f"urdf={file}", "name=mine", f"out={out}", "effort=7"], (), Console())
    body = robot(str(out / "robot.yaml"))
    assert [body.joint(name).effort for name in ("way", "swing", "reach")] == [40.0, 7.0, 15.0]
    text = (out / "robot.yaml").read_text()
    assert "m for rad, N for N·m" in text
    with pytest.raises(ConfigError, match="velocity: stands in for what a URDF leaves open, and this one says it"):
        write_configuration([f"urdf={file}", "name=other", f"out={tmp_path}/other", "velocity=7"], (), Console())


def test_a_rotor_far_heavier_than_what_it_moves_is_told(made: Callable[..., Path]) -> None:
    text = LIFT.replace("prismatic", "revolute").replace('"0.8"', '"{speed}"')
    light = INERTIA.replace("0.00", "0.00000")
    heavy = robot(str(made(text, inertia=light, speed=1.0)))
    (remark,) = [remark for remark in heavy.remarks if "rotors" in remark]
    assert remark.startswith("rotors are far heavier than what they move, and the robot may swing: rise; look at")
    assert not [remark for remark in robot(str(made(text, speed=8.0))).remarks if "rotors" in remark]


def test_impossible_inertia_of_a_welded_link_is_only_remarked(made: Callable[..., Path]) -> None:
    welded = (
        '<link name="plate"><inertial><mass value="1e-6"/>'
        '<inertia ixx="2e-8" iyy="2e-8" izz="-1e-9" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="glue" type="fixed"><parent link="cage"/><child link="plate"/></joint>'
    )
    body = robot(str(made(LIFT.replace("</robot>", f"{welded}</robot>"))))
    assert any(remark.startswith("link plate has the principal moments -1e-09") for remark in body.remarks)


def test_massless_links_that_are_welded_have_a_place(made: Callable[..., Path]) -> None:
    nothing = '<link name="world"/><joint name="down" type="fixed"><parent link="world"/><child link="base"/></joint>'
    text = LIFT.replace(f'<inertial><mass value="5"/>{"{inertia}"}</inertial>', "", 1)
    body = lump(robot(str(made(text.replace("</robot>", f"{nothing}</robot>")))))
    assert np.isfinite(body.links["world"].com).all() and body.links["world"].mass == 0.0
