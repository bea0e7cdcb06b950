"""What is known of single trajectories: effects that are no cause, labels that hold out, torque that was off."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import done, refused
from swinging_arm import FEW, PERIOD, arm, log

from gsl.core.history import History
from gsl.core.labels import alike
from gsl.core.plant import nominal
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.diagnose import diagnose
from gsl.diagnosis.log.files import clock_caveat, read_logs, share_clock
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.log.records import to_records
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.in_the_air import InTheAir
from gsl.diagnosis.simulate.simulator import mean_errors, simulator_of
from gsl.diagnosis.verdict.document import document
from gsl.effects.effect import names
from gsl.errors import ConfigError, InputError
from gsl.grounding.gat import LoadedTransformation
from gsl.models.config import ModelConfig
from gsl.models.forward import ForwardModel
from gsl.models.inverse import Solver
from gsl.models.linear import fit_linear
from gsl.report.cross_validation import AS_IT_WAS, DIAGNOSED, Fold, table
from gsl.storage.trajectories import write
from gsl.validation.learned_replay import LearnedReplay, Simulated
from gsl.worlds.bullet import BulletWorld

pytestmark = pytest.mark.slow

SOFT = {"servo_gain": {"kp": 0.5}}
LATE, STICKY = {"command_latency": {"delay": 0.04}}, {"viscous_friction": {"coefficient": 1.0}}


def labelled(batch: Batch, **more: Any) -> Batch:
    labels = [{**labels_of, **more} for labels_of in batch.metadata["episodes"]]
    return replace(batch, metadata={**batch.metadata, "episodes": labels})


def joined(first: Batch, second: Batch) -> Batch:
    labels = [*first.metadata["episodes"], *second.metadata["episodes"]]
    return replace(first, episodes=(*first.episodes, *second.episodes), metadata={**first.metadata, "episodes": labels})


def both(**cause: Any) -> Batch:
    """One robot, with half the gain in half of its trajectories."""
    stiff = labelled(log(cause, jitter=0.0), gain=1.0)
    soft = labelled(log({**cause, **SOFT}, jitter=0.0), gain=0.5, conditions=SOFT)
    return joined(stiff, soft)


def test_what_is_known_of_a_trajectory_is_no_gap() -> None:
    exp = cut_log(both(), arm())
    simulator = simulator_of(exp, nominal(arm()), 0.002)
    left = exp.comparison.residual(simulator.simulate({}, no_shifts(2), exp.pieces), exp.pieces)
    forgotten = replace(exp.pieces, conditions=())
    gap = exp.comparison.residual(simulator.simulate({}, no_shifts(2), forgotten), forgotten)
    assert np.sqrt(np.mean(left**2)) == pytest.approx(1.0, abs=0.1)
    assert np.sqrt(np.mean(gap**2)) > 5.0


def test_a_cause_is_found_beside_what_is_known() -> None:
    options = replace(FEW, held_out={"gain": 0.5}, most=2)
    findings = diagnose(both(command_latency={"delay": 0.016}), nominal(arm()), 0.002, options, lambda _: None)
    assert findings.selection.chosen.names == ("command_latency",)
    held = {findings.log.records[k].about["gain"] for k in findings.log.pieces.record[findings.log.held_out]}
    assert held == {0.5}
    assert document(findings)["shrinkage"]["fraction"] > 0.95


def test_repeats_under_other_conditions_are_no_noise() -> None:
    exp = cut_log(both(), arm())
    assert exp.noise.source == "repeats"
    assert exp.noise.sd.max() < 0.003


@pytest.mark.parametrize(
    ("label", "other", "same"),
    [
        (1, "1", True),
        (100, 100.0, True),
        ("0.50", 0.5, True),
        ("up", "up", True),
        ("up", "down", False),
        (1, True, False),
        (None, "None", False),
        ("nan", float("nan"), True),
    ],
)
def test_labels_are_numbers_however_they_are_written(label: Any, other: Any, same: bool) -> None:
    assert alike(label, other) is alike(other, label) is same


def test_a_label_that_is_text_can_be_held_out_by_its_number() -> None:
    log_of_two = joined(labelled(log({}), repeat="1"), labelled(log({}), repeat="2"))
    exp = cut_log(log_of_two, arm(), held_out={"repeat": 1})
    assert {exp.records[k].about["repeat"] for k in exp.pieces.record[exp.held_out]} == {"1"}


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ({"gain": 2.0}, "held_out: no trajectory of the log has {gain: 2.0}; there gain is 0.5, 1.0"),
        ({"gain": [0.5, 1.0]}, "held_out: every trajectory of the log has"),
        ({"gian": 1.0}, "held_out: no trajectory of the log has {gian: 1.0}; there gian is None"),
    ],
)
def test_labels_that_hold_out_nothing_or_all_are_refused(asked: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError) as caught:
        cut_log(both(), arm(), held_out=asked)
    assert str(caught.value).startswith(line)


def test_windows_without_torque_are_left_out() -> None:
    whole = log({})
    works = np.ones(len(whole.episodes[0]) + 1, dtype=bool)
    works[75:] = False
    cut = replace(whole.episodes[0], sensors={"enabled": works})
    some, every = (cut_log(batch, arm()) for batch in (replace(whole, episodes=(cut, *whole.episodes[1:])), whole))
    first = some.pieces.record == some.order.index(0)
    ends = (some.pieces.tick[first] + some.pieces.real.shape[1]) * PERIOD
    assert len(some.pieces) < len(every.pieces) and ends.max() <= 75 * PERIOD


def test_a_joint_without_torque_leaves_a_window_out_whichever_joint_it_is() -> None:
    whole = log({})
    rows = len(whole.episodes[0]) + 1
    off = np.arange(rows) < 75
    partly = replace(whole.episodes[0], sensors={"enabled.a": off, "enabled.b": np.ones(rows, dtype=bool)})
    exp = cut_log(replace(whole, episodes=(partly, *whole.episodes[1:])), arm())
    first, second = exp.order.index(0), exp.order.index(1)
    np.testing.assert_array_equal(exp.records[first].driven, off)
    assert (exp.pieces.tick[exp.pieces.record == first] + exp.pieces.real.shape[1]).max() <= 75
    assert exp.records[second].driven.all()


def test_a_whole_replay_is_of_what_is_driven() -> None:
    whole = log({})
    rows = np.arange(len(whole.episodes[0]) + 1)
    flags = {"late": rows >= 20, "between": (rows >= 20) & (rows < 90), "first": rows < 90, "never": rows < 0}
    episodes = tuple(replace(whole.episodes[0], sensors={"enabled": works}) for works in flags.values())
    every = cut_log(whole, arm())
    records = to_records(replace(whole, episodes=episodes, metadata={}), arm())
    errors = mean_errors(simulator_of(every, nominal(arm()), 0.002), {}, no_shifts(2), records, arm())
    assert np.isfinite(errors[:3]).all() and errors[:3].max() < 0.01
    assert np.isnan(errors[3]).all()


def test_a_log_says_whether_its_clocks_are_apart_and_the_command_line_wins(tmp_path: Path) -> None:
    made, about = (
        log({"command_latency": {"delay": 0.03}}),
        {"robot": "arm", "role": "imported", "source": "test", "seed": 1},
    )
    (tmp_path / "logs").mkdir()
    for name, clocks in (("a", {}), ("b", {"clocks": "unsynchronised"})):
        metadata = {**about, **clocks, **made.metadata}
        write(tmp_path / f"logs/{name}.parquet", replace(made, metadata=metadata))
    fine, apart = read_logs(str(tmp_path / "logs/a.parquet")), read_logs(str(tmp_path / "logs"))
    assert share_clock(fine, None) and not share_clock(fine, "unsynchronised") and clock_caveat(fine, None) is None
    assert not share_clock(apart, None) and clock_caveat(apart, None) is None
    assert share_clock(apart, "synchronised") and not share_clock(apart, "unsynchronised")
    assert clock_caveat(apart, "unsynchronised") is None
    warning = "The log says that its clocks are unsynchronised; clocks=synchronised was asked for and counts."
    line = (
        "real=logs/b.parquet",
        "sim.robot=blind_arm.arm",
        "sim.floating=false",
        "most=1",
        "nulls=0",
        "duels=0",
        "workers=1",
    )
    small = f"without=[{','.join(set(names()) - {'command_latency', 'coulomb_friction'})}]"
    for asked, caveats, causes in (("null", 0, []), ("synchronised", 1, ["command_latency"])):
        done("diagnose", *line, small, f"clocks={asked}", f"name=c_{asked}", folder=tmp_path)
        report = json.loads((tmp_path / f"runs/c_{asked}/diagnose/report.json").read_text())
        assert report["caveats"].count(warning) == caveats
        assert [cause["effect"] for cause in report["causes"]] == causes


def test_a_table_says_what_it_leaves_out_of_its_means() -> None:
    errors = {AS_IT_WAS: [0.004, 0.006, np.nan], "usual": [0.002, 0.002, np.nan], DIAGNOSED: [0.001, np.nan, np.nan]}
    fold = Fold([1], "causes", ["backlash"], {}, 0.5, None, ["a", "b", "c"], errors)
    text = table([fold, replace(fold, values=[2, 3], errors=dict.fromkeys(errors, [np.nan] * 3))], "day")
    assert "nan" not in text
    assert "| 4.0 " in text and "| 2, 3 " in text and "in 1 of 1 trajectories" in text
    assert "5 of 6 trajectories are in no mean" in text
    assert "(as it was 4, usual 4, diagnosed 5; 4 in every replay)" in text
    assert "usual [mrad]" in text and "usual [mm]" in table([fold], "day", "m")


CAUSE = {"command_latency": {"delay": 0.016}}
LINE = ("sim.robot=blind_arm.arm", "sim.floating=false", "most=1", "nulls=0", "duels=0", "workers=1", "by=gain")
SMALL = f"without=[{','.join(sorted(set(names()) - {'command_latency', 'coulomb_friction', 'viscous_friction'}))}]"


def written(made: Batch, path: Path) -> None:
    write(
        path, replace(made, metadata={"robot": "arm", "role": "imported", "source": "test", "seed": 1, **made.metadata})
    )


def folds(folder: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = json.loads((folder / "folds.json").read_text())
    return rows


@pytest.fixture(scope="module")
def validated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log of two gains and its cross-validation."""
    place = tmp_path_factory.mktemp("validated")
    written(both(**CAUSE), place / "logs.parquet")
    done("cross-validate", "real=logs.parquet", *LINE, SMALL, "name=c", folder=place)
    return place


def test_a_cross_validation_holds_out_label_by_label(validated: Path) -> None:
    folder = validated / "runs/c/cross_validate"
    assert [fold["values"] for fold in folds(folder)] == [[0.5], [1.0]]
    assert all(fold["causes"] == ["command_latency"] for fold in folds(folder))
    for fold in folds(folder):
        errors = {way: np.mean(values) for way, values in fold["errors"].items()}
        assert errors["diagnosed"] < 0.3 * errors["coulomb + viscous"]
        assert errors["diagnosed"] < 0.3 * errors["as it was"]
        assert len(fold["names"]) == len(fold["errors"]["GAT"]) == len(fold["errors"]["diagnosed + GAT"]) == 9
    assert "in 18 of 18 trajectories" in (folder / "table.md").read_text()
    said = refused("cross-validate", "real=logs.parquet", *LINE[:-1], "by=date", folder=validated)
    assert said == "by = date: needs a label with two values at least; the log's labels: gain, policy"
    for usual, line in (
        ("[ground_friction]", "ground_friction: is no effect of all joints"),
        ("[]", "names at least one"),
    ):
        said = refused("cross-validate", "real=logs.parquet", *LINE, f"usual={usual}", folder=validated)
        assert said.startswith("usual") and line in said
    said = refused("cross-validate", "real=logs.parquet", *LINE, "folds=3", folder=validated)
    assert said == "folds = 3: the label gain has 2 values"
    said = refused("cross-validate", "real=logs.parquet", *LINE, "folds=2", "checks=values", folder=validated)
    assert said == "folds = 2: two groups leave no next one to check on; take three, or checks=motions"
    said = refused("cross-validate", "real=logs.parquet", *LINE, "checks=values", folder=validated)
    assert said == "by = gain: two groups leave no next one to check on; take three, or checks=motions"


def test_values_are_held_out_in_groups(tmp_path: Path) -> None:
    written(log(CAUSE, jitter=0.0), tmp_path / "logs.parquet")
    by_motion = ("by=policy", "folds=2", "gat=null", "name=g")
    done("cross-validate", "real=logs.parquet", *LINE[:-1], SMALL, *by_motion, folder=tmp_path)
    first, second = folds(tmp_path / "runs/g/cross_validate")
    assert first["values"] == ["chirp_a", "poses_a", "steps_a", "triangle_a"]
    assert sorted(first["names"]) == ["chirp_a", "poses_a", "steps_a", "steps_a", "triangle_a"]
    assert second["values"] == ["chirp_b", "poses_b", "steps_b", "triangle_b"]


def learning(**how: Any) -> LearnedReplay:
    return LearnedReplay(model=ModelConfig(family="linear"), **how)


def world() -> BulletWorld:
    return BulletWorld(robot="swinging_arm.arm", effects={}, floating=False)


def bare() -> Simulated:
    return Simulated(world(), InTheAir(nominal(arm()), 0.002, PERIOD), arm(), {}, no_shifts(2))


def untouched() -> LoadedTransformation:
    forward = ForwardModel(fit_linear(np.ones((2, 16)), np.ones((2, 2)), ridge=1.0), History(3), arm().controlled)
    return LoadedTransformation(forward, Solver(forward, np.eye(2), 0.5), alpha=0.0)


def shortened(episode: Trajectory, ticks: int) -> Trajectory:
    rows = slice(0, ticks + 1)
    return replace(
        episode,
        time=episode.time[rows],
        action=episode.action[:ticks],
        position=episode.position[rows],
        velocity=episode.velocity[rows],
    )


def test_a_grounding_that_does_nothing_replays_as_the_chain_does() -> None:
    records = to_records(both(**CAUSE), arm())
    simulated = replace(bare(), effects={"coulomb_friction": {"torque": 0.05}}, nuisances=no_shifts(2) + 0.01)
    for record in (records[0], records[-1]):
        other = mean_errors(simulated.simulator, simulated.effects, simulated.nuisances, [record], arm())
        assert simulated.measure_replay(record, untouched(), 1) == pytest.approx(other.mean(), rel=1e-3)


@pytest.mark.parametrize(("cause", "residual", "left"), [(LATE, False, 0.85), (STICKY, True, 0.85)])
def test_a_learned_grounding_brings_replays_nearer(cause: dict[str, Any], residual: bool, left: float) -> None:
    records = to_records(log(cause, jitter=0.0), arm())
    errors = learning(residual=residual).errors(bare(), records[:6], records[6:], 1)
    assert np.mean(errors) < left * mean_errors(bare().simulator, {}, no_shifts(2), records[6:], arm()).mean()


@pytest.mark.parametrize("delay", [0.03, 0.04])
def test_on_top_of_a_diagnosed_delay_a_grounding_looks_over_it(delay: float) -> None:
    latency = {"command_latency": {"delay": delay}}
    records, late = to_records(log({**latency, **STICKY}, jitter=0.0), arm()), replace(bare(), effects=latency)
    before = mean_errors(late.simulator, latency, no_shifts(2), records[6:], arm()).mean()
    assert np.mean(learning().errors(late, records[:6], records[6:], 1)) < 0.85 * before


def test_a_correction_of_a_simulator_that_knows_gains_is_better_at_another_gain_than_a_model_of_logs() -> None:
    records = to_records(both(viscous_friction={"coefficient": 0.4}), arm())
    errors = {how: learning(residual=how).errors(bare(), records[:9], records[9:], 1) for how in (True, False)}
    assert np.mean(errors[True]) < 0.7 * np.mean(errors[False])


def test_too_few_trajectories_teach_no_grounding() -> None:
    made = log({})
    short = tuple(shortened(episode, 10) for episode in made.episodes)
    for episodes in (made.episodes[:2], (*made.episodes[:2], *short)):
        records = to_records(replace(made, episodes=episodes, metadata={}), arm())
        with pytest.raises(
            ConfigError, match="fewer than 3 trajectories of 29 control periods to learn from; gat=null"
        ):
            learning().errors(bare(), records, records, 1)


def test_short_trajectories_are_played_whole() -> None:
    made = log({})
    episodes = (*made.episodes[:2], *(shortened(episode, 60) for episode in made.episodes[2:4]))
    records = to_records(replace(made, episodes=episodes, metadata={}), arm())
    assert [len(path) for path in bare().play(records, {}, 0.0, 1)] == [100, 100, 60, 60]
    assert np.isfinite(learning().errors(bare(), records, records, 1)).all()


def test_replays_beside_others_have_no_noise_and_say_when_they_diverge() -> None:
    records = to_records(log({}), arm())[:3]
    noisy = replace(bare(), effects={"encoder_noise": {"sd": 0.01}, "action_noise": {"sd": 0.05}})
    assert noisy.measure_replay(records[0], untouched(), 1) == pytest.approx(
        bare().measure_replay(records[0], untouched(), 1), rel=1e-6
    )
    wild = replace(bare(), effects={"viscous_friction": {"coefficient": 50.0}})
    assert np.isnan(wild.measure_replay(records[0], untouched(), 1))


@pytest.mark.parametrize(
    ("model", "line"),
    [
        ({"sensors": ("gyro",)}, "gat.model.sensors: logs in the air have joints alone"),
        ({"rested": True}, "gat.model.rested: logs are learned from in cuts, which do not begin at rest"),
        ({"variables": ("a",)}, "gat.model.variables: whole replays are of all joints"),
        ({"members": 3}, "gat.model: replays are of one model that says a point"),
        ({"history": "auto"}, "gat.model: a correction has a history of one length, and plain angles"),
        ({"encoding": "sincos"}, "gat.model: a correction has a history of one length, and plain angles"),
    ],
)
def test_what_a_replay_cannot_learn_is_refused(model: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigError) as caught:
        LearnedReplay(model=ModelConfig(**model))
    assert str(caught.value).startswith(line)


def test_what_is_held_out_changes_nothing_of_its_diagnosis(validated: Path, tmp_path: Path) -> None:
    other = {"coulomb_friction": {"torque": 0.3}}
    stiff = labelled(log(CAUSE, jitter=0.0), gain=1.0)
    soft = labelled(log({**other, **SOFT}, jitter=0.0), gain=0.5, conditions=SOFT)
    written(joined(stiff, soft), tmp_path / "other.parquet")
    done("cross-validate", "real=other.parquet", *LINE, SMALL, "gat=null", "name=c", folder=tmp_path)
    first, second = (folds(place / "runs/c/cross_validate")[0] for place in (validated, tmp_path))
    assert first["values"] == second["values"] == [0.5]
    assert first["parameters"] == second["parameters"]
    assert first["errors"]["diagnosed"] != second["errors"]["diagnosed"]
