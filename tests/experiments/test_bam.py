"""bam's models: friction as its formulas say, logs as it reads them, and a fit that finds what made a log."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
from commands import done, gsl

from gsl.core.body import lump
from gsl.diagnosis.log.records import Record
from gsl.diagnosis.simulate.in_the_air import play
from gsl.worlds.bullet import BulletWorld
from gsl_experiments.bam import BOXES, MODELS, fit
from gsl_experiments.bam_bench import DT, Law, Logs, dry_friction, interpolate, replay, score, to_law

M1 = {
    "kt": 0.37, "R": 3.5, "armature": 0.002, "q_offset": 0.01, "command_delay": 0.008, "friction_base": 0.018,
    "friction_viscous": 0.006,
}  # fmt: skip
M4 = M1 | {
    "load_friction_base": 0.2, "friction_stribeck": 0.03, "dtheta_stribeck": 0.4, "alpha": 1.5,
    "load_friction_stribeck": 0.1,
}  # fmt: skip
M6 = M1 | {
    "friction_stribeck": 0.03, "dtheta_stribeck": 0.4, "alpha": 1.5, "load_friction_motor": 0.2,
    "load_friction_external": 0.1, "load_friction_motor_stribeck": 0.05, "load_friction_external_stribeck": 0.02,
    "load_friction_motor_quad": 0.009, "load_friction_external_quad": 0.004,
}  # fmt: skip


def logs(law: Law) -> Logs:
    """What a law replays to two swings at two gains, as logs of it."""
    time = DT * np.arange(600)
    goal = np.stack([0.8 * np.sin(3.0 * time), 1.2 * np.sin(5.0 * time)])
    rest, many = np.zeros_like(goal), np.ones(2)
    made = Logs(goal, rest, 0.0 * many, goal < 9.0, np.array([200.0, 400.0]), 7.4 * many, 0.005 * many, 0.48 * many)
    positions = np.empty_like(goal)
    replay(law, made, positions)
    return made._replace(position=positions)


def test_a_model_has_its_own_parameters_and_each_has_a_box() -> None:
    assert set(M4) == set(MODELS["m4"]) and set(M6) == set(MODELS["m6"])
    assert {name for names in MODELS.values() for name in names} == set(BOXES)


@pytest.mark.parametrize(("motor", "external", "v"), [(0.3, -0.5, 0.0), (0.6, -0.4, 0.3), (0.2, 0.4, -2.0)])
def test_friction_is_that_of_the_formulas(motor: float, external: float, v: float) -> None:
    still = np.exp(-((abs(v) / 0.4) ** 1.5))
    wanted = 0.018 + 0.2 * abs(external - motor) + still * (0.03 + 0.1 * abs(external - motor))
    assert dry_friction(to_law(M4), motor, external, v) == pytest.approx(wanted)
    wanted = 0.018 + abs(0.1 * external - 0.2 * motor) + still * (0.03 + abs(0.02 * external - 0.05 * motor))
    if np.sign(motor) != np.sign(external):
        wanted += still * (0.004 * external**2 if abs(motor) > abs(external) else 0.009 * motor**2)
    assert dry_friction(to_law(M6), motor, external, v) == pytest.approx(wanted)
    assert dry_friction(to_law(M1), motor, external, v) == pytest.approx(0.018)


def test_a_servo_without_friction_moves_as_in_our_chain() -> None:
    """Two simulators of one bench: bam's explicit step of 5 ms and ours."""
    world = BulletWorld(robot="pendulum", effects={}, floating=False, step=0.001, period=DT)
    servo, robot = world.plant.servo, lump(world.plant.robot)
    kt = robot.torque_constant["joint"]
    bare = {"friction_base": 0.0, "friction_viscous": 0.0, "q_offset": 0.0, "command_delay": 0.0}
    law = to_law(bare | {"kt": kt, "R": kt * 7.4 / servo.limit[0], "armature": servo.armature[0]})
    goal = (0.8 * np.sin(3.0 * DT * np.arange(600)))[None]
    load = (0.49 + 0.005) * 9.80665 * 0.1
    many = np.ones(1)
    inertia = (0.49 + 0.01 / 3.0) * 0.01
    bench = Logs(goal, 0.0 * goal, 0.0 * many, goal < 9.0, 400.0 * many, 7.4 * many, inertia * many, load * many)
    positions = np.empty_like(goal)
    replay(law, bench, positions)
    record = Record("swing", goal.T, np.zeros((601, 1)), np.zeros((601, 1)))
    ours = play([record], world.plant, [np.zeros(1)], step=0.001, period=DT, settle=1)[0]
    assert np.abs(positions[0] - ours[:600, 0]).mean() < 0.02 * np.abs(ours).mean()


def test_a_fit_finds_the_motor_that_made_a_log() -> None:
    made = logs(to_law(M1))
    values, error = fit("m1", made, 3000, seed=3)
    assert error == pytest.approx(score(to_law(values), made)) and error < 2e-3
    assert values["kt"] / values["R"] == pytest.approx(M1["kt"] / M1["R"], rel=0.05)


def test_rows_are_interpolated_and_before_the_first_on_its_line() -> None:
    stamps, values = np.array([0.004, 0.008, 0.02]), np.array([4.0, 8.0, 2.0])
    np.testing.assert_allclose(interpolate(np.array([0.0, 0.004, 0.008, 0.014]), stamps, values), [0.0, 4.0, 8.0, 5.0])


def test_the_study_holds_each_gain_out_and_says_what_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "raw").mkdir()
    for number, gain in enumerate((100, 400)):
        entries = [
            {"timestamp": 0.004 * k, "goal_position": np.sin(0.02 * k), "position": 0.5 * np.sin(0.02 * k - 0.1),
             "speed": 0.0, "torque_enable": True}
            for k in range(100)
        ]  # fmt: skip
        log = {"mass": 0.49, "length": 0.1, "kp": gain, "vin": 7.4, "entries": entries}
        (tmp_path / f"raw/{number}.json.gz").write_bytes(gzip.compress(json.dumps(log).encode()))
    few = ("models=[m1,m6]", "evaluations=30", "workers=1")
    done("reproduce", "bam", "logs=raw", *few, folder=tmp_path)
    fits = json.loads((tmp_path / "runs/bam/reproduce/fits.json").read_text())
    assert [(row["model"], row["held_out"]) for row in fits] == [(m, g) for m in ("m1", "m6") for g in (100.0, 400.0)]
    assert all(row["checked"] > 0.0 and set(row["parameters"]) == set(MODELS[row["model"]]) for row in fits)
    table = (tmp_path / "runs/bam/reproduce/table.md").read_text()
    assert "| model | kp 100 held out | kp 400 held out | mean | fitted |" in table
    said = gsl("reproduce", "bam", "models=[m2]", "logs=raw", "name=other", folder=tmp_path)
    assert said.code == 2 and said.lines == ["gsl reproduce bam: models = m2: is none of m1, m3, m4, m6"]
