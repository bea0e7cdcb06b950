"""Every effect works from the command line in Bullet, does nothing at its neutral value, and is written up."""

import runpy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import STANCE, followed, held, walked

from gsl.commandline.composer import compose
from gsl.commandline.config import resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.core.described import restore
from gsl.core.plant import Plant, nominal
from gsl.core.setting import Setting, settings_of
from gsl.effects.effect import KINDS, apply_all, build, effect_class, names
from gsl.errors import ConfigError
from gsl.robots.nao import nao
from gsl.testing import check_effect
from gsl.worlds.bullet import BulletEnv, BulletWorld
from gsl.worlds.fits import check_plant

pytestmark = pytest.mark.slow

TABLE = (
    "command_latency", "target_smoothing", "deadband", "quantisation", "action_noise", "servo_gain",
    "coulomb_friction", "viscous_friction", "stribeck_friction", "load_friction", "backlash", "joint_compliance",
    "torque_limit", "supply_sag", "duty_loss", "gain_fade", "torque_noise", "armature", "zero_offset", "sensor_bias",
    "encoder_noise", "sensor_delay", "joint_limit", "link_mass", "centre_of_mass", "gravity_tilt", "external_push",
    "ground_friction", "ground_compliance", "uneven_ground",
)  # the design's, in order  # fmt: skip
CHOSEN: dict[str, dict[str, Any]] = {
    "external_push": {"start": 0.1, "duration": 0.2},
    "joint_limit": {"side": "both"},
}
NEUTRAL: dict[str, dict[str, Any]] = {
    "ground_friction": {"friction": 0.8},  # the soles' own
    "uneven_ground": {"height": 0.0, "spacing": 0.1},
}
HARD = "ground_compliance"  # its neutral value is an endless stiffness


def chosen(name: str) -> dict[str, Any]:
    """What no range says."""
    place = {"link": "LHand"} if "link" in settings_of(effect_class(name)) else {}
    return {**place, **CHOSEN.get(name, {})}


def numbers(name: str) -> dict[str, Setting]:
    """The settings of an effect that have a range and are not chosen."""
    settings = settings_of(effect_class(name)).items()
    return {key: option for key, option in settings if option.lower is not None and key not in chosen(name)}


def halfway(name: str) -> dict[str, Any]:
    """Values between doing nothing and the upper end of the documented range."""
    start = {key: number.neutral or 0.0 for key, number in numbers(name).items()} | NEUTRAL.get(name, {})
    middle = {key: 0.5 * (max(start[key], number.lower) + number.upper) for key, number in numbers(name).items()}
    return {**middle, **chosen(name)}


def neutral(name: str) -> dict[str, Any]:
    """Values that do nothing."""
    nothing = {key: number.neutral for key, number in numbers(name).items() if number.neutral is not None}
    return {**halfway(name), **nothing, **NEUTRAL.get(name, {})}


def from_command_line(name: str, entry: dict[str, Any]) -> BulletWorld:
    """A world as `gsl collect` makes it: contact effects on the ground, the others in the air."""
    said = [f"world.effects.{name}.{key}={value}" for key, value in entry.items()]
    on_ground = effect_class(name).kind == "contact"
    where = [f"world.floating={str(on_ground).lower()}", "world.settle=0.1", "world.start_noise=0"]
    with open_hydra(None):
        config = resolve(compose("collect", ["world=nao_ideal", *where, *said]))
    made: BulletWorld = restore(config["world"])
    return made


def log(world: BulletWorld) -> np.ndarray:
    """Observations of a walk's first steps, the arms going round, shape (T + 1, size)."""
    env: BulletEnv = world.make()
    rows = walked(env, 0, 1.0) if world.floating else followed(env, in_the_air(), 0)
    env.close()
    return rows


def in_the_air() -> np.ndarray:
    """A walk's motion or so, and a jump, shape (50, 15)."""
    time = 0.02 * np.arange(50)[:, None]
    actions = STANCE + 0.2 * np.sin(2.0 * np.pi * time + np.arange(15)) - 0.2 * np.sin(np.arange(15))
    actions[25:, [11, 13]] -= 0.4
    return actions


@cache
def clean(on_ground: bool) -> np.ndarray:
    return log(
        from_command_line(
            "ground_friction" if on_ground else "backlash", {"friction": 0.8} if on_ground else {"width": 0.0}
        )
    )


@pytest.mark.parametrize("name", names())
def test_from_the_command_line_it_changes_the_log_and_nothing_at_its_neutral_value(name: str) -> None:
    without = clean(effect_class(name).kind == "contact")
    with_it = log(from_command_line(name, halfway(name)))
    assert np.isfinite(with_it).all()
    rows = min(len(without), len(with_it))
    assert np.abs(with_it[:rows] - without[:rows]).max() > 1e-5
    if name == HARD:
        stiff = log(from_command_line(name, {"stiffness": 1e8, "damping": 0.0}))
        np.testing.assert_allclose(stiff[:20, :15], without[:20, :15], atol=1e-3)
    else:
        np.testing.assert_array_equal(log(from_command_line(name, neutral(name))), without)


@pytest.mark.parametrize("name", ["command_latency", "sensor_delay"])
@pytest.mark.parametrize("delay", [0.002, 0.004, 0.02, 0.04])
def test_the_response_is_continuous_in_a_delay_across_the_periods(name: str, delay: float) -> None:
    def response(value: float) -> np.ndarray:
        env = held({name: {"delay": value}}, settle=0.0).make()
        rows = followed(env, in_the_air()[20:32])[:, env.layout["position"]]
        env.close()
        return rows

    before, after, far = (response(delay + apart) for apart in (-1e-9, 1e-9, 1e-3))
    assert np.abs(after - before).max() < 1e-5
    assert np.abs(far - before).max() > 1e-3


def test_the_library_has_the_table_of_the_design_in_its_order() -> None:
    assert set(TABLE) <= set(names())
    for kind in KINDS:
        ranks = {name: effect_class(name).rank for name in names() if effect_class(name).kind == kind}
        assert len(set(ranks.values())) == len(ranks), "two effects of a kind have one rank"
        assert sorted(ranks, key=ranks.__getitem__)[: sum(name in ranks for name in TABLE)] == [
            name for name in TABLE if name in ranks
        ]


@pytest.mark.parametrize("name", names())
def test_it_keeps_the_contract_of_an_effect(name: str) -> None:
    check_effect(build({name: [halfway(name)]})[0], neutral=NEUTRAL.get(name))


@pytest.mark.parametrize("page", ["reference/effects", "howto/own-components"])
def test_tables_of_the_docs_say_what_the_classes_declare(page: str) -> None:
    docs = Path(__file__).parents[2] / "docs"
    fill = runpy.run_path(str(docs / "tables.py"))["fill"]
    text = (docs / f"{page}.md").read_text("utf-8")
    assert "<!-- table " in text
    assert fill(text) == text, "run python docs/tables.py"


FACTORS, SQUARES = {"kp", "kd", "limit", "friction"}, {"encoder_noise", "noise", "torque_noise"}
WORST = {"quantum", "lower_stop", "upper_stop", "stribeck_velocity", "roughness", "friction"}


@pytest.mark.parametrize("name", sorted({*TABLE} - {"gravity_tilt"}))
def test_two_entries_add_but_factors_multiply_noises_add_in_square_and_of_some_the_worse_counts(name: str) -> None:
    none, once, twice = (strengths(apply_all(nominal(nao()), build({name: [halfway(name)] * n}))) for n in range(3))
    changed = [key for key in once if not np.array_equal(once[key], none[key])]
    assert changed
    for key in changed:
        wanted = 2.0 * once[key] - none[key]
        if key in FACTORS:
            wanted = once[key] ** 2 / none[key]
        if key in SQUARES:
            wanted = np.sqrt(2.0) * once[key]
        if key in WORST:
            wanted = once[key]
        np.testing.assert_allclose(twice[key], wanted, rtol=1e-9)


def strengths(plant: Plant) -> dict[str, np.ndarray]:
    """Whatever an effect can change, as arrays."""
    parts = {**plant.servo._asdict(), **vars(plant.sensors), "noise": plant.action_noise}
    parts["torque_noise"] = plant.torque_noise
    parts["pushes"] = sum((push.force for push in plant.pushes), np.zeros(3))
    parts["mass"], parts["com"] = plant.robot.links["LHand"].mass, plant.robot.links["LHand"].com
    parts["roughness"], parts["friction"] = plant.contact.roughness, plant.contact.ground_friction
    parts["give"] = 0.0 if plant.contact.stiffness is None else 1.0 / plant.contact.stiffness
    parts["gravity"] = plant.gravity
    return {key: np.atleast_1d(value).astype(float) for key, value in parts.items()}


def test_gravity_turned_twice_is_turned_by_both_angles() -> None:
    for axis in ("roll", "pitch"):
        once, twice = (
            apply_all(nominal(nao()), build({"gravity_tilt": entries})).gravity
            for entries in ({axis: 0.15}, [{axis: 0.05}, {axis: 0.1}])
        )
        np.testing.assert_allclose(twice, once, atol=1e-12)


def test_two_stictions_leave_their_mean_velocity_whichever_comes_first() -> None:
    entries = [{"torque": 0.1, "velocity": 0.1}, {"torque": 0.3, "velocity": 0.5}]
    for order in (entries, entries[::-1]):
        servo = apply_all(nominal(nao()), build({"stribeck_friction": order})).servo
        np.testing.assert_allclose(servo.stribeck, 0.4)
        np.testing.assert_allclose(servo.stribeck_velocity, 0.4)


@pytest.mark.parametrize(
    ("effects", "line"),
    [
        ({"joint_limit": {"reduction": 0.6, "joints": "LKneePitch"}}, None),
        ({"joint_limit": {"reduction": 1.2, "joints": "LKneePitch"}}, "LKneePitch moves from .*leave no room"),
        ({"joint_limit": {"reduction": 0.1, "side": "left"}}, "effects.joint_limit.side"),
        ({"external_push": {"link": "LHnd", "start": 0.0, "duration": 0.1}}, "LHnd.*did you mean LHand"),
        ({"centre_of_mass": {"link": "torsso"}}, "torsso.*did you mean torso"),
        ({"ground_compliance": {"stiffness": 0.0}}, "effects.ground_compliance.stiffness.*above 0"),
        ({"uneven_ground": {"height": 0.01, "spacing": 0.0}}, "effects.uneven_ground.spacing.*at least 0.02"),
        ({"command_latency": {"delay": 0.15}}, None),
        ({"command_latency": [{"delay": 0.3}] * 9}, "effects.command_latency.delay = 2.7: at most 2.54 s"),
        ({"sensor_delay": {"delay": 0.512}}, None),
        ({"sensor_delay": {"delay": 0.513}}, "effects.sensor_delay.delay = 0.513: at most 0.512 s"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_a_line(effects: dict[str, Any], line: str | None) -> None:
    if line is None:
        held(effects)
        return
    with pytest.raises(ConfigError, match=line) as caught:
        held(effects)
    assert "\n" not in str(caught.value)


def test_play_without_a_rotor_is_refused_and_a_rotor_helps() -> None:
    bare = nominal(nao()).with_servo(armature=np.zeros(16))
    with pytest.raises(ConfigError, match="effects.backlash.joints: LHipYawPitch has no rotor; effects.armature"):
        check_plant(apply_all(bare, build({"backlash": {"width": 0.01}})), 0.002, 0.02)
    check_plant(apply_all(bare, build({"backlash": {"width": 0.01}, "armature": {"inertia": 0.01}})), 0.002, 0.02)
