"""A simulator that is exported acts in the other tool as it does here, and what a format lacks is listed."""

from __future__ import annotations

import json
import runpy
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np
import pytest
from commands import done
from learned_servos import some_law

from gsl.core.plant import Plant, nominal
from gsl.core.servo import numbers
from gsl.core.servo_law import HIDDEN, INPUTS, LAGS, LAYERS, SPEED_UNIT, act, network, weights
from gsl.effects.effect import apply_all, build
from gsl.errors import ConfigError
from gsl.export.bam import export_bam
from gsl.export.isaac import export_isaac
from gsl.export.mjcf import export_mjcf
from gsl.export.parts import Export, Simulator, unheld
from gsl.export.plain_json import export_json
from gsl.export.servo_network import export_servo, law_module
from gsl.export.urdf_dynamics import export_urdf
from gsl.robots.catalogue import robot
from gsl.storage.trajectories import read
from gsl.worlds.held import Held
from gsl.worlds.servo import BRISTLE, servo_torque
from gsl.worlds.servo_state import first_state, pack

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:.torch.jit:DeprecationWarning")]

HELD_BY_MJCF = {
    "coulomb_friction": {"torque": 0.06},
    "viscous_friction": {"coefficient": 0.05},
    "servo_gain": {"kp": 0.7, "kd": 1.3},
    "armature": {"inertia": 0.004},
    "target_smoothing": {"time_constant": 0.03},
    "zero_offset": {"offset": 0.02},
}
STEP, PERIOD = 0.001, 0.02


def simulator(name: str, effects: dict[str, Any]) -> Simulator:
    return Simulator(apply_all(nominal(robot(name)), build(effects)), STEP, PERIOD, False, name)


def path(plant: Plant) -> np.ndarray:
    """A motion of all joints within their ranges, shape (100, n_motors) [rad]."""
    low, high = np.array([plant.robot.bound_commands(name) for name in plant.robot.motors]).T
    low, high = np.maximum(low, -1.0), np.minimum(high, 1.0)
    time = PERIOD * np.arange(100)[:, None]
    phase = np.arange(len(low))
    return (low + high) / 2 + 0.3 * (high - low) * np.sin(2.0 * np.pi * 0.7 * time + phase)


def replay_here(plant: Plant, commands: np.ndarray) -> np.ndarray:
    return Held.of(plant, STEP, PERIOD).play([commands], [commands[0]], settle=50)[0]


def replay_there(
    export: Export, commands: np.ndarray, start: Any = None, settle: int = 50, period: float = PERIOD
) -> np.ndarray:
    mujoco = pytest.importorskip("mujoco")
    (text,) = export.files.values()
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    joints = [model.joint(model.actuator(k).trnid[0]).qposadr[0] for k in range(model.nu)]
    data.qpos[joints] = commands[0] if start is None else start
    if model.na:
        data.act[:] = commands[0]
    rows = []
    for row in [*settle * [commands[0]], *commands]:
        rows.append(data.qpos[joints].copy())
        data.ctrl[:] = row
        for _ in range(round(period / STEP)):
            mujoco.mj_step(model, data)
    return np.array([*rows[settle:], data.qpos[joints]])


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(difference**2)))


@pytest.mark.parametrize("name", ["so101", "pendulum"])
def test_mujoco_replays_commands_as_gsl_does_where_mjcf_holds_the_effects(name: str) -> None:
    plain, worn = simulator(name, {}), simulator(name, HELD_BY_MJCF)
    commands = path(worn.plant)
    here, there = replay_here(worn.plant, commands), replay_there(export_mjcf(worn), commands)
    gap = rms(here - replay_here(plain.plant, commands))
    assert rms(here - there) < 0.05 * gap


def test_mujoco_replays_a_real_log_as_well_as_gsl_does(tmp_path: Path) -> None:
    source = Path(__file__).parents[2] / "data/real_logs/xl330_pendulum"
    done("import", "mapping=xl330_pendulum", f"source={source}", "name=log", "accept=true", folder=tmp_path)
    batch = read(tmp_path / "runs/log/import/trajectories.parquet")
    period = batch.control_period
    worn = simulator("pendulum", {"coulomb_friction": {"torque": 0.03}})._replace(period=period)
    ours, theirs = [], []
    for episode in [
        episode for episode, label in zip(batch.episodes, batch.metadata["episodes"], strict=True) if label["kp"] == 400
    ][:4]:
        commands, start = episode.action, episode.position[0]
        here = Held.of(worn.plant, STEP, period).play([commands], [start], settle=1)[0]
        ours.append(here[1:] - episode.position[1:])
        theirs.append(
            replay_there(export_mjcf(worn), commands, start=start, settle=1, period=period)[1:] - episode.position[1:]
        )
    here, there = (rms(np.concatenate(errors)) for errors in (ours, theirs))
    assert there == pytest.approx(here, rel=0.05)


def test_a_format_lists_everything_that_acts_and_that_it_cannot_hold() -> None:
    effects = {
        "command_latency": {"delay": 0.04}, "backlash": {"width": 0.02}, "load_friction": {"coefficient": 0.1},
        "encoder_noise": {"sd": 0.001},
    }  # fmt: skip
    worn = simulator("so101", effects)
    lines = {name: "\n".join(export.missing) for name, export in exports(worn).items()}
    for name, held in (("mjcf", ()), ("isaac_lab", ("delay",)), ("bam", ("delay", "load_friction")), ("urdf", ())):
        for number in ("delay", "play", "load_friction"):
            assert (f"{number} (" in lines[name]) == (number not in held), (name, number)
        assert "noise of the encoders" in lines[name]
    assert exports(simulator("so101", {}))["json"].missing == []
    assert exports(simulator("so101", {}))["mjcf"].missing[0].startswith("no_load_speed")


def exports(simulator: Simulator) -> dict[str, Export]:
    return {
        "mjcf": export_mjcf(simulator), "isaac_lab": export_isaac(simulator), "bam": export_bam(simulator, "sts3215"),
        "urdf": export_urdf(simulator, None), "json": export_json(simulator),
    }  # fmt: skip


def test_the_module_for_isaac_lab_names_every_joint_once_with_its_own_delay(tmp_path: Path) -> None:
    worn = simulator("so101", {"command_latency": [{"delay": 0.0304, "joints": ["Pitch"]}]})
    export = export_isaac(worn)
    ((name, text),) = export.files.items()
    library = tmp_path / "isaaclab/actuators"
    library.mkdir(parents=True)
    kinds = "class ImplicitActuatorCfg(dict): pass\nclass DelayedPDActuatorCfg(dict): pass\n"
    (library / "__init__.py").write_text(kinds, encoding="utf-8")
    (tmp_path / name).write_text(str(text), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(tmp_path))
        groups = runpy.run_path(str(tmp_path / name))["ACTUATORS"]
    assert sorted(joint for group in groups.values() for joint in group["joint_names_expr"]) == sorted(
        worn.plant.robot.motors
    )
    late = groups["delay_30_steps"]
    assert (late["joint_names_expr"], late["min_delay"], late["max_delay"]) == (["Pitch"], 30, 30)
    assert "delay in whole physics steps: 0.03 s for 0.0304 s" in export.missing
    k = worn.plant.robot.motors.index("Pitch")
    assert late["stiffness"]["Pitch"] == pytest.approx(worn.plant.servo.kp[k], rel=1e-5)


def test_the_urdf_is_read_again_with_friction_and_limits_and_keeps_the_users_own_text(tmp_path: Path) -> None:
    own = Path(__file__).parents[2] / "examples/arm.urdf"
    plant = apply_all(nominal(robot(str(own))), build({"coulomb_friction": {"torque": 0.07}}))
    worn = Simulator(plant, STEP, PERIOD, False, "arm")
    (text,) = export_urdf(worn, own).files.values()
    joints = {joint.get("name"): joint for joint in xml.fromstring(text).iter("joint")}
    for name in plant.robot.motors:
        dynamics = joints[name].find("dynamics")
        assert dynamics is not None and float(dynamics.get("friction", "nan")) == pytest.approx(0.07)
    before = {element.tag for element in xml.parse(own).iter()}
    assert before <= {element.tag for element in xml.fromstring(text).iter()}


def test_bams_files_have_the_parameters_of_its_model_m4() -> None:
    worn = simulator(
        "so101", {"load_friction": {"coefficient": 0.1}, "stribeck_friction": {"torque": 0.02, "velocity": 0.3}}
    )
    files = export_bam(worn, "sts3215").files
    assert len(files) == len(worn.plant.robot.motors)
    entries = json.loads(str(next(iter(files.values()))))
    assert (entries["model"], entries["actuator"]) == ("m4", "sts3215")
    assert entries["load_friction_base"] == pytest.approx(0.1)
    assert entries["friction_stribeck"] == pytest.approx(0.02)
    assert entries["dtheta_stribeck"] == pytest.approx(0.3)
    stall = entries["kt"] * worn.plant.robot.supply_voltage / entries["R"]
    assert stall == pytest.approx(worn.plant.servo.limit[0])


def test_the_json_has_every_number_of_every_joint() -> None:
    worn = simulator("so101", {"backlash": {"width": 0.02}})
    document = json.loads(str(next(iter(export_json(worn).files.values()))))
    assert document["servo"].keys() == numbers().keys()
    assert document["servo"]["play"]["joints"] == dict.fromkeys(worn.plant.robot.motors, 0.02)


def law_here(plant: Plant, errors: np.ndarray, v: np.ndarray, bristle: np.ndarray) -> np.ndarray:
    """What the kernel's own law says, shape (2, n) [N·m]."""
    law = plant.law
    assert law is not None
    rows, answers = weights(law), []
    for i in range(len(v)):
        layers = np.zeros((LAYERS, HIDDEN))
        layers[0, :LAGS] = errors[i] * law.stiffness[i]
        layers[0, LAGS:INPUTS] = v[i] / SPEED_UNIT, act(10.0 * v[i]), bristle[i] / BRISTLE
        drive, output = network(rows, int(law.group[i]), layers)
        answers.append(law.torque[i] * np.array([drive + law.lag[i] @ layers[0, :LAGS], output]))
    return np.array(answers).T


def test_the_learned_servo_says_the_same_as_torchscript_and_onnx(tmp_path: Path) -> None:
    import torch

    plant = nominal(robot("so101"))
    plant = replace(plant, law=some_law(plant))
    export = export_servo(Simulator(plant, STEP, PERIOD, False, "arm"))
    for name, data in export.files.items():
        (tmp_path / name).write_bytes(data if isinstance(data, bytes) else data.encode())
    rng, n = np.random.default_rng(1), len(plant.robot.motors)
    errors, v = 0.2 * rng.standard_normal((n, LAGS)), 2.0 * rng.standard_normal(n)
    bristle = np.clip(BRISTLE * rng.standard_normal(n), -BRISTLE, BRISTLE)
    wanted = law_here(plant, errors, v, bristle)
    inputs = [part[None].astype(np.float32) for part in (errors, v, bristle)]
    module = torch.jit.load(str(tmp_path / "arm_servo.pt"))
    for network_ in (module, law_module(plant)):
        answer = np.array([part[0].numpy() for part in network_(*map(torch.from_numpy, inputs))])
        np.testing.assert_allclose(answer, wanted, atol=1e-5 * np.abs(plant.servo.limit).max())
    pytest.importorskip("onnx")
    session = pytest.importorskip("onnxruntime").InferenceSession(str(tmp_path / "arm_servo.onnx"))
    answer = np.array(session.run(None, dict(zip(("errors", "velocity", "bristle"), inputs, strict=True))))[:, 0]
    np.testing.assert_allclose(answer, wanted, atol=1e-5 * np.abs(plant.servo.limit).max())


@pytest.mark.parametrize("slides", [False, True])
def test_the_reference_of_a_learned_servo_is_short_and_gives_the_kernels_torque(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, slides: bool
) -> None:
    body = robot("so101")
    body = replace(body, joints=tuple(replace(joint, slides=slides and joint.lower < -1.7) for joint in body.joints))
    assert (0 < len(body.slides) < len(body.motors)) == slides
    plant = apply_all(nominal(body), build({"coulomb_friction": {"torque": 0.05}}))
    plant = replace(plant, law=some_law(plant))
    monkeypatch.setitem(sys.modules, "onnx", None)
    export = export_servo(Simulator(plant, STEP, PERIOD, False, "arm"))
    assert "gsl[onnx]" in export.missing[-1] and export.lacking == ["onnx"]
    document = json.loads(str(export.files["arm_servo.json"]))
    assert document["slides"] == list(body.slides) and "of slides [m]" in document["inputs"]["errors"]
    for name, data in export.files.items():
        (tmp_path / name).write_bytes(data if isinstance(data, bytes) else data.encode())
    monkeypatch.chdir(tmp_path)
    text = (tmp_path / "arm_servo_reference.py").read_text(encoding="utf-8")
    assert len([line for line in text.splitlines() if line.strip()]) <= 25
    torque = runpy.run_path("arm_servo_reference.py")["torque"]
    n, rng = len(plant.robot.motors), np.random.default_rng(2)
    target, q, v = (0.1 * rng.standard_normal(n) for _ in range(3))
    servos = pack(plant.servo, plant.robot.supply_voltage, plant.law, sizes=plant.robot.sizes)
    motion = np.array([q, v])
    state = first_state(target[None], motion, STEP)
    wanted = np.zeros(n)
    servo_torque(servos, state, motion, 0.0, STEP, PERIOD, wanted)
    answer = torque(np.tile(target, (LAGS, 1)), q, v, np.zeros(n), np.zeros(n), STEP)
    np.testing.assert_allclose(answer, wanted, atol=1e-5)


def test_what_no_format_holds_of_a_slide_is_in_metres_and_newtons() -> None:
    body = robot("so101")
    body = replace(body, joints=tuple(replace(joint, slides=True) for joint in body.joints))
    sliding = Simulator(nominal(body), STEP, PERIOD, False, "arm")
    assert any(" N/m at " in line for line in unheld(sliding.plant, ()))
    document = json.loads(str(next(iter(export_json(sliding).files.values()))))
    assert document["slides"] == list(body.motors) and document["servo"]["kp"]["unit_of_slides"] == "N/m"


def test_a_world_without_a_learned_servo_has_none_to_export() -> None:
    with pytest.raises(ConfigError, match="is for a world with a learned servo"):
        export_servo(simulator("so101", {}))
