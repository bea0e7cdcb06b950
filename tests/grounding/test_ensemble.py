"""Ensembles of simulators: which one an episode is in says its seed, and each is what it would be alone."""

from __future__ import annotations

import json
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from commands import SMALL, done, refused
from diagnosis_document import servo_gain
from scenarios import AIR, GROUND, QUIET
from scipy import stats

from gsl.core.checkpoint import read_checkpoint
from gsl.core.described import describe
from gsl.core.other_commands import LOGGED_GAINS
from gsl.core.plant import Plant
from gsl.effects.effect import together
from gsl.errors import ConfigError
from gsl.grounding.diagnosis_file import read_diagnosis, uncertain_causes
from gsl.grounding.draws import DRAWS, UncertainCause, around, drawings, hypercube, within
from gsl.grounding.effects import DiagnosedEffects, switch_on
from gsl.grounding.none import NoGrounding
from gsl.grounding.randomised import RandomisedEffects
from gsl.grounding.servo import LearnedServo
from gsl.models.servo import NUMBERS, neutral
from gsl.models.servo_file import FILE, read_servo
from gsl.models.servo_members import ServoMembers
from gsl.policies.walk_engine import WalkEngine
from gsl.rollout.rollout import Scenario
from gsl.storage.artifact import build
from gsl.storage.models import write_model
from gsl.tasks.walk import Walk
from gsl.training.servo_members import bootstrap
from gsl.training.servo_verdict import problems_of_members
from gsl.validation.check_grounding import check_grounding
from gsl.validation.gate import Gate
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.ensemble import EnsembleWorld, take_turns

pytestmark = pytest.mark.slow

NAO = BulletWorld(robot="nao", effects={}, start_noise=0.02)  # as nao_ideal says
LATE = {"effect": "command_latency", "joints": list("ab"), "scope": "all", "fixed": {}, "probability": 0.8}
LATE |= {"parameters": {"delay": {"value": 0.0123456789, "low": 0.01, "high": 0.015, "unit": "s"}}}
CALIBRATION = [{"kp": 1.01, "kd": 0.99, "joints": "LKneePitch"}, {"kp": 0.57, "kd": 0.82, "joints": "LKneePitch"}]
EFFECTS = {
    "command_latency": [{"delay": 0.012346, "joints": "all"}],
    "servo_gain": [{"kp": 0.57, "kd": 0.81, "joints": "LKneePitch"}, *CALIBRATION],
}
REPORT = {
    "verdict": "causes",
    "causes": [LATE, servo_gain()],
    "summary": "told",
    "effects": EFFECTS,
    "shrinkage": {"before": 9.0, "after": 1.0},
}
FLOORS = {"floors_before": 9.0, "floors_after": 0.5, "groups": {}, "learned": True, "whole_motions": True}


def softer(member: int, plant: Plant = NAO.plant) -> Any:
    """A learned servo that differs from the one below by a softer gain."""
    change = np.zeros((len(NUMBERS), len(NAO.plant.robot.controlled)))
    change[NUMBERS.index("kp")] = -1.5 * member  # in units of 0.2
    return neutral(plant, np.random.default_rng(member)).shift(plant, change)


@dataclass(frozen=True)
class Servo:
    """Writes a learned servo of some members without learning it, on top of some effects."""

    members: int
    effects: Mapping[str, Any] = field(default_factory=dict)
    more: Mapping[str, Any] = field(default_factory=dict)
    kind: ClassVar[str] = "train_servo"

    def parents(self) -> Mapping[str, Path]:
        return {}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        plant = replace(NAO, effects=self.effects).plant
        write_model(folder, ServoMembers(tuple(softer(k, plant) for k in range(self.members))))
        return {**FLOORS, "members": [0.5] * self.members, **self.more}


@dataclass(frozen=True)
class Found:
    """Writes a diagnosis without a log."""

    sim: BulletWorld = NAO
    more: Mapping[str, Any] = field(default_factory=dict)
    kind: ClassVar[str] = "diagnose"

    def parents(self) -> Mapping[str, Path]:
        return {}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        (folder / "report.json").write_text(json.dumps(REPORT))
        return self.more


def made(stage: Any, out: Path) -> str:
    build(stage, config=describe(stage), out=out, command="", force=False, console=QUIET)
    return str(out)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Servos of one and of three members, and a diagnosis."""
    place = tmp_path_factory.mktemp("ensemble")
    made(Servo(1), place / "runs/single/train_servo")
    made(Servo(3), place / "runs/several/train_servo")
    made(Servo(3, EFFECTS), place / "runs/on_effects/train_servo")
    made(Found(), place / "runs/found/diagnose")
    return place


def positions(env: Any, seed: int) -> np.ndarray:
    env.reset(seed=seed)
    return np.array([env.step(np.full(15, 0.2))[0] for _ in range(12)])


def alone(world: BulletWorld, seed: int) -> np.ndarray:
    env = world.make()
    try:
        return positions(env, seed)
    finally:
        env.close()


def soft(kp: float, world: BulletWorld = GROUND) -> BulletWorld:
    return replace(world, effects={"servo_gain": {"kp": kp}})


def test_an_episode_is_that_of_one_member_alone_whatever_came_before() -> None:
    worlds = tuple(soft(kp) for kp in (1.0, 0.5, 0.2))
    first, second = (pickle.loads(pickle.dumps(EnsembleWorld(GROUND, worlds))).make() for _ in range(2))
    by_seed = {seed: positions(first, seed) for seed in range(8)}
    for seed in reversed(by_seed):
        np.testing.assert_array_equal(positions(second, seed), by_seed[seed])
    members_of = {
        seed: [k for k, world in enumerate(worlds) if np.array_equal(alone(world, seed), rows)]
        for seed, rows in by_seed.items()
    }
    assert all(len(members) == 1 for members in members_of.values())
    assert {members[0] for members in members_of.values()} == {0, 1, 2}
    first.close()
    second.close()


def test_episodes_that_take_turns_meet_every_member() -> None:
    ensemble = EnsembleWorld(GROUND, tuple(soft(kp) for kp in (1.0, 0.5, 0.2)))
    seeds = [take_turns(ensemble, 12345 + 9876 * turn, turn) for turn in range(4)]
    env = ensemble.make()
    for turn, seed in enumerate(seeds):
        np.testing.assert_array_equal(positions(env, seed), alone(ensemble.members[turn % 3], seed))
    env.close()
    assert len(set(seeds)) == 4 and take_turns(GROUND, 12345, 2) == 12345


def test_an_ensemble_of_one_is_its_member() -> None:
    env = EnsembleWorld(GROUND, (soft(0.5),)).make()
    np.testing.assert_array_equal(positions(env, 3), alone(soft(0.5), 3))
    env.close()
    np.testing.assert_array_equal(positions(env, 4), alone(soft(0.5), 4))
    env.close()


def test_a_checkpoint_keeps_its_members_and_a_world_has_the_one_it_names(folder: Path) -> None:
    place = str(folder / "runs/several/train_servo")
    worlds = [replace(AIR, servo=place, servo_member=k) for k in range(3)]
    for k, world in enumerate(worlds):
        np.testing.assert_allclose(world.plant.servo.kp, AIR.plant.servo.kp * np.exp(-0.3 * k))
        for name, values in softer(k).arrays().items():
            np.testing.assert_array_equal(read_servo(place, k).arrays()[name], values)
    assert replace(AIR, servo=place) == worlds[0]
    arrays, about = read_checkpoint(Path(place) / FILE, kind=ServoMembers.kind)
    del about["members"]  # as a file of one servo that knows no others
    assert len(ServoMembers.from_arrays(arrays, about).members) == 1


def test_the_members_of_a_servo_take_turns(folder: Path) -> None:
    place = str(folder / "runs/several/train_servo")
    world = LearnedServo(servo=place, ensemble=True, torque_noise=0.0).switch_on(AIR)
    assert isinstance(world, EnsembleWorld)
    assert world.members == tuple(replace(AIR, servo=place, servo_member=k) for k in range(3))
    assert world.world == LearnedServo(servo=place).switch_on(AIR) == world.members[0]


def test_draws_are_a_normal_distribution_within_the_interval() -> None:
    shares = np.linspace(0.0, 0.999, 50)
    for centre, low, high in ((1.0, 0.9, 1.1), (0.0, 0.0, 0.3), (2.0, 1.0, 2.2)):
        error = max(high - centre, centre - low) / 1.96
        wanted = stats.truncnorm.ppf(shares, (low - centre) / error, (high - centre) / error, centre, error)
        drawn = np.array([within(share, centre, low, high) for share in shares])
        np.testing.assert_allclose(drawn, wanted, atol=1e-9)
        assert low <= drawn.min() and drawn.max() <= high
    assert within(0.7, 0.3, 0.3, 0.3) == 0.3


def test_numbers_are_spread_evenly_over_every_column() -> None:
    rows = hypercube(16, 5, np.random.default_rng(0))
    for column in rows.T:
        np.testing.assert_array_equal(np.sort((16 * column).astype(int)), np.arange(16))


@pytest.mark.parametrize("probability", [0.0, 0.3, 0.8, 1.0])
def test_a_cause_acts_by_its_probability_within_its_interval(probability: float) -> None:
    entry = {"kp": 0.6, "kd": 0.8, "joints": "legs"}
    cause = UncertainCause("servo_gain", entry, probability, {"kp": (0.5, 0.7), "kd": (0.8, 0.8)})
    drawn = [entry for (entry,) in drawings([cause], DRAWS)]
    acting = [draw for draw in drawn if draw is not None]
    assert abs(len(acting) - probability * DRAWS) <= 1.0
    assert all(0.5 <= entry["kp"] <= 0.7 and (entry["kd"], entry["joints"]) == (0.8, "legs") for entry in acting)
    assert len({entry["kp"] for entry in acting}) == len(acting)


def test_a_diagnosis_that_is_sure_makes_the_plain_world_of_its_effects() -> None:
    sure = UncertainCause("servo_gain", {"kp": 0.6, "joints": "legs"}, 1.0, {"kp": (0.6, 0.6)})
    bare = UncertainCause("command_latency", {"delay": 0.01, "joints": "all"}, 1.0, {})
    world = replace(AIR, effects={cause.effect: [cause.entry] for cause in (sure, bare)})
    assert around(world, [sure, bare]) is world
    assert around(world, []) is world
    unsure = around(world, [replace(sure, probability=0.5), bare])
    assert isinstance(unsure, EnsembleWorld) and unsure.world == world
    assert {len(member.effects) for member in unsure.members} == {1, 2}
    np.testing.assert_array_equal(
        alone(next(member for member in unsure.members if member == world), 2), alone(world, 2)
    )


def test_draws_of_a_report_leave_its_calibration(folder: Path) -> None:
    diagnosis = read_diagnosis(str(folder / "runs/found/diagnose"), "diagnose")
    late, gain = diagnosis.uncertain
    assert (late.entry, late.probability, late.intervals) == (
        EFFECTS["command_latency"][0],
        0.8,
        {"delay": (0.01, 0.015)},
    )
    assert gain.entry == EFFECTS["servo_gain"][0]
    grounding = DiagnosedEffects(diagnosis=str(folder / "runs/found/diagnose"), draws=True)
    world = switch_on(NAO, diagnosis)
    drawn = grounding.draw(world, diagnosis)
    assert isinstance(drawn, EnsembleWorld) and len(drawn.members) == DRAWS
    for member in drawn.members:
        assert member.effects["servo_gain"][-2:] == CALIBRATION
    assert replace(grounding, draws=False).draw(world, diagnosis) is world
    assert not [*uncertain_causes({"causes": [{"effect": "backlash"}], "effects": {"backlash": [{"width": 0.01}]}})]


def test_a_log_that_had_gains_of_its_own_hands_them_over(tmp_path: Path) -> None:
    """A servo and a diagnosis stand on the servos that the log commanded; both groundings bring these along."""
    gains = {"servo_gain": [{"kp": 0.4, "joints": "legs"}]}
    logged = {LOGGED_GAINS: gains["servo_gain"]}
    servo = LearnedServo(servo=made(Servo(1, gains, logged), tmp_path / "runs/log/train_servo"))
    diagnosis = read_diagnosis(made(Found(more=logged), tmp_path / "runs/log/diagnose"), "diagnose")
    commanded = replace(NAO, effects=gains)
    np.testing.assert_array_equal(servo.switch_on(NAO).plant.servo.kp, servo.switch_on(commanded).plant.servo.kp)
    whole = replace(NAO, effects=together([gains, EFFECTS]))
    np.testing.assert_allclose(switch_on(NAO, diagnosis).plant.servo.kp, whole.plant.servo.kp)


def test_drawn_effects_and_members_of_a_servo_go_together(folder: Path, tmp_path: Path) -> None:
    servo = LearnedServo(servo=str(folder / "runs/on_effects/train_servo"), ensemble=True)
    both = DiagnosedEffects(diagnosis=str(folder / "runs/found/diagnose"), draws=True, inner=servo)
    scenario = Scenario(NAO, Walk(duration=0.6), WalkEngine(), "sim", both)
    ready, about = check_grounding(scenario, Gate(WalkEngine().initial, tmp_path, QUIET, False, 1))
    assert isinstance(ready.world, EnsembleWorld) and ready.grounding == NoGrounding()
    assert [member.servo_member for member in ready.world.members] == [k % 3 for k in range(DRAWS)]
    assert len({str(member.effects) for member in ready.world.members}) == DRAWS
    assert scenario.prepare(about) == ready
    report = json.loads((tmp_path / "grounding.json").read_text())
    assert report["acceptable"] and report["drawn"]["acceptable"]
    nominal = replace(both, inner=replace(servo, servo=str(folder / "runs/several/train_servo")))
    with pytest.raises(ConfigError, match="was learned on top of another servo: kp of LKneePitch was 150"):
        check_grounding(replace(scenario, grounding=nominal), Gate(WalkEngine().initial, tmp_path, QUIET, False, 1))


def test_a_bootstrap_draws_whole_motions_as_many_as_there_are() -> None:
    samples = np.array([4, 4, 7, 9, 9, 9])
    drawn = [samples[bootstrap(samples, np.random.default_rng(seed))] for seed in range(20)]
    size = {4: 2, 7: 1, 9: 3}
    for draw in drawn:
        counts = [np.sum(draw == key) / size[key] for key in size]
        assert sum(counts) == 3 and all(count == int(count) for count in counts)
    assert len({tuple(draw) for draw in drawn}) > 3


def test_a_member_far_from_the_log_is_a_problem_of_the_ensemble_alone() -> None:
    assert problems_of_members({**FLOORS, "members": [0.5, 0.7, 2.9]}) == []
    assert problems_of_members({**FLOORS, "members": [3.5, 0.7, 4.2]}) == [
        "held out, member 2 is 4.2 noise floors from the log, more than 3"
    ]
    assert problems_of_members({"floors_before": 1.5, "members": [0.5, 0.7, 2.9]}) == [
        "held out, member 2 is 2.9 noise floors from the log, more than 1.5"
    ]


@pytest.mark.parametrize(
    ("grounding", "size"),
    [
        (("grounding=servo", "grounding.servo=several", "grounding.ensemble=true"), 3),
        (("grounding=effects", "grounding.diagnosis=found", "grounding.draws=true"), DRAWS),
    ],
)
def test_a_search_goes_through_an_ensemble_and_counts_the_worst(folder: Path, grounding: Any, size: int) -> None:
    line = ("optimize", *SMALL, "optimizer.generations=1", "rollouts=3", "objective=cvar", "quantile=0.34")
    said = done(*line, *grounding, f"name=cvar_{size}", folder=folder)
    metrics = json.loads((folder / f"runs/cvar_{size}/optimize/metrics.json").read_text())
    assert metrics["best_cvar_sim"] <= metrics["best_value_sim"] and metrics["grounding_acceptable"]
    assert "compliance" in metrics
    assert f"one of {size} simulators" in said.out + said.err


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        (("collect", "world=learned", "world.servo=several", "world.servo_member=3"), "numbered from 0 to 2"),
        (("collect", "world=learned", "world.servo=several", "world.servo_member=-1"), "servo_member"),
        (("collect", "world=nao_ideal", "world.servo_member=1"), "is of a learned servo"),
        (("optimize", "grounding=servo", "grounding.servo=single", "grounding.ensemble=true"), "has one member"),
        (
            ("optimize", "grounding=effects", "grounding.effects.armature.inertia=0.001", "grounding.draws=true"),
            "draws",
        ),
        (("optimize", "grounding=identified", "grounding.draws=true"), "around a diagnosis"),
        (("train-servo", "real=x", "members=0"), "members"),
    ],
)
def test_what_cannot_be_gets_one_line(folder: Path, line: tuple[str, ...], problem: str) -> None:
    role = ("role=sim",) if line[0] == "collect" else ()
    small = () if line[0] == "train-servo" else SMALL
    assert problem in refused(*line, *role, *small, "name=refused", folder=folder)


def test_simulators_are_not_drawn_twice() -> None:
    with pytest.raises(ConfigError, match="both draw simulators"):
        DiagnosedEffects(diagnosis="x", draws=True, inner=RandomisedEffects())


def test_what_a_chain_learns_has_as_many_members_as_it_takes() -> None:
    assert (LearnedServo().members, LearnedServo(ensemble=True).members) == (1, 4)
