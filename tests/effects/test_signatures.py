"""Every effect leaves in a log what its file says: on a test stand, where closed forms are known, or in Bullet."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import stand
from bodies import STANCE, followed, held, walked, world
from stand import KP, LIMIT, PERIOD, STEP, run

from gsl.effects.effect import names
from gsl.robots.nao import CONTROLLED, nao
from gsl.worlds.bullet import BulletEnv
from gsl.worlds.drive_train import ROTOR_SHARE, TOOTH_STIFFNESS

pytestmark = pytest.mark.slow

SHOULDER, KNEE = CONTROLLED.index("LShoulderPitch"), CONTROLLED.index("LKneePitch")
ARM_KP = 0.35 * 150.0
HAND = 0.105 + 0.05595 + 0.03434  # from the shoulder to the centre of mass of the hand, arm stretched [m]
LEVEL = np.where(np.arange(15) == SHOULDER, 0.0, STANCE)  # the left arm stretched out ahead
G = 9.81


def seen(make: Callable[..., object], effects: dict, actions: np.ndarray, *parts: str, seed: int = 0) -> np.ndarray:
    """Columns of an observation while actions are issued in a world in Bullet."""
    env: BulletEnv = make(effects).make()
    rows = followed(env, actions, seed)
    env.close()
    return np.column_stack([rows[:, env.layout[part]] for part in parts or ("position",)])


def standing(effects: dict, *parts: str, seconds: float = 1.0) -> np.ndarray:
    return seen(lambda e: world(e, start_noise=0.0), effects, np.tile(STANCE, (round(seconds / 0.02), 1)), *parts)


def droop(effects: dict) -> float:
    """How much more the stretched arm hangs than without the effects, at rest [rad]."""
    hanging = [seen(held, each, np.tile(LEVEL, (80, 1)))[-1, SHOULDER] for each in ({}, effects)]
    return float(hanging[1] - hanging[0])


def lag(effects: dict, targets: np.ndarray, load: float = 0.0) -> float:
    """How much further behind the end of the targets it is with the effects than without [rad]."""
    return float(run({}, targets, load).told[-1] - run(effects, targets, load).told[-1])


# command


def test_command_latency_is_late_in_proportion_to_speed_and_shifts_in_time() -> None:
    late = {"command_latency": {"delay": 0.035}}
    for speed in (0.5, 1.0, 2.0):
        assert lag(late, stand.ramp(speed, 0.8)) == pytest.approx(0.035 * speed, rel=1e-3)
    assert lag(late, stand.held(0.3, 1.0)) == pytest.approx(0.0, abs=1e-12)
    direct, shifted = (
        run(each, stand.step(0.2), every_step=True).told for each in ({}, {"command_latency": {"delay": 0.04}})
    )
    np.testing.assert_allclose(shifted[20:], direct[:-20], atol=1e-12)


def test_target_smoothing_sets_off_at_once_and_is_63_percent_there_after_the_time_constant() -> None:
    effect, targets = {"target_smoothing": {"time_constant": 0.1}}, stand.step(0.1)
    target = run(effect, targets, locked=True, every_step=True).torque / KP
    np.testing.assert_allclose(target[50:], 0.1 * (1.0 - np.exp(-np.arange(1, 451) * STEP / 0.1)), rtol=1e-9)
    direct, smooth = (run(each, targets, every_step=True).told for each in ({}, effect))
    filtered = np.zeros_like(direct)
    for k in range(1, len(direct)):
        filtered[k] = filtered[k - 1] + (1.0 - np.exp(-STEP / 0.1)) * (direct[k] - filtered[k - 1])
    np.testing.assert_allclose(smooth, filtered, atol=1e-9)
    assert np.flatnonzero(smooth)[0] == np.flatnonzero(direct)[0]


def test_deadband_leaves_a_band_of_errors_and_a_loaded_joint_hangs_lower_by_its_width() -> None:
    effect = {"deadband": {"width": 0.02}}
    np.testing.assert_array_equal(run(effect, stand.step(0.019)).true, 0.0)
    for height in (-0.2, 0.2):
        assert abs(run(effect, stand.step(height, 2.0)).told[-1] - height) <= 0.02 + 1e-6
    for load in (-0.4, 0.2, 0.4):
        error = -run(effect, stand.held(0.1, 2.0), load).told[-1] + 0.1
        assert error == pytest.approx(-load / KP - np.sign(load) * 0.02, rel=1e-3)


def test_quantisation_makes_a_slow_ramp_a_staircase_of_its_step() -> None:
    ends = np.random.default_rng(0).uniform(-0.5, 0.5, 5)
    for end in ends:
        assert run({"quantisation": {"step": 0.05}}, stand.held(end, 1.0)).told[-1] == pytest.approx(
            0.05 * np.rint(end / 0.05), abs=1e-6
        )
    position = run({"quantisation": {"step": 0.05}}, stand.ramp(0.05, 6.0)).told
    resting = np.abs(position - 0.05 * np.rint(position / 0.05)) < 1e-4
    assert resting.mean() > 0.5
    assert set(np.rint(position[resting] / 0.05)) == set(range(7))


def repeats(effect: dict) -> np.ndarray:
    """Deviations of the joints in repeats of one command, shape (12, 15, 21)."""
    env = held(effect, settle=0.0).make()
    rows = np.array([followed(env, np.tile(STANCE, (20, 1)), seed)[:, :15].T for seed in range(12)])
    env.close()
    return rows - rows.mean(axis=0)


def test_action_noise_grows_and_encoder_noise_does_not() -> None:
    moved, logged = repeats({"action_noise": {"sd": 0.02}}), repeats({"encoder_noise": {"sd": 0.002}})
    assert moved[..., 0].std() < 1e-12
    assert 0.0 < moved[..., 1].std() < 0.85 * moved[..., 10:].std()
    assert logged.std() == pytest.approx(0.002 * np.sqrt(11 / 12), rel=0.05)
    assert np.mean(moved[..., 5:-1] * moved[..., 6:]) > 0.2 * moved[..., 5:].var()
    assert abs(np.mean(logged[..., :-1] * logged[..., 1:])) < 0.05 * logged.var()


def test_torque_noise_is_constant_in_an_episode_and_gives_way_to_gain() -> None:
    def ends(effects: dict) -> np.ndarray:
        return np.array([seen(held, effects, np.tile(LEVEL, (60, 1)), seed=seed)[[-20, -1]] for seed in range(4)])

    soft, stiff = ({"servo_gain": {"kp": kp}} for kp in (0.5, 1.0))
    noise = {"torque_noise": {"constant": 0.1}}
    moved = [ends({**gain, **noise}) - ends(gain) for gain in (soft, stiff)]
    np.testing.assert_allclose(moved[1][:, 0], moved[1][:, 1], atol=1e-5)
    assert moved[0].std() / moved[1].std() == pytest.approx(2.0, rel=0.05)
    assert repeats({"torque_noise": {"step": 0.3}})[..., 1:].std() > 1e-5


# servo


def test_servo_gain_kp_bends_under_load_and_kd_damps() -> None:
    for factor in (0.5, 1.5):
        position = run({"servo_gain": {"kp": factor}}, stand.held(0.0, 2.0), 0.3).told
        assert position[-1] == pytest.approx(0.3 / (factor * KP), rel=1e-3)
    peaks = [
        run({"servo_gain": {"kd": factor}}, stand.step(0.1), every_step=True).told.max() for factor in (1.0, 0.6, 0.3)
    ]
    assert 0.1 <= peaks[0] < peaks[1] < peaks[2]


def test_coulomb_friction_lags_alike_at_every_speed_and_holds_in_a_band() -> None:
    dry = {"coulomb_friction": {"torque": 0.2}}
    for speed in (0.2, 0.5, 1.0):
        assert lag(dry, stand.ramp(speed, 1.2)) == pytest.approx(0.2 / KP, rel=1e-3)
    for start in (-0.3, 0.3):
        targets = np.r_[start, np.linspace(start, 0.0, 100), np.zeros(50)]
        assert run(dry, targets).told[-1] == pytest.approx(np.sign(start) * 0.2 / KP, rel=0.05)
    assert abs(run(dry, stand.step(0.8 * 0.2 / KP)).true).max() < 1e-3, "a step in the band moves the bristle alone"


def test_viscous_friction_lags_in_proportion_to_speed() -> None:
    for speed in (0.2, 0.5, 1.0):
        assert lag({"viscous_friction": {"coefficient": 0.3}}, stand.ramp(speed, 1.5)) == pytest.approx(
            0.3 * speed / KP, rel=1e-3
        )
    assert lag({"viscous_friction": {"coefficient": 0.3}}, stand.step(0.1, 3.0)) == pytest.approx(0.0, abs=1e-6)


def test_stribeck_friction_lags_at_low_speed_alone() -> None:
    sticky = {"stribeck_friction": {"torque": 0.2, "velocity": 0.3}}
    for speed in (0.05, 0.1, 0.3):
        assert lag(sticky, stand.ramp(speed, 3.0)) == pytest.approx(0.2 * np.exp(-((speed / 0.3) ** 2)) / KP, rel=0.02)
    assert abs(lag(sticky, stand.ramp(1.5, 1.0))) < 0.01 * 0.2 / KP


@pytest.mark.parametrize("load", [0.2, 0.4, 0.8])
def test_load_friction_parts_lifting_from_lowering_in_proportion_to_the_load(load: float) -> None:
    """Lifting, the gear passes load + friction: friction = c (2 load + friction); lowering, c (2 load - friction)."""
    c, effect = 0.15, {"load_friction": {"coefficient": 0.15}}
    lifting, lowering = (lag(effect, stand.ramp(speed, 1.5), -load) for speed in (0.3, -0.3))
    assert lifting == pytest.approx(2.0 * c * load / (1.0 - c) / KP, rel=0.02)
    assert lowering == pytest.approx(-2.0 * c * load / (1.0 + c) / KP, rel=0.02)


def test_backlash_is_a_hysteresis_of_its_width_and_gone_under_a_load_bias() -> None:
    loose = {"backlash": {"width": 0.02}}
    for height in (0.2, 0.4):
        slow = stand.sine(height, 0.25, 6.0)
        log = run({**loose, "coulomb_friction": {"torque": 0.2}}, slow, encoder_side="motor")
        for way in (-1.0, 1.0):
            speed = way * np.gradient(log.told)
            behind = (log.told - log.true)[speed > 0.85 * speed.max()]
            np.testing.assert_allclose(behind, way * (0.5 * 0.02 + 0.2 / TOOTH_STIFFNESS), atol=5e-4)
    quick = stand.sine(0.05, 1.0, 3.0)
    off = {load: np.std(run(loose, quick, load).told - run({}, quick, load).told) for load in (0.0, 1.0)}
    assert off[1.0] < 5e-4 < 2e-3 < off[0.0]


def test_torque_limit_slows_a_large_step_and_leaves_a_small_one_alone() -> None:
    weak = {"torque_limit": {"factor": 0.5}}
    small, large = stand.step(0.05), stand.step(1.0)
    np.testing.assert_array_equal(run(weak, small).told, run({}, small).told)
    first = run(weak, large, every_step=True).told[50]
    assert first == pytest.approx(0.5 * LIMIT / (stand.LINK + stand.ARMATURE) * STEP**2)
    assert run({}, large).told[10] > run(weak, large).told[10] + 0.1


def test_supply_sag_troubles_all_joints_together_more_than_one_alone() -> None:
    sagging, n = {"supply_sag": {"resistance": 2.0}}, 4
    alone = np.stack([stand.step(1.0), *[np.zeros(50)] * (n - 1)], axis=1)
    slower = [
        np.abs(run(sagging, path, joints=n).told - run({}, path, joints=n).told)[:, 0].max()
        for path in (alone, stand.step(1.0))
    ]
    assert 0.0 < 2.0 * slower[0] < slower[1]
    stalled = run(sagging, stand.step(9.0), locked=True, joints=n).torque[-1]
    loss = 2.0 / stand.VOLTAGE * n / stand.TORQUE_CONSTANT
    np.testing.assert_allclose(stalled, LIMIT / (1.0 + loss * LIMIT), rtol=1e-3)


@pytest.mark.parametrize("load", [0.3, 0.6, 0.7])
def test_duty_loss_makes_the_error_grow_faster_than_the_load(load: float) -> None:
    """At rest u (1 - c u / limit) = load, which is a quadratic equation for u = kp error."""
    wanted = (1.0 - np.sqrt(1.0 - 4.0 * 0.5 * load / LIMIT)) / (2.0 * 0.5 / LIMIT)
    assert run({"duty_loss": {"coefficient": 0.5}}, stand.held(0.0, 3.0), load).told[-1] == pytest.approx(
        wanted / KP, rel=1e-3
    )


def test_gain_fade_bends_more_and_more_in_the_course_of_an_episode() -> None:
    position = run({"gain_fade": {"rate": 0.1}}, stand.held(0.0, 5.0), 0.3).told
    for seconds in (2.0, 3.5, 5.0):
        assert position[round(seconds / PERIOD)] == pytest.approx(0.3 / (KP * (1.0 - 0.1 * seconds)), rel=0.03)


# body


def test_joint_compliance_hides_from_a_motors_encoder_and_rings_at_an_outputs() -> None:
    soft, load = {"joint_compliance": {"compliance": 0.02}}, 0.5
    motor = run(soft, stand.held(0.0, 3.0), load, encoder_side="motor")
    assert motor.told[-1] == pytest.approx(load / KP, rel=1e-3)
    assert motor.true[-1] == pytest.approx(load / KP + load * 0.02, rel=1e-3)
    calm = (KP, 0.4)  # with as much kd as usual it never comes to rest
    assert run(soft, stand.held(0.0, 3.0), load, gains=calm).true[-1] == pytest.approx(load / KP, rel=1e-2)
    rotor, rest = ROTOR_SHARE * stand.ARMATURE, stand.LINK + (1.0 - ROTOR_SHARE) * stand.ARMATURE
    spring, product = (rotor + rest) / 0.02, rotor * rest
    squared = (spring + np.sqrt(spring**2 - 4.0 * product * KP / 0.02)) / (2.0 * product)  # without kd
    quick = stand.sine(0.02, np.sqrt(squared) / (2.0 * np.pi), 3.0)
    rigid, resonant = (np.ptp(run(each, quick, gains=calm).told[75:]) / np.ptp(quick) for each in ({}, soft))
    assert rigid < 0.1 and resonant > 1.0, "above 0 dB"


def test_armature_sets_off_slower_and_overshoots_more_and_does_nothing_at_rest() -> None:
    heavy, targets = {"armature": {"inertia": 0.02}}, stand.step(0.1)
    first = [run(each, targets, every_step=True).told[50] for each in ({}, heavy)]
    rigid = stand.LINK + stand.ARMATURE
    assert first[0] / first[1] == pytest.approx((rigid + 0.02) / rigid)
    assert run(heavy, targets).told.max() > run({}, targets).told.max() + 1e-3
    assert lag(heavy, stand.held(0.2, 3.0), 0.4) == pytest.approx(0.0, abs=1e-5)


def test_zero_offset_moves_the_joint_and_the_log_shows_it() -> None:
    for load in (0.0, 0.4):
        log = run({"zero_offset": {"offset": 0.05}}, stand.held(0.2, 2.0), load)
        assert log.true[-1] == log.told[-1] == pytest.approx(0.25 + load / KP, abs=1e-5)
    leaning = [
        standing(each, "base.orientation")[-1] for each in ({}, {"zero_offset": {"offset": 0.03, "joints": "legs"}})
    ]
    assert np.abs(leaning[1] - leaning[0]).max() > 0.01


def test_joint_limit_clips_on_one_side() -> None:
    swing, effect = stand.sine(stand.REACH - 0.05, 0.2, 5.0), {"joint_limit": {"reduction": 0.5, "side": "upper"}}
    clean, clipped = run({}, swing).told, run(effect, swing).told
    stop = stand.REACH - 0.5
    assert clipped.max() == pytest.approx(stop, abs=1.02 * LIMIT / 500.0)
    inside = np.flatnonzero(clean > stop)[0]
    np.testing.assert_array_equal(clipped[:inside], clean[:inside])
    assert clipped.min() == pytest.approx(clean.min(), abs=1e-3)


def test_link_mass_bends_the_arm_by_its_moment() -> None:
    for mass in (0.1, 0.2):
        assert droop({"link_mass": {"link": "LHand", "mass": mass}}) == pytest.approx(
            mass * G * HAND / ARM_KP, rel=0.03
        )


def test_centre_of_mass_bends_the_arm_by_its_shift() -> None:
    hand = nao().links["LHand"].mass
    assert droop({"centre_of_mass": {"link": "LHand", "x": 0.02}}) == pytest.approx(hand * G * 0.02 / ARM_KP, rel=0.03)
    assert abs(droop({"centre_of_mass": {"link": "LHand", "y": 0.02}})) < 1e-4, "beside the axis it has no lever"


# contact


def test_ground_friction_decides_at_which_slope_the_robot_slides() -> None:
    def far(friction: float) -> float:
        slope = {"ground_friction": {"friction": friction}, "gravity_tilt": {"pitch": -0.15}}
        place = standing(slope, "base.position", seconds=1.0)[:, 0]
        return float(place[-1] - place[0] - (place[1] - place[0]) * 50)

    assert abs(far(0.25)) < 0.01 < np.tan(0.15)
    assert far(0.1) == pytest.approx(0.5 * G * (np.sin(0.15) - 0.1 * np.cos(0.15)), rel=0.1)


def test_on_soft_ground_the_robot_sinks_by_its_weight_on_eight_springs() -> None:
    height = {k: standing({"ground_compliance": {"stiffness": k}}, "base.position")[-1, 2] for k in (3e3, 1e4, 1e8)}
    for stiffness in (3e3, 1e4):
        sunk = height[1e8] - height[stiffness]
        assert sunk == pytest.approx(nao().mass * G / (8.0 * stiffness), rel=0.05)


def test_uneven_ground_makes_repeats_differ_where_feet_touch_and_not_in_the_air() -> None:
    rough = {"uneven_ground": {"height": 0.005}}
    for make, effect, apart in ((world, {}, False), (world, rough, True), (held, rough, False)):
        env = make(effect, **({"start_noise": 0.0} if make is world else {})).make()
        ends = np.array([walked(env, seed, 1.5)[-1, :30] for seed in range(3)])
        env.close()
        assert bool(ends.std(axis=0).max() > 1e-3) is apart


# environment


@pytest.mark.parametrize("pitch", [-0.1, 0.1])
def test_gravity_tilt_pulls_a_hanging_arm_aside(pitch: float) -> None:
    """The arm hangs straight down, where gravity has no lever but what the tilt gives it."""
    down = np.where(np.isin(np.arange(15), (SHOULDER, SHOULDER + 2)), np.pi / 2, STANCE)
    effect = {"gravity_tilt": {"pitch": pitch}}
    moved = np.subtract(*[seen(held, each, np.tile(down, (80, 1)))[-1, SHOULDER] for each in (effect, {})])
    assert moved == pytest.approx(arm_moment() * np.sin(pitch) / ARM_KP, rel=0.03)


def arm_moment() -> float:
    """Weight of the left arm times its reach from the shoulder [N·m]."""
    stretched = seen(held, {}, np.tile(LEVEL, (80, 1)))[-1, SHOULDER]
    return float(stretched * ARM_KP)


def test_external_push_bends_the_arm_by_its_lever_while_it_lasts() -> None:
    push = {"external_push": {"link": "LHand", "z": -2.0, "start": 0.2, "duration": 1.0}}
    actions = np.tile(LEVEL, (120, 1))
    pushed, calm = (seen(held, each, actions)[:, SHOULDER] for each in (push, {}))
    np.testing.assert_array_equal(pushed[:11], calm[:11])
    assert pushed[59] - calm[59] == pytest.approx(2.0 * HAND / ARM_KP, rel=0.02)
    assert abs(pushed[-1] - calm[-1]) < 1e-4


# sensor


def test_sensor_bias_is_in_the_log_and_nowhere_else() -> None:
    biased, clean = (standing(each, "position", "velocity", "base.position", "foot_force") for each in (
        {"sensor_bias": {"bias": 0.03, "joints": "legs"}}, {}))  # fmt: skip
    np.testing.assert_allclose((biased - clean)[:, :11], 0.03, atol=1e-12)
    np.testing.assert_array_equal(biased[:, 11:], clean[:, 11:])


def test_sensor_delay_makes_the_loop_ring_and_the_log_late() -> None:
    old, targets = {"sensor_delay": {"delay": 0.014}}, stand.step(0.1)
    log = run(old, targets, every_step=True)
    np.testing.assert_allclose(log.told[7:], log.true[:-7], atol=1e-12)
    peaks = [
        run({"sensor_delay": {"delay": d}, "servo_gain": {"kd": 0.7}}, targets, every_step=True).true.max()
        for d in (0.0, 0.005, 0.01)
    ]
    assert peaks[0] < peaks[1] < peaks[2]
    assert run({"command_latency": {"delay": 0.02}}, targets).told.max() == pytest.approx(
        run({}, targets).told.max(), abs=1e-6
    )


def test_no_effect_is_forgotten() -> None:
    text = Path(__file__).read_text("utf-8")
    assert {name for name in names() if f'"{name}"' not in text} == set()
