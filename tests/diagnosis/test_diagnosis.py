"""The diagnosis of simulated logs whose cause is known, on an arm of two joints that takes seconds."""

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np
import pytest
from swinging_arm import FEW, NOISE, PERIOD, QUICK, arm, found, log, logged, motions

from gsl.core.plant import Plant, nominal
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.diagnose import diagnose
from gsl.diagnosis.hypothesis.candidates import library
from gsl.diagnosis.hypothesis.problem import Problem
from gsl.diagnosis.log.floor import NoiseFloor, noise_floor
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.log.records import to_records
from gsl.diagnosis.log.repeats import find_repeats
from gsl.diagnosis.search.screening import interpolate
from gsl.diagnosis.simulate import calibration
from gsl.diagnosis.simulate.simulator import simulator_of
from gsl.diagnosis.verdict.document import document
from gsl.effects.effect import SCOPE, Scope, apply_all, build, scope, use_own
from gsl.errors import InputError
from gsl.report.diagnosis_text import summary_lines
from gsl.worlds.held import Held

pytestmark = pytest.mark.slow

HEAVY = tuple(name for name in FEW.without if name != "armature")  # what is left out beside a heavy rotor
WIDE = {"servo_gain": {"kp": (0.004, 1.5), "kd": (0.03, 1.5)}}


def test_no_effect_is_no_gap_and_the_self_test_knows_what_chance_gains() -> None:
    result = found({}, seed=2, nulls=1)
    assert result.verdict.word == "no_gap" and len(result.chances) == 1


CAUSES = {
    "command_latency": ({"delay": 0.012}, "delay", 0.05),
    "coulomb_friction": ({"torque": 0.12}, "torque", 0.15),
    "viscous_friction": ({"coefficient": 0.3}, "coefficient", 0.1),
    "servo_gain": ({"kp": 0.6}, "kp", 0.05),
    "armature": ({"inertia": 0.006}, "inertia", 0.1),
    "torque_limit": ({"factor": 0.45}, "factor", 0.05),
    "deadband": ({"width": 0.015}, "width", 0.15),
    "link_mass": ({"link": "lower", "mass": 0.2}, "mass", 0.1),
}


@component
class ColdGrease:
    """Drags the faster a joint turns, and holds it at rest. Signature: both. Confused with either."""

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 50
    thickness: Annotated[float, setting("of the grease", ge=0, lower=0.0, upper=1.0, source="a test")]
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        more, servo = np.where(scope(plant, self.joints), self.thickness, 0.0), plant.servo
        return plant.with_servo(viscous=servo.viscous + 0.6 * more, coulomb=servo.coulomb + 0.2 * more)


@component
class Magnet(ColdGrease):
    """Pulls. Signature: a pull. Confused with gravity."""

    def apply(self, plant: Plant) -> Plant:
        return replace(plant, hook=lambda motion, time: self.thickness * np.ones(motion.shape[1]))


def test_an_effect_of_ones_own_is_a_cause_like_ours_and_a_hook_is_left_out_by_name() -> None:
    said: list[str] = []
    use_own({"cold_grease": ColdGrease, "magnet": Magnet})
    try:
        cold = log({"cold_grease": {"thickness": 0.5}})
        result = diagnose(cold, nominal(arm()), 0.002, FEW, said.append)
    finally:
        use_own({})
    assert result.selection.chosen.names == ("cold_grease",), result.verdict
    assert result.selection.chosen.parameters[0][0] == pytest.approx(0.5, rel=0.1)
    assert "without magnet, whose torque hook acts in Bullet alone" in said
    assert "magnet" not in {candidate.effect for candidate in result.problem.library}


@pytest.mark.parametrize("effect", CAUSES)
def test_a_cause_is_named_with_its_value(effect: str) -> None:
    parameters, name, tolerance = CAUSES[effect]
    result = found({effect: parameters}, seed=2)
    assert result.selection.chosen.names == (effect,), result.verdict
    candidate, parameter = result.selection.chosen.candidates[0], result.selection.chosen.parameters[0]
    assert candidate.entry(parameter)[name] == pytest.approx(parameters[name], rel=tolerance)
    assert result.verdict.word in ("causes", "inseparable")
    if "link" in parameters:
        assert candidate.fixed["link"] == parameters["link"]


def test_a_rotor_of_one_joint_that_is_heavier_is_named_and_not_calibrated_away() -> None:
    result = found({"armature": {"inertia": 0.004, "joints": "elbow"}}, without=HEAVY)
    assert result.verdict.word == "causes"
    assert result.selection.chosen.places == {("armature", "elbow")}


def test_a_fault_of_one_joint_is_named_there() -> None:
    result = found({"servo_gain": {"kp": 0.6, "joints": "elbow"}})
    assert [candidate.scope for candidate in result.selection.chosen.candidates] == ["elbow"]
    shares = {place["joint"]: place["share"] for place in document(result)["where"] if place["regime"] == "all"}
    assert shares["elbow"] > 0.8 and sum(shares.values()) == pytest.approx(1.0)


def test_a_simulator_fifty_times_too_stiff_is_told_so() -> None:
    stiff = replace(arm(), gains=dict.fromkeys(("shoulder", "elbow"), (2000.0, 4.0)), ranges=WIDE)
    findings = diagnose(log({}), nominal(stiff), 0.002, replace(FEW, most=2), lambda _: None)
    chosen = findings.selection.chosen
    assert not {"coulomb_friction", "viscous_friction"} & set(findings.selection.screening.invisible)  # once it is soft
    assert chosen.names == ("servo_gain",) and chosen.candidates[0].scope == "all"
    entry = chosen.candidates[0].entry(chosen.parameters[0])
    assert (entry["kp"], entry["kd"]) == (pytest.approx(0.02, rel=0.1), pytest.approx(0.25, rel=0.1))


def test_what_a_wide_range_holds_is_meant_in_factors() -> None:
    gain = next(candidate for candidate in library(replace(arm(), ranges=WIDE)) if candidate.free == ("kp",))
    np.testing.assert_allclose(gain.grid[:5, 0], 0.004 ** np.array([0.05, 0.15, 0.35, 0.65, 1.0]))
    assert gain.claims_its_name(np.array([0.003])) and not gain.claims_its_name(np.array([0.002]))
    assert gain.towards(np.array([0.004]), 0.5) == pytest.approx(np.sqrt(0.004))
    cost = np.log(gain.grid[:, 0] / gain.grid[3, 0]) ** 2
    assert interpolate(gain.grid, cost, 3, wide=True) == pytest.approx(gain.grid[3], rel=1e-6)


def test_two_causes_at_once() -> None:
    result = found(
        {"command_latency": {"delay": 0.02}, "coulomb_friction": {"torque": 0.15}}, most=2, without=FEW.without
    )
    assert set(result.selection.chosen.names) == {"command_latency", "coulomb_friction"}
    assert all(cause.rival is not None for cause in result.verdict.causes)  # each was challenged in its place


def test_one_motion_alone_makes_nobody_sure() -> None:
    whole = log({"command_latency": {"delay": 0.016}})
    steps = [episode for episode, about in zip(whole.episodes, whole.metadata["episodes"], strict=True)
             if about["policy"] == "steps_a"][0]  # fmt: skip
    lone = replace(whole, episodes=(steps,), metadata={"episodes": [{"policy": "steps_a"}]})
    report = document(diagnose(lone, nominal(arm()), 0.002, QUICK, lambda _: None))
    assert [cause["effect"] for cause in report["causes"]] == ["command_latency"]
    assert report["causes"][0]["probability"] <= 0.8 and not report["sure"]
    assert report["summary"].partition("it leaves is ")[2].startswith("probably caused by command latency")
    assert any(caveat.startswith("There is one motion only") for caveat in report["caveats"])
    (line,) = [line for line in summary_lines(report) if line.title == "what next"]
    assert "Mind: There is one motion only" in str(line.caption)


def test_what_the_library_lacks_is_unknown() -> None:
    lagging = ("target_smoothing", "sensor_delay", "armature", "viscous_friction", "servo_gain")
    assert found({"command_latency": {"delay": 0.03}}, without=("command_latency", *lagging)).verdict.word == "unknown"


ROWS = {"time": 51, "action": 50, "position": 51, "velocity": 51}  # of one window


def test_a_reference_of_one_window_is_refused() -> None:
    batch = log({})
    short = replace(batch.episodes[0], **{key: getattr(batch.episodes[0], key)[:n] for key, n in ROWS.items()})
    reference = replace(batch, episodes=(short,), metadata={})
    with pytest.raises(InputError, match="the reference has too little to fit and to check: two motions"):
        diagnose(batch, nominal(arm()), 0.002, FEW, lambda phase: None, reference=reference)


def test_a_reference_log_takes_the_model_error_away() -> None:
    """The diagnoser's plant is wrong in a way of its own, in both logs."""
    foreign = {"viscous_friction": {"coefficient": 0.25}}
    reference = log(foreign, seed=5)
    late = log({**foreign, "command_latency": {"delay": 0.015}}, seed=5)
    result = diagnose(late, nominal(arm()), 0.002, FEW, lambda phase: None, reference=reference)
    assert result.selection.chosen.names == ("command_latency",)
    alike, reference = (log(foreign, seed=seed, jitter=0.0) for seed in (6, 7))
    same = diagnose(alike, nominal(arm()), 0.002, FEW, lambda phase: None, reference=reference)
    assert same.verdict.word == "no_gap"


def test_a_latency_is_not_claimed_where_clocks_are_apart() -> None:
    result = found({"command_latency": {"delay": 0.03}}, clocks=False)
    assert result.verdict.word == "no_gap" and result.shift == pytest.approx(0.03, abs=0.002)
    assert any("clocks" in caveat for caveat in document(result)["caveats"])


def test_the_diagnosed_world_moves_as_the_robot() -> None:
    result = found({"servo_gain": {"kp": 0.6}}, seed=2)
    exp = result.log
    world: Plant = apply_all(nominal(arm()), build(result.effects))
    replayed = replace(result.simulator, plant=world).simulate({}, calibration.no_shifts(2), exp.pieces)
    left = exp.comparison.floor * exp.comparison.residual(replayed, exp.pieces)
    assert np.sqrt(np.mean(left**2)) < 1.1 * NOISE


def test_the_document_has_what_the_contract_asks_for() -> None:
    report = document(found({"command_latency": {"delay": 0.012}}, seed=2))
    (cause,) = report["causes"]
    assert report["verdict"] == "causes" and cause["effect"] == "command_latency"
    delay = cause["parameters"]["delay"]
    assert delay["low"] < delay["value"] < delay["high"] and delay["unit"] == "s"
    assert delay["value"] == pytest.approx(0.012, abs=6e-4)
    assert cause["joints"] == ["shoulder", "elbow"] and 0.5 < cause["probability"] <= 1.0
    assert cause["gain"]["low"] <= cause["gain"]["value"] <= cause["gain"]["high"]
    shrinkage = report["shrinkage"]
    assert shrinkage["before"] > 1.5 > 1.15 > shrinkage["after"] and shrinkage["fraction"] > 0.9
    assert shrinkage["ceiling_fraction"] is None or shrinkage["ceiling_fraction"] <= 1.0
    assert all(place["low"] <= place["high"] for place in report["where"])


def test_the_noise_floor_comes_from_repeats_and_else_from_roughness() -> None:
    def measure(batch: Batch, resolution: float = 1e-4) -> NoiseFloor:
        records = to_records(batch, arm())
        return noise_floor(records, find_repeats(records, PERIOD), PERIOD, resolution)

    batch = log({}, jitter=0.0)
    measured = measure(batch)
    assert measured.source == "repeats" and measured.sd == pytest.approx(NOISE, rel=0.2)
    alone = measure(replace(batch, episodes=batch.episodes[:-1], metadata={}))
    assert alone.source == "estimated" and alone.sd == pytest.approx(NOISE, rel=0.35)
    assert measure(log({}, noise=0.0), 0.01).sd == pytest.approx(0.01 / np.sqrt(12.0))


@pytest.mark.parametrize("own_names", [True, False])
def test_the_order_of_files_changes_nothing(own_names: bool) -> None:
    """Files may be called anything as well, unless a label says what a motion is."""
    batch, cuts = log({}), []
    for order in (np.arange(9), np.random.default_rng(0).permutation(9)):
        labels = [{**batch.metadata["episodes"][k], "file": f"{place}"} for place, k in enumerate(order)]
        labels = labels if own_names else [{"policy": label["file"], "file": label["file"]} for label in labels]
        episodes = tuple(batch.episodes[k] for k in order)
        cuts.append(cut_log(replace(batch, episodes=episodes, metadata={"episodes": labels}), arm()))
        assert [order[place] for place in cuts[-1].order] == [cuts[0].order[k] for k in range(9)]
    first, second = cuts
    for part in ("real", "record", "tick"):
        np.testing.assert_array_equal(getattr(first.pieces, part), getattr(second.pieces, part))
    np.testing.assert_array_equal(first.held_out, second.held_out)
    np.testing.assert_array_equal(first.comparison.floor, second.comparison.floor)


def test_of_motions_without_names_blocks_of_each_are_held_out() -> None:
    """Every motion is in both parts, and repeats are held out at the same times."""
    batch, files = log({}), [{"policy": f"{k}", "file": f"{k}"} for k in range(9)]
    exp = cut_log(replace(batch, metadata={"episodes": files}), arm(), blocks=True)
    assert set(exp.pieces.record[exp.held_out]) == set(exp.pieces.record[exp.train]) == set(range(9))
    assert not exp.by_record and exp.motions == 8
    first, again = exp.order.index(0), exp.order.index(8)  # the last motion repeats the first
    held = [exp.pieces.tick[exp.held_out][exp.pieces.record[exp.held_out] == k] for k in (first, again)]
    np.testing.assert_array_equal(*held)
    named = cut_log(batch, arm(), blocks=True)
    assert named.by_record and not set(named.pieces.record[named.held_out]) & set(named.pieces.record[named.train])


def test_of_repeats_of_one_motion_the_same_times_are_held_out() -> None:
    batch = log({})
    rows = {key: n + 80 for key, n in ROWS.items()}  # three windows of each
    both = (batch.episodes[k] for k in (0, 8))
    episodes = tuple(
        replace(episode, **{key: getattr(episode, key)[:n] for key, n in rows.items()}) for episode in both
    )
    exp = cut_log(replace(batch, episodes=episodes, metadata={"episodes": [{}, {}]}), arm(), blocks=True)
    held, fitted = ({*exp.pieces.tick[index]} for index in (exp.held_out, exp.train))
    assert exp.motions == 1 and held and fitted and not held & fitted


def test_repeats_stay_on_one_side_of_the_split() -> None:
    exp = cut_log(log({}), arm())
    held = {exp.records[k].name for k in exp.pieces.record[exp.held_out]}
    fitted = {exp.records[k].name for k in exp.pieces.record[exp.train]}
    assert held and fitted and not held & fitted
    assert {name[:-2] for name in held} == {name[:-2] for name in fitted}


def test_no_latency_is_tried_that_servos_do_not_remember() -> None:
    latency = next(candidate for candidate in library(arm()) if candidate.effect == "command_latency")
    short = latency.up_to(0.015)
    assert (short.bounds.max(), short.grid.max()) == (0.015, 0.015) and len(short.grid) < len(latency.grid)
    fast = replace(cut_log(log({}), arm()), period=1e-4)
    problem = Problem.of(fast, simulator_of(cut_log(log({}), arm()), nominal(arm()), 0.002), QUICK, lambda phase: None)
    (tried,) = (candidate for candidate in problem.library if candidate.effect == "command_latency")
    assert tried.bounds.max() == pytest.approx(0.0127)


def test_a_latency_of_tens_of_milliseconds_shows_in_a_log_at_1_khz() -> None:
    rng, period, paths = np.random.default_rng(1), 0.001, motions()
    paths = {name: np.repeat(path, 20, axis=0)[:1500] for name, path in paths.items() if name[:5] in ("steps", "chirp")}
    late = Held.of(apply_all(nominal(arm()), build({"command_latency": {"delay": 0.025}})), 0.0005, period)
    played = late.play([*paths.values()], [path[0] for path in paths.values()], 1000)
    noisy = [path + 5e-4 * rng.standard_normal(path.shape) for path in played]
    episodes = tuple(
        Trajectory(period * np.arange(len(position)), targets, position, np.zeros_like(position))
        for targets, position in zip(paths.values(), noisy, strict=True)
    )
    batch = Batch(episodes, arm().controlled, period, {"episodes": [{"policy": name} for name in paths]})
    ((cause, value),) = diagnose(batch, nominal(arm()), 0.002, FEW, lambda phase: None).selection.chosen.pairs
    assert cause.effect == "command_latency" and value[0] == pytest.approx(0.025, abs=1e-3)


def test_replays_are_no_finer_than_a_late_encoder_is_remembered() -> None:
    quiet = replace(log({}, noise=1e-7), metadata={"episodes": log({}).metadata["episodes"]})
    simulator = simulator_of(cut_log(quiet, replace(arm(), encoder_step=1e-7)), nominal(arm()), 0.002)
    late = apply_all(nominal(arm()), build({"sensor_delay": {"delay": 0.03}}))
    path = [motions()["chirp_a"]]
    steps = simulator.log_step, 2.0 * simulator.log_step
    fine, coarse = (Held.of(late, step, PERIOD, accurate=True).play(path, [path[0][0]], 1)[0] for step in steps)
    assert simulator.step < 0.0005
    np.testing.assert_allclose(fine, coarse, atol=2e-3)


def test_the_library_is_tried_whole_but_for_what_is_left_out() -> None:
    names = {candidate.effect for candidate in library(arm())}
    assert {"backlash", "command_latency", "centre_of_mass", "gravity_tilt", "stribeck_friction"} <= names
    assert names - {candidate.effect for candidate in library(arm(), ("backlash",))} == {"backlash"}
    for candidate in library(arm()):
        for parameters in candidate.grid:
            apply_all(nominal(arm()), build({candidate.effect: candidate.entry(parameters)}))


def test_threads_do_not_change_the_answer() -> None:
    single, other = (
        diagnose(log({}, 3), nominal(arm()), 0.002, replace(FEW, threads=threads), lambda phase: None)
        for threads in (1, 3)
    )
    assert single.selection.none.cost == other.selection.none.cost
    assert [h.cost for h in single.selection.tried] == [h.cost for h in other.selection.tried]


@pytest.mark.parametrize("step", [0.002, 0.001])
def test_a_robot_like_the_simulator_has_no_gap_whatever_the_step_of_who_logged_it(step: float) -> None:
    held = Held.of(nominal(arm()), PERIOD / 160, PERIOD)
    rng, played = np.random.default_rng(3), motions()
    batch = Batch(
        tuple(logged(held, played[name], NOISE, rng) for name in played),
        arm().controlled,
        PERIOD,
        {"episodes": [{"policy": name} for name in played]},
    )
    result = diagnose(batch, nominal(arm()), step, FEW, lambda phase: None)
    assert result.verdict.word == "no_gap"
    assert result.log.comparison.floor.min() > 0.0 and result.simulator.step <= step
