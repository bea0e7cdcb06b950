"""A blind benchmark: seals hold, strengths are what they say, two generators agree, and marks are counted right."""

import json
import re
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from blind_arm import arm
from commands import done, gsl

from gsl.core.plant import Plant, nominal
from gsl.core.statistics import quantile_interval, wilson
from gsl.effects.effect import apply_all, build
from gsl.policies.excitation import Excitation
from gsl.report.console import Console
from gsl.robots.nao import nao
from gsl.storage.hashing import file_hash
from gsl.storage.records import Records
from gsl.worlds.held import Held, Windows
from gsl.worlds.servo_state import COMMANDS
from gsl_benchmarks.blind.dials import draw, visible
from gsl_benchmarks.blind.extras import EXTRAS
from gsl_benchmarks.blind.figures import Figure, figures, reliability
from gsl_benchmarks.blind.foreign import play_foreign
from gsl_benchmarks.blind.jitter import jitter
from gsl_benchmarks.blind.label import ABSENT, FOREIGN, JOINT, NULL, SAME, SINGLE, TWO, WITHHELD, Label
from gsl_benchmarks.blind.make import DIALLED, Workshop, log_readings, measure_gap, rng_of
from gsl_benchmarks.blind.mark import Mark, mark_answer
from gsl_benchmarks.blind.mix import Mix, Slot, slots
from gsl_benchmarks.blind.programmes import Programme, draw_programmes
from gsl_benchmarks.blind.rigid_mujoco import play_mujoco
from gsl_benchmarks.blind.same import SETTLE, STEP, play_same
from gsl_benchmarks.blind.strength import BANDS, Yardstick, turn_up
from gsl_benchmarks.blind_answer import BlindAnswer

pytestmark = pytest.mark.slow

PERIOD = 0.02
TOY = (
    "sim.robot=blind_arm.arm", "sim.floating=false", "excitation.motions=[steps_large,triangle_fast]",
    "excitation.repeated=[steps_large]", "excitation.duration=1.6", "programmes=1", "workers=1", "name=toy",
)  # fmt: skip
QUICK = ("nulls=0", "duels=0", "most=1", "workers=1", "name=toy")


def programme(robot: str = "blind_arm.arm", seconds: float = 1.6) -> Programme:
    like = Excitation(robot=robot, motions=("steps_large", "triangle_fast"), duration=seconds, repeats=1)
    return draw_programmes(like, 1, PERIOD, np.random.default_rng(0))[0]


def keep_a_secret(labels: Path) -> None:
    """Let a benchmark be the same in every run of the tests."""
    labels.mkdir(parents=True)
    (labels / "secret.txt").write_text("the same in every run\n")


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A benchmark of two cases, answered and revealed; nobody may change anything in it for good."""
    folder = tmp_path_factory.mktemp("blind")
    keep_a_secret(folder / "runs/toy/blind_make_labels")
    done("blind", "make", "cases=2", "mix.foreign=120", *TOY, folder=folder)
    labels = folder / "runs/toy/blind_make_labels"
    shutil.move(labels, folder / "away")  # nothing of it may be needed for an answer
    done("blind", "answer", "baselines=true", "trust=blind_arm", *QUICK, folder=folder)
    shutil.move(folder / "away", labels)
    done("blind", "reveal", "name=toy", folder=folder)
    return folder


# --- from end to end


def test_a_toy_goes_from_end_to_end(toy: Path) -> None:
    answers = toy / "runs/toy/blind_answer"
    names = {path.name for path in (toy / "runs/toy/blind_make/cases").iterdir()}
    assert {path.stem for path in (answers / "answers").iterdir()} == names
    assert {path.name for path in (answers / "baselines").iterdir()} == {
        "everything", "one_step", "rules", "training_error",
    }  # fmt: skip
    results = json.loads((toy / "runs/toy/blind_reveal/results.json").read_text())
    assert results.keys() == {"gsl", "everything", "one_step", "rules", "training_error"}
    assert results["gsl"]["cases"] == 2
    assert all(case["longest_seconds"] > 0.0 for case in results.values())
    assert "| top-1, medium and strong |" in (toy / "runs/toy/blind_reveal/results.md").read_text()


def test_a_case_tells_nothing_of_its_label(toy: Path) -> None:
    labels = json.loads((toy / "runs/toy/blind_make_labels/labels.json").read_text())["cases"]
    for name, entry in labels.items():
        case = toy / "runs/toy/blind_make/cases" / name
        document = json.loads((case / "case.json").read_text())
        assert document.keys() == {"sim", "without"}
        assert (case / "reference.parquet").exists() == (entry["label"]["generator"] == FOREIGN)
        metadata = (case / "log.parquet").read_bytes()
        assert not [effect for effect in (*visible(), *EXTRAS) if effect.encode() in metadata]
        assert b'"seed": null' in metadata and b'"world": null' in metadata
    secret = (toy / "runs/toy/blind_make_labels/secret.txt").read_text().strip()
    assert not [path for path in (toy / "runs/toy/blind_make").rglob("*.*") if secret.encode() in path.read_bytes()]


def test_the_same_secret_and_seed_make_the_same_benchmark(toy: Path, tmp_path: Path) -> None:
    made = toy / "runs/toy/blind_make"
    (tmp_path / "labels").mkdir()
    shutil.copy(toy / "runs/toy/blind_make_labels/secret.txt", tmp_path / "labels")
    again = ("cases=2", "mix.foreign=120", *TOY, "labels=labels", "out=again")
    done("blind", "make", *again, folder=tmp_path)
    assert (tmp_path / "again/seals.json").read_bytes() == (made / "seals.json").read_bytes()
    said = gsl("blind", "make", *again, "seed=2", "force=true", folder=tmp_path)
    assert said.code == 1 and "holds the labels of another benchmark" in said.err


def test_labels_do_not_lie_among_the_data(tmp_path: Path) -> None:
    said = gsl("blind", "make", *TOY, "out=data", "labels=data/labels", folder=tmp_path)
    assert said.code == 1 and "lies below out" in said.err


def changed_label(runs: Path) -> None:
    path = runs / "blind_make_labels/labels.json"
    path.write_text(re.sub(r'"noise": 0\.001', '"noise": 0.002', path.read_text(), count=1))


def changed_nonce(runs: Path) -> None:
    path = runs / "blind_make_labels/labels.json"
    path.write_text(re.sub(r'"nonce": "\w', '"nonce": "x', path.read_text(), count=1))


def changed_log(runs: Path) -> None:
    with (runs / "blind_make/cases/case_0002/log.parquet").open("ab") as file:
        file.write(b"x")


def changed_answer(runs: Path) -> None:
    path = runs / "blind_answer/answers/case_0002.json"
    path.write_text(path.read_text().replace('"verdict": "', '"verdict": "not_'))


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (changed_label, "the seal of case_0001 does not hold, its label or nonce"),
        (changed_nonce, "the seal of case_0001 does not hold, its label or nonce"),
        (changed_log, "case_0002/log.parquet: the seal does not hold"),
        (changed_answer, "the seal of case_0002.json does not hold"),
    ],
)
def test_a_broken_seal_is_seen(toy: Path, tmp_path: Path, change: Any, complaint: str) -> None:
    places = {name: tmp_path / name for name in ("blind_make", "blind_answer", "blind_make_labels")}
    for name, place in places.items():
        shutil.copytree(toy / "runs/toy" / name, place)
    change(tmp_path)
    where = [f"data={places['blind_make']}", f"answers={places['blind_answer']}"]
    said = gsl("blind", "reveal", *where, f"labels={places['blind_make_labels']}", "out=seen", folder=tmp_path)
    assert said.code != 0 and complaint in said.err and len(said.lines) == 1


def test_a_stopped_run_goes_on_with_what_is_missing(toy: Path, tmp_path: Path) -> None:
    data, whole = toy / "runs/toy/blind_make", toy / "runs/toy/blind_answer/answers"
    (tmp_path / "answers").mkdir()
    left = (whole / "case_0001.json").read_text() + " "  # by a stopped run
    (tmp_path / "answers/case_0001.json").write_text(left)
    (tmp_path / "answers/case_0002.json").write_text("of a worker that was killed")
    record = {"answers/case_0001.json": file_hash(tmp_path / "answers/case_0001.json")}
    Records(tmp_path / BlindAnswer.progress, str).append(record)
    stage = BlindAnswer(data=str(data), nulls=0, duels=0, most=1, workers=1, trust=("blind_arm",))
    result = stage.run(tmp_path, Console(json=True))
    assert result["cases"] == 2 and not (tmp_path / BlindAnswer.progress).exists()
    assert (tmp_path / "answers/case_0001.json").read_text() == left
    first, again = ((place / "case_0002.json").read_bytes() for place in (whole, tmp_path / "answers"))
    assert first == again


def test_a_mix_is_kept_in_proportion() -> None:
    cases = slots(Mix(), 240, 4, np.random.default_rng(0))
    count = {kind: sum(slot.kind == kind for slot in cases) for kind in (NULL, SINGLE, JOINT, TWO, WITHHELD, ABSENT)}
    assert count == {NULL: 40, SINGLE: 112, JOINT: 24, TWO: 24, WITHHELD: 20, ABSENT: 20}
    assert sum(slot.generator == FOREIGN for slot in cases) == 60
    for kind in count:
        assert any(slot.generator == FOREIGN for slot in cases if slot.kind == kind)
    assert len(slots(Mix(), 16, 4, np.random.default_rng(0))) == 16


# --- generators


def starting(targets: list[np.ndarray]) -> list[np.ndarray]:
    return [path[0] for path in targets]


@pytest.fixture(scope="module")
def robot() -> Plant:
    return nominal(nao())


@pytest.fixture(scope="module")
def played(robot: Plant) -> Programme:
    return programme("nao")


def told(player: Any, plant: Plant, made: Programme, effects: Mapping[str, Any], extra: Any = None) -> np.ndarray:
    targets = made.targets(plant.robot)
    return np.concatenate(player(plant, effects, extra, targets, starting(targets), PERIOD))


def test_the_same_generator_is_the_chain_model(robot: Plant, played: Programme) -> None:
    effects = {"coulomb_friction": {"torque": 0.1}, "command_latency": {"delay": 0.012}}
    path = played.targets(robot.robot)[0]
    targets = np.vstack([np.repeat(path[:1], COMMANDS - 1 + SETTLE, axis=0), path])
    begin = np.array([[path[0], np.zeros_like(path[0])]])
    windows = Windows(np.ascontiguousarray(targets[::-1])[None], begin, np.array([-SETTLE * PERIOD]))
    expected = Held.of(apply_all(robot, build(effects)), STEP, PERIOD).replay(windows)[0, SETTLE - 1 :]
    assert np.array_equal(play_same(robot, effects, None, [path], [path[0]], PERIOD)[0], expected)


def test_generators_agree_where_nothing_is_at_work(robot: Plant, played: Programme) -> None:
    other = jitter(robot, np.random.default_rng(1))
    gap = told(play_foreign, other, played, {}) - told(play_same, other, played, {})
    assert 1e-5 < np.sqrt(np.mean(gap**2)) < 1e-3
    assert np.abs(gap).max() < 6e-3


@pytest.mark.parametrize(
    "effects",
    [
        {"command_latency": {"delay": 0.013}},
        {"target_smoothing": {"time_constant": 0.02}},
        {"deadband": {"width": 0.01, "joints": "legs"}},
        {"quantisation": {"step": 0.01}},
        {"servo_gain": {"kp": 0.6, "kd": 0.7, "joints": "LKneePitch"}},
        {"coulomb_friction": {"torque": 0.2}},
        {"viscous_friction": {"coefficient": 0.5, "joints": "arms"}},
        {"stribeck_friction": {"torque": 0.3, "velocity": 0.3}},
        {"load_friction": {"coefficient": 0.3}},
        {"torque_limit": {"factor": 0.3}},
        {"supply_sag": {"resistance": 3.0}},
        {"duty_loss": {"coefficient": 0.5}},
        {"gain_fade": {"rate": 0.2}},
        {"armature": {"inertia": 0.03}},
        {"zero_offset": {"offset": 0.03, "joints": "RHipRoll"}},
        {"sensor_bias": {"bias": -0.02}},
        {"joint_limit": {"reduction": 1.0, "side": "upper", "joints": "LKneePitch"}},
        {"link_mass": {"link": "LFoot", "mass": 0.5}},
        {"centre_of_mass": {"link": "LThigh", "x": 0.2, "z": 0.1}},
        {"gravity_tilt": {"roll": 0.5, "pitch": -0.8}},
    ],
    ids=lambda effects: next(iter(effects)),
)
def test_an_effect_means_the_same_to_both_generators(robot: Plant, played: Programme, effects: dict[str, Any]) -> None:
    shift = [
        told(player, robot, played, effects) - told(player, robot, played, {}) for player in (play_same, play_foreign)
    ]
    size = [np.sqrt(np.mean(difference**2)) for difference in shift]
    assert np.sqrt(np.mean((shift[0] - shift[1]) ** 2)) < 0.35 * max(size)


@pytest.mark.parametrize(
    "effects", [{}, {"link_mass": {"link": "LFoot", "mass": 0.5}}, {"gravity_tilt": {"roll": 0.5}}], ids=str
)
def test_mujoco_moves_the_bodies_as_the_chain_model_does(
    robot: Plant, played: Programme, effects: dict[str, Any]
) -> None:
    extra = {"effect": "cogging", "joints": "all", "amplitude": 0.5, "number": 20.0}
    chain, mujoco = (told(player, robot, played, effects, extra) for player in (play_foreign, play_mujoco))
    assert np.abs(chain - mujoco).max() < 1e-7  # another engine and the same integrator: the rest is rounding


def test_the_last_programme_is_of_few_motions() -> None:
    like = Excitation(robot="blind_arm.arm", duration=1.6)
    first, *_, last = draw_programmes(like, 3, PERIOD, np.random.default_rng(0))
    assert len(first.names) == 20 and len(set(first.names)) == 18
    assert len(last.names) == len(set(last.names)) == 5


def test_a_jittering_clock_moves_readings_and_not_the_commands() -> None:
    times = PERIOD * np.arange(200)
    path = np.sin(2.0 * times)[:, None]
    read = [log_readings(times, path, share * PERIOD, 0.0, np.random.default_rng(0)) for share in (0.0, 0.3)]
    assert np.array_equal(read[0], path)
    assert 0.0 < np.abs(read[1] - path)[4:-4].max() < 1e-5  # an import puts stamps on rows


@pytest.mark.parametrize(
    "effects",
    [{"backlash": {"width": 0.02}}, {"joint_compliance": {"compliance": 0.02}}, {"sensor_delay": {"delay": 0.007}}],
)
def test_what_makes_servos_shake_is_as_large_in_both_generators(
    robot: Plant, played: Programme, effects: dict[str, Any]
) -> None:
    for player in (play_same, play_foreign):
        shift = told(player, robot, played, effects) - told(player, robot, played, {})
        assert 2e-3 < np.sqrt(np.mean(shift**2)) < 3e-2


def test_a_taut_cable_pulls_as_a_spring(robot: Plant) -> None:
    rest = np.zeros(16)
    path = np.repeat(rest[None], 100, axis=0)
    path[1:, 2] = 0.1
    extra = {"effect": "cable_spring", "joints": "LHipPitch", "stiffness": 20.0, "slack": 0.05, "side": 1.0}
    free = replace(robot, gravity=np.zeros(3))
    for player in (play_same, play_foreign):
        end = player(free, {}, extra, [path], [rest], PERIOD)[0][-1, 2]
        assert end == pytest.approx((150.0 * 0.1 + 20.0 * 0.05) / 170.0, abs=1e-4)


def test_a_warming_motor_weakens_from_motion_to_motion(robot: Plant) -> None:
    path = np.repeat(np.zeros((1, 16)), 150, axis=0)
    extra = {"effect": "warming", "joints": "all", "share": 0.9}
    heavy = replace(robot, gravity=np.array([0.0, 40.0, -60.0]))
    sags = [np.abs(position[-1]).max() for position in play_same(heavy, {}, extra, [path] * 3, [path[0]] * 3, PERIOD)]
    assert sags[0] < sags[1] < sags[2]


@pytest.mark.parametrize(
    ("name", "shapes"),
    [("cogging", {"amplitude": 0.5, "number": 20.0}), ("bouc_wen", {"torque": 0.5, "yielding": 0.1})],
)
def test_what_the_library_lacks_moves_both_generators_alike(
    robot: Plant, played: Programme, name: str, shapes: dict[str, float]
) -> None:
    extra = {"effect": name, "joints": "all", **shapes}
    shift = [
        told(player, robot, played, {}, extra) - told(player, robot, played, {}) for player in (play_same, play_foreign)
    ]
    size = np.sqrt(np.mean(shift[0] ** 2))
    assert size > 5e-4 and np.sqrt(np.mean((shift[0] - shift[1]) ** 2)) < 0.2 * size


# --- strengths


@pytest.mark.parametrize("generator", [SAME, FOREIGN])
@pytest.mark.parametrize("strength", list(BANDS))
def test_an_effect_is_turned_up_into_its_band(generator: str, strength: str) -> None:
    plant, rng = nominal(arm()), np.random.default_rng(3)
    yardstick = Yardstick.of(plant, 0.002, PERIOD, DIALLED[generator], programme())
    dial = draw("command_latency", plant.robot, rng)
    gap = measure_gap(dial, yardstick, 0.001)
    turn = turn_up(gap, strength, rng)
    assert turn is not None
    low, high = BANDS[strength]
    assert low <= turn[1] <= high and gap(turn[0]) == pytest.approx(turn[1])


def test_what_cannot_reach_a_band_is_refused() -> None:
    assert turn_up(lambda share: 1.0 + share, "medium", np.random.default_rng(0)) is None


def test_what_is_in_a_band_however_small_it_is_has_no_size_and_is_refused() -> None:
    assert turn_up(lambda share: 4.0 + 10.0 * share, "medium", np.random.default_rng(0)) is None
    assert turn_up(lambda share: 2.0 + 10.0 * share, "medium", np.random.default_rng(0)) is not None


@pytest.mark.parametrize("kind", [NULL, JOINT, TWO, WITHHELD, ABSENT])
def test_a_case_is_what_its_slot_wants(kind: str) -> None:
    shop = Workshop(nominal(arm()), 0.002, PERIOD, (programme(),))
    slot = Slot(kind, SAME, "none" if kind == NULL else "medium", 3, 0)
    case, again, other = (shop.case("case_0001", slot, rng_of(secret, 1, "x")) for secret in ("a", "a", "b"))
    label = case.label
    assert len(label.effects) == {NULL: 0, JOINT: 1, TWO: 2, WITHHELD: 1, ABSENT: 0}[kind]
    assert (label.extra is not None) == (kind == ABSENT)
    assert label.without == (tuple(label.effects) if kind == WITHHELD else ())
    assert kind != JOINT or next(iter(label.effects.values()))["joints"] in ("shoulder", "elbow")
    assert label == again.label != other.label
    assert np.array_equal(case.log.episodes[0].position, again.log.episodes[0].position)
    assert case.reference is None


# --- marks


def label(kind: str = SINGLE, strength: str = "medium", generator: str = SAME, **more: Any) -> Label:
    effects = {"armature": {"inertia": 0.02, "joints": "all"}}
    settings = {"effects": effects, "neutral": {"armature": {"inertia": 0.0}}, **more}
    return Label("case_0001", kind, generator, strength, 4.0, **settings)


def cause(effect: str = "armature", value: float = 0.02, probability: float = 0.9, **more: Any) -> dict[str, Any]:
    parameters = {"inertia": {"value": value, "low": value - 0.002, "high": value + 0.002}}
    return {"effect": effect, "joints": ["all"], "parameters": parameters, "probability": probability, **more}


def answer(*causes: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"verdict": "causes", "causes": list(causes), "inseparable": [], "ranking": [], "seconds": 10.0, **more}


def test_the_first_cause_and_the_second() -> None:
    assert (mark_answer(label(), answer(cause())).first, mark_answer(label(), answer(cause())).second) == (True, True)
    later = mark_answer(label(), answer(cause("deadband"), cause()))
    assert (later.first, later.second, later.extra) == (False, True, 1)
    ranked = answer(cause("deadband"), ranking=[{"effects": ["deadband"]}, {"effects": []}, {"effects": ["armature"]}])
    assert (mark_answer(label(), ranked).first, mark_answer(label(), ranked).second) == (False, True)
    third = answer(cause("deadband"), ranking=[{"effects": ["deadband"]}, {"effects": ["kd", "armature"]}])
    assert not mark_answer(label(), third).second


def test_inseparable_is_the_second_best_and_twins_are_one() -> None:
    group = answer(cause(), verdict="inseparable", inseparable=[["armature", "viscous_friction"]])
    assert (mark_answer(label(), group).first, mark_answer(label(), group).second) == (False, True)
    offset = label(effects={"sensor_bias": {"bias": 0.02, "joints": "all"}}, neutral={"sensor_bias": {"bias": 0.0}})
    twin = cause("zero_offset") | {"parameters": {"offset": {"value": 0.021, "low": 0.019, "high": 0.023}}}
    mark = mark_answer(offset, answer(twin, verdict="inseparable", inseparable=[["sensor_bias", "zero_offset"]]))
    assert (mark.first, mark.twin, mark.covered, mark.extra) == (False, True, (True,), 0)
    assert mark.errors == {"zero_offset": pytest.approx(0.05)}


def test_errors_are_of_the_way_from_doing_nothing() -> None:
    gain = label(effects={"servo_gain": {"kp": 0.7, "joints": "all"}}, neutral={"servo_gain": {"kp": 1.0}})
    parameters = {"kp": {"value": 0.76, "low": 0.71, "high": 0.8}, "kd": {"value": 1.0, "low": 0.9, "high": 1.1}}
    mark = mark_answer(gain, answer({"effect": "servo_gain", "parameters": parameters, "probability": 0.9}))
    assert mark.errors == {"servo_gain": pytest.approx(0.2)} and mark.covered == (False,)
    mass = label(effects={"link_mass": {"link": "a", "mass": 0.2}}, neutral={"link_mass": {"mass": 0.0}})
    assert mark_answer(mass, answer(cause("link_mass", fixed={"link": "b"}))).errors == {}


def hand_made() -> list[Mark]:
    """Twelve marks of which every count is known."""
    fault = label(JOINT, effects={"armature": {"inertia": 0.02, "joints": "elbow"}})
    two = label(TWO, effects={"armature": {"inertia": 0.02}, "deadband": {"width": 0.01}}, neutral={})
    unknown, fine = answer(verdict="unknown"), answer(verdict="no_gap")
    place = [{"joint": "elbow", "regime": "all", "share": 0.9}, {"joint": "shoulder", "regime": "all", "share": 0.1}]
    shrunk = {"shrinkage": {"fraction": 0.9, "ceiling_fraction": 0.75}}
    return [
        mark_answer(label(), answer(cause(value=0.021), **shrunk)),
        mark_answer(label(strength="strong"), answer(cause("deadband", probability=0.7), seconds=30.0)),
        mark_answer(label(strength="weak"), unknown),
        mark_answer(label(strength="weak"), fine),
        mark_answer(fault, answer(cause() | {"joints": ["elbow"]}, where=place)),
        mark_answer(fault, answer(cause() | {"joints": ["shoulder", "elbow"]}, where=place)),
        mark_answer(two, answer(cause(), cause("deadband"))),
        mark_answer(two, answer(cause(), cause("quantisation"))),
        mark_answer(label(NULL, effects={}), fine),
        mark_answer(label(NULL, effects={}), answer(cause(probability=0.3))),
        mark_answer(label(WITHHELD), unknown),
        mark_answer(label(ABSENT, effects={}, extra={"effect": "cogging"}), answer(cause(probability=0.5))),
    ]


EXPECTED = {
    "top-1, medium and strong": (0.5, 2),
    "top-2, medium and strong": (0.5, 2),
    "top-1, weak": (0.0, 2),
    "top-1, strong": (0.0, 1),
    "wrong name, weak": (0.0, 2),
    "two effects: both named": (0.5, 2),
    "two effects: at least one": (1.0, 2),
    "fault of one joint: right joint": (0.5, 2),
    "fault of one joint: joint on the map": (1.0, 2),
    "fault of one joint: top-1": (1.0, 2),
    "false alarm without a cause": (0.5, 2),
    "abstains, effect withheld": (1.0, 1),
    "abstains, effect never in the library": (0.0, 1),
    "abstains wrongly": (1 / 8, 8),
    "misses the gap": (1 / 8, 8),
    "names more than there is": (1 / 5, 5),
    "error of parameters": (0.0, 3),
    "shrinkage over the ceiling": (1.2, 1),
    "wall time [s]": (10.0, 12),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_every_figure_counts_what_it_says(name: str) -> None:
    counted: Figure = next(figure for figure in figures(hand_made()) if (figure.name, figure.generator) == (name, SAME))
    assert (pytest.approx(counted.value), counted.count) == EXPECTED[name]


def test_a_threshold_is_met_or_missed() -> None:
    by_name = {figure.name: figure for figure in figures(hand_made()) if figure.generator == SAME}
    assert by_name["two effects: at least one"].met and not by_name["false alarm without a cause"].met
    assert by_name["top-1, weak"].met is None
    assert all(
        figure.value is None for figure in figures(hand_made()) if figure.generator == FOREIGN and figure.name != ""
    )


def test_reliability_compares_what_was_said_with_what_was_right() -> None:
    said = [mark_answer(label(), answer(cause(probability=p))) for p in np.linspace(0.8, 1.0, 10)]
    said += [mark_answer(label(), answer(cause("deadband", probability=p))) for p in np.linspace(0.1, 0.3, 10)]
    bins = reliability(said)
    assert [size for *_, size in bins] == [4] * 5
    assert [round(right, 2) for _, right, _ in bins] == [0.0, 0.0, 0.5, 1.0, 1.0]
    ece = next(figure for figure in figures(said) if figure.name.startswith("calibration"))
    assert ece.value == pytest.approx(sum(abs(p - r) * n for p, r, n in bins) / 20)


def test_intervals_of_shares_and_medians() -> None:
    assert wilson(8, 10) == pytest.approx((0.8, 0.4902, 0.9433), abs=1e-4)  # Brown, Cai and DasGupta 2001
    assert wilson(37, 37).lower == pytest.approx(0.906, abs=1e-3)
    assert wilson(0, 10) == pytest.approx((0.0, 0.0, 0.2775), abs=1e-4)
    assert quantile_interval(np.arange(1.0, 11.0)) == (5.5, 2.0, 9.0)  # tables of the sign test: 2nd and 9th of ten
