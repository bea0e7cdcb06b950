"""The referee of servos: a free gain is found again, records of unlike length replay as alone, sources are kept."""

from __future__ import annotations

import json

import numpy as np
import pytest

from gsl.core.body import lump
from gsl.core.console import Silent
from gsl.core.plant import nominal
from gsl.diagnosis.log.records import Record, cut_pieces, slope
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.in_the_air import InTheAir, change, play
from gsl.robots.catalogue import robot
from gsl.robots.so101_published import so101_bam_m1, so101_typing_task
from gsl.worlds.bullet import BulletWorld
from gsl_experiments.servos import WAYS, Errors, Trial, climb, pad, tell

PERIOD = 0.005
WORLD = BulletWorld(robot="pendulum", effects={}, floating=False, step=0.001, period=PERIOD)


def _records(kp: float) -> list[Record]:
    """Motions of a pendulum whose kp is `kp` times the world's, its log 10 mrad off."""
    times = PERIOD * np.arange(500)
    paths = [0.6 * np.sin(2.0 * rate * times[:end])[:, None] for rate, end in ((1.0, 500), (2.0, 400), (3.0, 300))]
    bare = [Record(str(k), path, np.zeros((len(path) + 1, 1)), np.zeros((1, 1))) for k, path in enumerate(paths)]
    plant = change(WORLD.plant, {"servo_gain": {"kp": kp}})
    played = play(bare, plant, [path[0] for path in paths], step=0.0005, period=PERIOD, settle=200)
    positions = [path + 0.01 for path in played]
    return [
        Record(record.name, record.targets, path, slope(path, PERIOD))
        for record, path in zip(bare, positions, strict=True)
    ]


def test_the_free_gain_and_the_zeros_of_a_log_are_found_on_motions_that_are_not_judged() -> None:
    trial = Trial(_records(2.0), np.array([0, 1, 1]), {"plain": (WORLD, [{}, {}])}, ("joint",), PERIOD, "", 1)
    published, gain, zeros = trial.judge("plain", Silent())
    assert [way.way for way in (published, gain, zeros)] == list(WAYS)
    assert published.gains == (1.0, 1.0) and gain.gains == pytest.approx((2.0, 2.0))
    assert gain.mean.mean() < 0.5 * published.mean.mean()
    assert zeros.mean.max() < 0.002 < gain.mean.min()


def test_records_of_unlike_length_side_by_side_replay_as_each_alone() -> None:
    records, simulator = _records(1.0), InTheAir(WORLD.plant, 0.001, PERIOD, accurate=True)
    together = simulator.simulate({}, no_shifts(1), pad(records, simulator, PERIOD))
    for k, record in enumerate(records):
        whole = cut_pieces([record], lump(WORLD.plant.robot), PERIOD, warm_up=0, scored=len(record))
        np.testing.assert_array_equal(together[k, : len(record)], simulator.simulate({}, no_shifts(1), whole)[0])


@pytest.mark.parametrize("lowest", [-5.25, -0.5, 0.0, 1.75])
def test_a_climb_ends_in_the_valley(lowest: float) -> None:
    assert climb(lambda power: (power - lowest) ** 2) == lowest


def test_repeats_of_a_motion_are_drawn_together() -> None:
    values = np.array([[1.0], [1.0], [3.0], [3.0]])
    errors = Errors("a", WAYS[0], (1.0,), 1e-3 * values, 1e-6 * values**2)
    row = tell([errors], ["x", "x", "y", "y"], ["joint"]).splitlines()[2]
    assert "2.0 (1.0 to 3.0) | 2.2 (1.0 to 3.0)" in row
    lost = Errors("a", WAYS[0], (1.0,), np.full((4, 1), np.nan), values)
    assert "diverges" in tell([lost], ["x", "x", "y", "y"], ["joint"])


def test_published_servos_are_the_same_arm_and_have_the_numbers_of_their_sources() -> None:
    ours, typing = robot("so101"), so101_typing_task()
    assert (typing.name, typing.controlled, typing.mass) == (ours.name, ours.controlled, ours.mass)
    servo = nominal(typing).servo
    assert servo.kp[0] == pytest.approx(48.936821) and servo.armature[5] == pytest.approx(0.043380)
    duty, stall = 16 * 0.166 * 1.004937, 1.177631 * 7.4 / 2.478682
    assert nominal(so101_bam_m1()).servo.kp == pytest.approx([duty * stall] * 6)
    friction = BulletWorld(
        robot="gsl.robots.so101_published.so101_typing_task",
        effects={"coulomb_friction": [{"torque": 0.2, "joints": "Jaw"}]},
        floating=False,
    ).plant.servo.coulomb
    assert json.dumps(friction.tolist()) == "[0.0, 0.0, 0.0, 0.0, 0.0, 0.2]"
