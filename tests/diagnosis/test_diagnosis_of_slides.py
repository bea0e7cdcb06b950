"""A robot of a hinge and two slides: in angles it is the same robot, and it is diagnosed in metres and newtons."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from both_engines import PERIOD, window
from commands import done
from swinging_arm import KEPT, QUICK

from gsl.commandline.unusual_effects import list_unusual
from gsl.core.body import Joint, Link, Robot
from gsl.core.plant import Plant, nominal
from gsl.core.slides import in_angles, in_metres, levers, power, unit_of_slide
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.angles import effects_in_metres, say, with_log_in_angles
from gsl.diagnosis.diagnose import diagnose
from gsl.diagnosis.log.files import check_log
from gsl.diagnosis.log.records import slope
from gsl.diagnosis.simulate.in_the_air import change
from gsl.diagnosis.verdict.document import document
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.wiring.audit import Audit, audit
from gsl.effects.effect import effect_class, list_documented, names
from gsl.errors import InputError
from gsl.models.servo import NUMBERS, neutral
from gsl.worlds.held import Held

pytestmark = pytest.mark.slow

STEP, NOISE = 0.002, 1e-4
SIZE = 0.25  # of the rail, as of every slide of half a metre or more [m]
FEW = replace(QUICK, without=tuple(sorted({*names()} - KEPT - {"deadband", "backlash"})))


@cache
def gantry() -> Robot:
    """A cart on a rail, a pendulum on it, a gripper at its end whose second finger mirrors the first."""
    links = [
        Link("base", 5.0, np.zeros(3), 0.1 * np.eye(3)),
        Link("cart", 1.0, np.zeros(3), 4e-3 * np.eye(3)),
        Link("pole", 0.3, np.array([0.02, 0.0, -0.1]), 1e-3 * np.eye(3)),
        Link("left", 0.1, np.zeros(3), 1e-4 * np.eye(3)),
        Link("right", 0.1, np.zeros(3), 1e-4 * np.eye(3)),
    ]
    x, y, slide = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), {"slides": True}
    tip = np.array([0.0, 0.0, -0.2])
    joints = (
        Joint("rail", "base", "cart", np.zeros(3), (x + 0.5 * np.array([0.0, 0.0, 1.0])) / np.hypot(1.0, 0.5),
              -0.4, 0.4, 1.5, 40.0, 0.5, **slide),
        Joint("swing", "cart", "pole", np.zeros(3), y, -1.5, 1.5, 6.0, 3.0, 0.005),
        Joint("grip", "pole", "left", tip, y, -0.02, 0.02, 0.5, 20.0, 0.4, **slide),
        Joint("other", "pole", "right", tip, -y, -0.03, 0.03, 0.5, 20.0, 0.4, **slide),
    )  # fmt: skip
    gains = {"rail": (1000.0, 40.0), "swing": (40.0, 1.0), "grip": (4000.0, 60.0), "other": (4000.0, 60.0)}
    named = {link.name: link for link in links}
    return Robot(
        "gantry", named, joints, ("rail", "swing", "grip"), coupled={"other": "grip"}, gains=gains, encoder_step=4e-4
    )


def motions() -> dict[str, np.ndarray]:
    """Steps, triangles and a chirp, two variants of each, in shares of each joint's size, shape (T, 4)."""
    time, paths = PERIOD * np.arange(150), {}
    for variant, (size, phase) in {"a": (1.0, 0.0), "b": (0.8, 1.0)}.items():
        stairs = [np.repeat(np.random.default_rng([k, ord(variant)]).uniform(-1, 1, 6), 25) for k in range(3)]
        wave = [np.sin(2 * np.pi * 0.6 * time + phase + k) for k in range(3)]
        chirp = [np.sin(2 * np.pi * (0.5 + 0.7 * time) * time + phase + k) for k in range(3)]
        shapes = {"steps": 0.4, "triangle": 0.7, "chirp": 0.3}
        for (name, share), columns in zip(shapes.items(), (stairs, wave, chirp), strict=True):
            paths[f"{name}_{variant}"] = share * size * np.array(columns).T * np.minimum(1.0, time / 0.3)[:, None]
    return {name: path[:, [0, 1, 2, 2]] * [SIZE, 1.0, 0.02, 0.02] for name, path in paths.items()}


def logged(effects: Mapping[str, Any]) -> Batch:
    """What the gantry with effects logs; one motion is played twice."""
    rng, played = np.random.default_rng(1), motions()
    order, held = [*played, "steps_a"], Held.of(change(nominal(gantry()), effects), STEP, PERIOD)
    paths = held.play([played[name] for name in order], [played[name][0] for name in order], 25)
    episodes = []
    for name, path in zip(order, paths, strict=True):
        position = path[:, :3] + NOISE * np.array([1.0, 4.0, 0.1]) * rng.standard_normal((len(path), 3))
        episodes.append(
            Trajectory(PERIOD * np.arange(len(path)), played[name][:, :3], position, slope(position, PERIOD))
        )
    about = {"episodes": [{"policy": name} for name in order], "world": {"step": STEP}}
    return Batch(tuple(episodes), gantry().controlled, PERIOD, about)


@cache
def found(effect: str = "", joint: str = "rail", **parameters: float) -> Findings:
    effects = {effect: {**parameters, "joints": joint}} if effect else {}
    return diagnose(logged(effects), nominal(gantry()), STEP, FEW, lambda _: None)


def same(first: Plant, second: Plant) -> None:
    for name in first.servo._fields:
        np.testing.assert_allclose(getattr(first.servo, name), getattr(second.servo, name), rtol=1e-9, err_msg=name)
    for name in ("action_noise", "torque_noise"):
        np.testing.assert_allclose(getattr(first, name), getattr(second, name), rtol=1e-9)
    for name in ("encoder_noise", "bias"):
        np.testing.assert_allclose(getattr(first.sensors, name), getattr(second.sensors, name), rtol=1e-9)


@pytest.mark.parametrize(
    ("unit", "exponent", "of_a_slide"),
    [
        ("rad", -1, "m"), ("rad/s", -1, "m/s"), ("N·m", 1, "N"), ("N·m/rad", 2, "N/m"), ("N·m·s/rad", 2, "N·s/m"),
        ("kg·m²", 2, "kg"), ("rad/(N·m)", -2, "m/N"), ("N·m/A", 1, "N/A"), ("s", 0, "s"), ("", 0, ""), ("Ω", 0, "Ω"),
    ],
)  # fmt: skip
def test_a_unit_says_how_a_number_goes_with_the_size_of_a_slide(unit: str, exponent: int, of_a_slide: str) -> None:
    assert (power(unit), unit_of_slide(unit)) == (exponent, of_a_slide)


def test_one_number_for_hinges_and_slides_says_what_it_is_of_a_slide() -> None:
    robot = in_angles(nominal(gantry())).robot
    unit = "rad/(N·m)"
    assert say(robot, robot.controlled, unit)[1] == f"{unit} (1 {unit} stands for 0.0004 to 0.0625 m/N of a slide)"
    assert say(robot, robot.controlled[:2], "N·m")[1] == "N·m (1 N·m stands for 4 N of a slide)"


SMALL: dict[str, Any] = {
    "coulomb_friction": {"torque": 0.1}, "viscous_friction": {"coefficient": 0.3}, "backlash": {"width": 2e-4},
    "deadband": {"width": 1e-4}, "quantisation": {"step": 1e-4}, "joint_limit": {"reduction": 5e-3},
    "joint_compliance": {"compliance": 1e-4, "joints": "rail"}, "load_friction": {"coefficient": 0.1},
    "command_latency": {"delay": 0.013}, "stribeck_friction": {"torque": 0.1, "velocity": 0.1},
    "supply_sag": {"resistance": 0.05}, "sensor_bias": {"bias": 1e-3}, "zero_offset": {"offset": 1e-3},
    "torque_limit": {"factor": 0.5},
}  # fmt: skip


@pytest.mark.parametrize("effect", SMALL)
def test_in_angles_it_moves_as_in_metres(effect: str) -> None:
    plant = change(nominal(gantry()), {effect: SMALL[effect]})
    angular, targets = in_angles(plant), motions()["steps_a"]
    way = levers(angular.robot)
    np.testing.assert_allclose(way, [SIZE, 1.0, 0.02, 0.02])  # a finger takes its leader's commands
    metres = Held.of(plant, STEP, PERIOD).replay(window(targets))[0]
    angles = Held.of(angular, STEP, PERIOD).replay(window(targets / way))[0]
    ticks = 30 if effect == "backlash" else len(targets)  # rounding grows where teeth meet
    np.testing.assert_allclose((angles * way)[:ticks], metres[:ticks], atol=1e-9)
    same(in_metres(angular), plant)
    assert in_angles(angular) is angular


def test_a_learned_servo_is_the_same_in_metres() -> None:
    plant, rng = nominal(gantry()), np.random.default_rng(3)
    angular, targets = in_angles(plant), motions()["chirp_a"]
    way, model = levers(angular.robot), neutral(angular, rng)
    assert model.groups == ("slides", "others")
    numbers = {name: np.abs(0.01 * rng.standard_normal(4)) for name in NUMBERS}
    network = {name: 0.05 * rng.standard_normal(values.shape) for name, values in model.network.items()}
    learned = replace(model, numbers=numbers, network=network, lag=0.02 * rng.standard_normal(model.lag.shape))
    metric = learned.in_metres(angular, plant).on(plant)
    same(in_angles(metric), learned.on(angular))
    metres = Held.of(metric, STEP, PERIOD).replay(window(targets))[0]
    angles = Held.of(learned.on(angular), STEP, PERIOD).replay(window(targets / way))[0]
    np.testing.assert_allclose(angles * way, metres, atol=1e-9)
    assert np.abs(metres - Held.of(plant, STEP, PERIOD).replay(window(targets))[0]).max() > 1e-3


@pytest.mark.parametrize("effect", [name for name in names() if hasattr(effect_class(name), "joints")])
@pytest.mark.parametrize("scope", ["all", "rail", ["swing", "grip"]])
def test_an_effect_in_angles_is_one_in_metres(effect: str, scope: Any) -> None:
    angular = in_angles(nominal(gantry()))
    ranges = list_documented(effect, angular.robot).items()
    entry: dict[str, Any] = {"joints": scope}
    entry |= {key: 0.3 * each.lower + 0.7 * each.upper for key, each in ranges if each.upper is not None}
    scaled = effects_in_metres({effect: [entry]}, angular.robot)
    same(in_metres(change(angular, {effect: [entry]})), change(nominal(gantry()), scaled))


def test_a_log_goes_into_angles_with_its_torques_and_conditions() -> None:
    log = logged({})
    torque = np.full(151, 8.0)
    about = {"episodes": [{"conditions": {"backlash": {"width": 0.002, "joints": "rail"}}}] * len(log)}
    episodes = tuple(replace(episode, sensors={"torque.rail": torque, "gyro.x": torque}) for episode in log.episodes)
    angular, plant = with_log_in_angles(replace(log, episodes=episodes, metadata=about), nominal(gantry()))
    first, before = angular.episodes[0], log.episodes[0]
    np.testing.assert_allclose(first.position * [SIZE, 1.0, 0.02], before.position)
    np.testing.assert_allclose(first.velocity * [SIZE, 1.0, 0.02], before.velocity)
    assert (first.sensors["torque.rail"][0], first.sensors["gyro.x"][0]) == pytest.approx((8.0 * SIZE, 8.0))
    ((entry,),) = (label["conditions"]["backlash"] for label in angular.metadata["episodes"][:1])
    assert entry == {"width": pytest.approx(0.008), "joints": "rail"}
    assert with_log_in_angles(angular, plant) == (angular, plant)


def test_no_effect_is_no_gap() -> None:
    assert found().verdict.word == "no_gap"


CAUSES = {
    "servo_gain": ({"kp": 0.7}, "kp", 0.7, "×"),
    "command_latency": ({"delay": 0.03}, "delay", 0.03, "s"),
    "coulomb_friction": ({"torque": 1.0}, "torque", 1.0, "N"),
    "viscous_friction": ({"coefficient": 9.0}, "coefficient", 9.0, "N·s/m"),
    "deadband": ({"width": 0.004}, "width", 0.004, "m"),
}


@pytest.mark.parametrize("effect", CAUSES)
def test_a_cause_is_named_in_units_of_its_joint(effect: str) -> None:
    parameters, name, value, unit = CAUSES[effect]
    findings = found(effect, **parameters)
    (cause,) = document(findings)["causes"]
    assert (cause["effect"], cause["scope"]) == (effect, "rail")
    parameter = cause["parameters"][name]
    assert parameter["unit"] == unit and parameter["value"] == pytest.approx(value, rel=0.1)
    entry = findings.effects[effect][0]
    assert entry["joints"] == "rail" and entry[name] == pytest.approx(parameter["value"], rel=1e-3)


TOO_NARROW = pytest.mark.xfail(strict=True, reason="too high by 1.5 %, beyond its interval, in 8 of 10 draws of noise")


@pytest.mark.parametrize(
    "effect", [pytest.param(name, marks=[TOO_NARROW] * (name == "viscous_friction")) for name in CAUSES]
)
def test_an_interval_holds_what_is_true(effect: str) -> None:
    parameters, name, value, _ = CAUSES[effect]
    (cause,) = document(found(effect, **parameters))["causes"]
    assert cause["parameters"][name]["low"] < value < cause["parameters"][name]["high"]


def test_the_report_is_in_metres_and_newtons() -> None:
    report = document(found("coulomb_friction", torque=1.0))
    assert report["slides"] == ["rail", "grip"]
    assert report["floor"]["sd"]["rail"] == pytest.approx(NOISE, rel=0.3)
    assert report["floor"]["sd"]["swing"] == pytest.approx(4.0 * NOISE, rel=0.3)
    replay = next(entry for entry in report["replays"] if entry["joint"] == "rail")
    assert 0.05 < np.ptp(replay["real"]) < 0.4
    (ranked,) = (row for row in report["ranking"][:1])
    assert float(ranked["parameters"].split()[-1]) == pytest.approx(1.0, rel=0.1)


LIFT = """<robot name="lift"><link name="base"/><link name="a"><inertial><mass value="1"/>
<inertia ixx="2e-3" iyy="2e-3" izz="2e-3" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="z" type="prismatic">
<parent link="base"/><child link="a"/><axis xyz="{axis}"/><limit lower="-0.2" upper="0.2" effort="60" velocity="0.8"/>
</joint></robot>"""


@pytest.mark.parametrize(("axis", "force"), [("0 0 1", 5.0), ("0 0 1", 0.0)])
def test_what_a_cross_validation_finds_of_a_slide_is_true_of_the_rest(axis: str, force: float, tmp_path: Path) -> None:
    (tmp_path / "lift.urdf").write_text(LIFT.format(axis=axis))
    dry = (f"world.effects.coulomb_friction.torque={force}", "policy.motions=[steps_small,chirp,triangle_slow]")
    urdf = ("world=urdf", "world.robot=lift.urdf", "task=excite", "policy.repeats=2", "name=z")
    done("collect", *urdf, *dry, folder=tmp_path)
    few = f"without=[{','.join(FEW.without)}]"
    how = ("by=motion", few, "usual=[coulomb_friction]", "nulls=0", "duels=0", "gat=null", "workers=1", "name=z")
    done("cross-validate", "real=z", "sim=urdf", "sim.robot=lift.urdf", *how, folder=tmp_path)
    for fold in json.loads((tmp_path / "runs/z/cross_validate/folds.json").read_text()):
        before, *after = (np.mean(fold["errors"][way]) for way in ("as it was", "calibrated", "diagnosed"))
        assert max(after) < (0.1 * before if force else 1e-4)
        assert fold["removed"] > 0.9 if force else fold["verdict"] == "no_gap"


def wired(change_of: Callable[[Trajectory], Trajectory]) -> Audit:
    log = logged({})
    log = replace(log, episodes=tuple(map(change_of, log.episodes)))
    return audit(log, nominal(gantry()), STEP, lambda: None)


def scaled(episode: Trajectory, factor: np.ndarray, *, commands: bool) -> Trajectory:
    action = episode.action * factor if commands else episode.action
    return replace(episode, action=action, position=episode.position * factor)


@pytest.mark.parametrize("commands", [False, True])
def test_millimetres_are_told(commands: bool) -> None:
    wiring = wired(lambda episode: scaled(episode, np.array([1000.0, 1.0, 1.0]), commands=commands))
    finding = wiring.document()["findings"][0]
    who = "Commands and positions of rail are" if commands else "The positions of rail are"
    assert finding["sentence"] == f"{who} in millimetres, not in metres."
    assert finding["remedy"].startswith("Say unit: mm for ") and wiring.verdict == "wiring"


def test_a_slide_that_wraps_wraps_by_metres() -> None:
    first = np.array([True, False, False])
    wiring = wired(lambda log: replace(log, position=np.where(first, log.position % 0.4, log.position)))
    (finding,) = [finding for finding in wiring.signals if finding.kind == "wrap"]
    assert re.match(r"jumps by its range \(0\.(38|39|4)\d* m\), .*: the position wraps", finding.problem)


def test_an_offset_is_told_in_metres() -> None:
    (finding,) = wired(lambda episode: replace(episode, position=episode.position + [0.2, 0.0, 0.0])).document()[
        "findings"
    ]
    assert re.match(r"The positions of rail are off by \+0\.(19|20) m, as if", finding["sentence"])
    assert finding["value"]["offset"][0] == pytest.approx(0.2, abs=0.02)


def test_a_right_log_is_clean() -> None:
    assert wired(lambda episode: episode).verdict == "clean"


def test_other_units_are_asked_for_in_metres() -> None:
    log = logged({})
    millimetres = tuple(scaled(episode, np.array([1000.0, 1.0, 1.0]), commands=True) for episode in log.episodes)
    with pytest.raises(InputError, match=r"beyond the joint's limits \[-0.40, 0.40\] m; are these millimetres\?"):
        check_log(replace(log, episodes=millimetres), gantry(), "it")
    fast = tuple(replace(episode, velocity=1000.0 * episode.velocity) for episode in log.episodes)
    with pytest.raises(InputError, match=r"velocities are in m/s, are these millimetres\?"):
        check_log(replace(log, episodes=fast), gantry(), "it")


def test_a_value_of_joints_that_slide_is_held_against_its_range_in_their_units() -> None:
    most = list_documented("armature", gantry())["inertia"].upper or 0.0
    rail, swing = ({"armature": {"inertia": 5.0 * most, "joints": joint}} for joint in ("rail", "swing"))
    assert not [*list_unusual(rail, gantry())] and [*list_unusual(swing, gantry())]
    (line,) = list_unusual({"armature": {"inertia": 100.0 * most, "joints": "rail"}}, gantry())
    assert line.endswith(f"to {most / SIZE**2:g} kg")
