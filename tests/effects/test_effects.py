"""Every effect leaves the signature that it documents, and nothing depends on the order of the yaml."""

import numpy as np
import pytest
from bodies import STANCE, followed, held, walked, world

from gsl.core.plant import Plant, nominal
from gsl.effects.effect import KINDS, apply_all, build, describe_confusion, effect_class, names
from gsl.errors import ConfigError
from gsl.robots.nao import CONTROLLED, nao

KNEE, SHOULDER, ROLL = (CONTROLLED.index(name) for name in ("LKneePitch", "LShoulderPitch", "LShoulderRoll"))
LEVEL = np.where(np.arange(15) == SHOULDER, 0.0, STANCE)  # the left arm stretched out ahead


def positions(effects: dict, actions: np.ndarray) -> np.ndarray:
    env = held(effects).make()
    seen = followed(env, actions)
    env.close()
    return seen[:, env.layout["position"]]


def still(posture: np.ndarray, steps: int = 60) -> np.ndarray:
    return np.tile(posture, (steps, 1))


def moved(joint: int, path: np.ndarray) -> np.ndarray:
    actions = still(STANCE, len(path))
    actions[:, joint] += path
    return actions


def test_latency_is_a_pure_shift_in_time() -> None:
    actions = moved(KNEE, 0.2 * np.sin(0.15 * np.arange(80)))
    direct, late = positions({}, actions), positions({"command_latency": {"delay": 0.04}}, actions)
    np.testing.assert_allclose(late[2:, KNEE], direct[:-2, KNEE], atol=2e-3)
    assert np.abs(late - direct)[:, KNEE].max() > 0.03
    half = positions({"command_latency": {"delay": 0.03}}, actions)
    np.testing.assert_allclose(half[2:, KNEE], 0.5 * (direct[:-2] + direct[1:-1])[:, KNEE], atol=5e-3)


def test_gain_bends_under_load_in_inverse_proportion() -> None:
    droop = {kp: positions({"servo_gain": {"kp": kp}}, still(LEVEL, 150))[-1, SHOULDER] for kp in (1.0, 0.5, 0.25)}
    assert droop[1.0] > 0.005, "the stretched arm hangs a little"
    assert droop[0.5] / droop[1.0] == pytest.approx(2.0, rel=0.03)
    assert droop[0.25] / droop[1.0] == pytest.approx(4.0, rel=0.03)


def test_mass_at_the_hand_makes_the_arm_droop_in_proportion() -> None:
    droop = [
        positions({"link_mass": {"link": "LHand", "mass": m}}, still(LEVEL, 80))[-1, SHOULDER] for m in (0.0, 0.1, 0.2)
    ]
    lever, gain = 0.105 + 0.05595 + 0.03434, 0.35 * 150.0
    assert droop[1] - droop[0] == pytest.approx(0.1 * 9.81 * lever / gain, rel=0.03)
    assert droop[2] - droop[0] == pytest.approx(0.2 * 9.81 * lever / gain, rel=0.03)


def test_dry_friction_holds_inside_a_band_and_hangs_on_at_reversals() -> None:
    slow = 0.1 * np.concatenate(
        [np.linspace(0, 1, 100), np.ones(30), np.linspace(1, -1, 200), np.linspace(-1, 0, 100), np.zeros(30)]
    )
    actions = moved(KNEE, slow)
    clean, dry = positions({}, actions), positions({"coulomb_friction": {"torque": 0.3, "joints": "legs"}}, actions)
    lag = (clean - dry)[:, KNEE]
    assert lag[100] == pytest.approx(0.3 / 150.0, rel=0.15)
    assert lag[300] == pytest.approx(-0.3 / 150.0, rel=0.15)
    assert abs(lag[-1]) == pytest.approx(0.3 / 150.0, rel=0.3), "at rest the error stays"


def test_torque_limit_slows_a_large_step_and_leaves_a_small_one_alone() -> None:
    effect = {"torque_limit": {"factor": 0.5}}
    for height, slower in ((0.005, False), (0.8, True)):
        step = moved(KNEE, np.where(np.arange(30) < 5, 0.0, -height))
        difference = np.abs(positions(effect, step) - positions({}, step))[:, KNEE].max()
        assert bool(difference > 0.05) is slower
        assert slower or difference < 1e-4


def test_play_lets_the_joint_wander_inside_the_gap() -> None:
    actions = still(STANCE, 150)
    tight, loose = positions({}, actions), positions({"backlash": {"width": 0.02, "joints": ["LKneePitch"]}}, actions)
    wander = np.ptp(loose[-60:, KNEE])
    assert np.ptp(tight[-60:, KNEE]) < 1e-4
    assert 1e-4 < wander < 0.03
    other = CONTROLLED.index("RKneePitch")
    assert np.ptp(loose[-60:, other]) < 0.2 * wander


def test_encoder_noise_is_in_the_log_alone() -> None:
    actions = moved(KNEE, 0.1 * np.sin(0.2 * np.arange(200)))
    clean, noisy = held().make(), held({"encoder_noise": {"sd": 0.002, "joints": "arms"}}).make()
    a, b = followed(clean, actions), followed(noisy, actions)
    where = clean.layout["position"]
    noise = (b - a)[:, where]
    assert np.std(noise[:, 11:]) == pytest.approx(0.002, rel=0.08)
    np.testing.assert_array_equal(noise[:, :11], 0.0)
    np.testing.assert_array_equal(np.delete(a, np.r_[where], axis=1), np.delete(b, np.r_[where], axis=1))
    clean.close()
    noisy.close()


def test_on_a_slippery_ground_the_robot_gets_less_far() -> None:
    far = []
    for effects in ({}, {"ground_friction": {"friction": 0.05}}):
        env = world(effects).make()
        seen = walked(env, 0, 2.0)
        far.append(seen[-1, env.layout["base.position"].start] - seen[0, env.layout["base.position"].start])
        env.close()
    assert far[1] < 0.6 * far[0]


def test_ground_friction_is_the_coefficient_between_sole_and_ground() -> None:
    plant = apply_all(nominal(nao()), build({"ground_friction": {"friction": 0.4}}))
    assert plant.contact.ground_friction * plant.contact.foot_friction == pytest.approx(0.4)


def test_the_order_of_the_yaml_does_not_matter() -> None:
    effects = {
        "encoder_noise": {"sd": 0.001},
        "torque_limit": {"factor": 0.8},
        "servo_gain": [{"kp": 0.7, "joints": "legs"}, {"kp": 0.9, "joints": ["LKneePitch"]}],
        "command_latency": {"delay": 0.01},
        "link_mass": {"link": "torso", "mass": 0.3},
    }
    backwards = dict(reversed(effects.items()))
    assert build(effects) == build(backwards)
    first, second = (apply_all(nominal(nao()), build(each)) for each in (effects, backwards))
    np.testing.assert_array_equal(first.servo.kp, second.servo.kp)


def test_an_effect_acts_twice_with_different_scopes() -> None:
    entries = [{"torque": 0.2, "joints": "legs"}, {"torque": 0.1, "joints": ["arms", "LKneePitch"]}]
    coulomb = apply_all(nominal(nao()), build({"coulomb_friction": entries})).servo.coulomb
    motors = nao().motors
    assert coulomb[motors.index("RKneePitch")] == coulomb[motors.index("RHipYawPitch")] == 0.2
    assert coulomb[motors.index("LKneePitch")] == pytest.approx(0.3)
    assert coulomb[motors.index("RShoulderRoll")] == 0.1


def test_the_shared_hip_joint_is_one_scope() -> None:
    mask = nominal(nao()).mask("LHipYawPitch")
    assert mask.sum() == 2 and mask[nao().motors.index("RHipYawPitch")]


@pytest.mark.parametrize(
    ("effects", "line"),
    [
        ({"backlsh": {"width": 0.01}}, "effects.backlsh.*did you mean backlash"),
        ({"backlash": {"width": 0.01, "joints": "LKneePich"}}, "LKneePich.*did you mean LKneePitch"),
        ({"link_mass": {"link": "LFot", "mass": 0.1}}, "LFot.*did you mean LFoot"),
        ({"link_mass": {"link": "torso", "mass": -2.0}}, "leaves nothing"),
        ({"backlash": {"width": -0.1}}, "effects.backlash.width.*at least 0"),
        ({"backlash": {"wdth": 0.1}}, "effects.backlash.wdth.*did you mean width"),
        ({"backlash": 0.1}, "effects.backlash.*0.1"),
    ],
)
def test_what_does_not_exist_or_cannot_be_is_named(effects: dict, line: str) -> None:
    with pytest.raises(ConfigError, match=line):
        apply_all(nominal(nao()), build(effects))


def test_every_effect_of_the_library_can_be_found() -> None:
    assert {"backlash", "command_latency", "coulomb_friction", "encoder_noise"} < set(names())
    for name in names():
        assert effect_class(name).kind in KINDS


def test_a_users_own_effect_stands_beside_ours() -> None:
    class Stiff:
        kind, rank = "servo", 99

        def apply(self, plant: Plant) -> Plant:
            return plant.with_servo(kp=2.0 * plant.servo.kp)

    both = build({"mine": Stiff(), "servo_gain": {"kp": 0.5}})
    np.testing.assert_array_equal(apply_all(nominal(nao()), both).servo.kp, nominal(nao()).servo.kp)


@pytest.mark.parametrize("name", names())
def test_every_effect_says_what_tells_it_from_others(name: str) -> None:
    text = describe_confusion(name)
    assert len(text) > 40 and not text.endswith(".")
