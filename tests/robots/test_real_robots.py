"""The robots of real logs: constants against closed forms and published figures, and motions that they may make."""

import math

import numpy as np
import pytest
from bodies import followed
from robots_of_files import holding

from gsl.core.body import lump
from gsl.core.dynamics import forward_kinematics, mass_matrix
from gsl.core.layout import Layout
from gsl.core.plant import nominal
from gsl.policies.excitation import MENU, VARIANTS, Excitation
from gsl.policies.limits import breach, limits
from gsl.robots import pendulum as bench
from gsl.robots import so101 as arm_facts
from gsl.robots.catalogue import robot
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.drive_train import limit_torque

GAINS = (100, 200, 400, 800)
PERIODS = {"pendulum": 0.005, "so101": 0.02, "go2": 0.005}


@pytest.mark.parametrize("gain", GAINS)
def test_the_pendulums_servo_is_the_firmwares_law(gain: int) -> None:
    """But at full duty against the motion, where ours lacks the motor's own braking."""
    body = robot(f"gsl.robots.pendulum.xl330_{gain}")
    servo, stall, no_load = nominal(body).servo, bench.Xl330().stall, bench.Xl330().no_load
    e = (4096 / (2 * math.pi)) / (256 * 885)
    for error in np.linspace(-1.5, 1.5, 13):
        for speed in (0.0, 0.5, 4.0):
            wanted = float(servo.kp[0] * error - servo.kd[0] * speed)
            ours = limit_torque(wanted, speed, float(servo.limit[0]), float(servo.no_load_speed[0]))
            duty = min(1.0, max(-1.0, gain * e * error))
            if duty * stall - stall / no_load * speed > -stall:
                assert ours == pytest.approx(stall * duty - stall / no_load * speed, abs=1e-12)


def test_the_pendulum_hangs_down_and_weighs_what_its_mass_says() -> None:
    body = robot("pendulum")
    for angle in (-2.0, 0.0, 0.3, 1.5):
        weight = (0.49 + 0.5 * bench.ARM_MASS) * 9.81 * 0.1 * math.sin(angle)
        assert holding(body, {"joint": angle}) == pytest.approx([weight], abs=1e-12)
    rod = bench.ARM_MASS * 0.1**2 / 3.0
    assert mass_matrix(lump(body), {})[6, 6] == pytest.approx(0.49 * 0.1**2 + rod, rel=1e-6)


def test_the_xl330_is_as_strong_and_fast_as_its_maker_says() -> None:
    assert (bench.Xl330(voltage=6.0).stall, bench.Xl330(voltage=5.0).no_load) == (0.60, 10.786)
    assert bench.Xl330().kp == pytest.approx(0.82, abs=0.01)  # identified from logs by Rhoban/bam, m1
    assert bench.Xl330().stall == pytest.approx(0.712, abs=0.005)  # likewise


def test_the_arms_servo_loses_friction_once_at_full_duty_as_at_any_other() -> None:
    """Duty times the stall torque less the back-EMF, all before friction, which is the world's."""
    servo = nominal(robot("so101")).servo
    assert not servo.coulomb.any() and not servo.load_friction.any()
    for error in np.linspace(-1.5, 1.5, 13):
        duty = min(1.0, max(-1.0, arm_facts.GAIN * arm_facts.DUTY_PER_RADIAN * error))
        for speed in (0.0, 0.5, 4.0):
            wanted = float(servo.kp[0] * error - servo.kd[0] * speed)
            ours = limit_torque(wanted, speed, float(servo.limit[0]), float(servo.no_load_speed[0]))
            torque = arm_facts.STALL * (duty - speed / arm_facts.NO_LOAD)
            if torque > -arm_facts.STALL:
                assert ours == pytest.approx(torque, abs=1e-12)


def test_menageries_arm_is_the_same_but_for_its_servos() -> None:
    ours, theirs = robot("so101"), robot("so101_menagerie")
    assert (theirs.name, theirs.controlled) == (ours.name, ours.controlled)
    assert set(theirs.gains.values()) == {(998.22, 2.731)}
    lowest = theirs.ranges["servo_gain"]["kp"][0]
    assert lowest * 998.22 == pytest.approx(2.94 / 0.9)  # full torque at .9 rad
    assert nominal(theirs).servo.limit.tolist() == [2.94] * 6


def test_the_arm_stands_and_weighs_as_published() -> None:
    arm = robot("so101")
    frames = forward_kinematics(lump(arm), {})
    assert arm.mass == pytest.approx(0.632006)
    np.testing.assert_allclose(frames.origin["gripper"], [0.2932, -0.0002, 0.2344], atol=1e-4)
    np.testing.assert_allclose(frames.axis["Pitch"], [0.0, 1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(frames.axis["Rotation"], [0.0, 0.0, -1.0], atol=1e-6)
    expected = {
        "Rotation": 0.0,
        "Pitch": -0.539,
        "Elbow": -0.453,
        "Wrist_Pitch": -0.117,
        "Wrist_Roll": 0.0,
        "Jaw": 0.0035,
    }
    np.testing.assert_allclose(holding(arm, {}), [expected[name] for name in arm.controlled], atol=6e-4)


def test_the_go2_has_its_feet_where_its_maker_has_them() -> None:
    dog = robot("go2")
    assert dog.mass == pytest.approx(15.017) and len(dog.controlled) == 12 and dog.controlled[4] == "FR_thigh_joint"
    frames = forward_kinematics(lump(dog), {})
    for leg, x, y in (("FL", 1, 1), ("FR", 1, -1), ("RL", -1, 1), ("RR", -1, -1)):
        foot = frames.origin[f"{leg}_calf"] + [0.0, 0.0, -0.213]
        np.testing.assert_allclose(foot, [0.1934 * x, 0.142 * y, -0.426], atol=1e-12)


@pytest.mark.parametrize("name", PERIODS)
def test_every_motion_keeps_the_robots_limits_and_comes_back(name: str) -> None:
    excitation, body, period = Excitation(robot=name), robot(name), PERIODS[name]
    for motion in MENU:
        for variant in VARIANTS:
            targets = excitation.commands(motion, variant, period)
            assert breach(limits(body), targets, period) is None
            np.testing.assert_allclose(targets[[0, -1]], excitation.limits.rest[None].repeat(2, axis=0), atol=1e-9)
            assert np.ptp(targets, axis=0).max() > 0.05, motion


@pytest.mark.parametrize("name", PERIODS)
def test_bullet_holds_it_in_the_air_and_it_follows(name: str) -> None:
    world = BulletWorld(name, {}, floating=False, start_noise=0.0, step=0.001, period=PERIODS[name])
    env = world.make()
    targets = Excitation(robot=name, duration=2.0).commands("triangle_slow", "a", PERIODS[name])
    seen = followed(env, targets)[:, world.layout["position"]]
    env.close()
    load = np.abs(holding(lump(robot(name)), {})).max() / min(kp for kp, _ in robot(name).gains.values())
    assert np.isfinite(seen).all() and np.abs(seen[-1] - targets[-1]).max() < 0.03 + 2.0 * load


def test_a_robot_without_feet_tells_no_foot_force() -> None:
    layout: Layout = BulletWorld("so101", {}, floating=False).layout
    assert "foot_force" not in layout.sizes and layout.size == 2 * 6 + 3 + 10


def test_a_robot_may_widen_what_an_effect_documents() -> None:
    assert {"command_latency", "backlash"} <= robot("so101").ranges.keys() and not robot("nao").ranges
