"""Blind cases on the ground: made, answered and counted apart from those in the air."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import done
from test_blind import answer, cause, keep_a_secret, label

from gsl.core.plant import nominal
from gsl.diagnosis.log.files import on_ground
from gsl.effects.effect import names
from gsl.robots.nao import nao
from gsl.storage.trajectories import read
from gsl.worlds.bullet import BulletWorld
from gsl_benchmarks.blind.dials import draw_on_foot, list_walk_effects
from gsl_benchmarks.blind.figures import confusion, figures
from gsl_benchmarks.blind.label import SAME, SINGLE, WALK
from gsl_benchmarks.blind.mark import mark_answer, right
from gsl_benchmarks.blind.mix import Mix, walk_slots
from gsl_benchmarks.blind.on_foot import Yardstick
from gsl_benchmarks.blind.seals import files_below
from gsl_benchmarks.blind.walks import Individual, Walks

pytestmark = pytest.mark.slow

SMALL = Walks(episodes=2, duration=1.0)
TOY = ("cases=0", "mix.walk=1", "walks.episodes=2", "walks.duration=1.0", "programmes=1", "workers=1", "name=toy")
WHOLE = "walks.still=0.97"  # of walks that end in a fall a diagnosis wants more than so short ones have
KEPT = ("command_latency", "ground_friction")


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A benchmark of one walk; nobody may change anything in it for good."""
    folder = tmp_path_factory.mktemp("walks")
    keep_a_secret(folder / "runs/toy/blind_make_labels")
    done("blind", "make", *TOY, WHOLE, folder=folder)
    return folder


def test_a_walk_goes_from_end_to_end(toy: Path, tmp_path: Path) -> None:
    made, labels = toy / "runs/toy/blind_make", toy / "runs/toy/blind_make_labels/labels.json"
    shutil.copytree(made / "cases", tmp_path / "data/cases")
    case = tmp_path / "data/cases/case_0001"
    asked = json.loads((case / "case.json").read_text())
    truth = next(iter(json.loads(labels.read_text())["cases"]["case_0001"]["label"]["effects"]))
    asked["without"] = [name for name in names() if name not in (*KEPT, truth)]  # a small library is quick
    (case / "case.json").write_text(json.dumps(asked))
    seals = json.loads((made / "seals.json").read_text())
    seals["cases"]["case_0001"]["files"] = files_below(case)
    (tmp_path / "data/seals.json").write_text(json.dumps(seals))
    quick = ("nulls=0", "duels=0", "most=1", "workers=1", "baselines=true")
    done("blind", "answer", "data=data", "out=answers", *quick, folder=tmp_path)
    done("blind", "reveal", "data=data", "answers=answers", f"labels={labels.parent}", "out=seen", folder=tmp_path)
    assert not (tmp_path / "answers/baselines").exists()  # they work in the air
    text = (tmp_path / "seen/results.md").read_text()
    assert f"| walk: {truth} |" in text
    figure = next(line for line in text.splitlines() if line.startswith("| walk, strong: top-1 |"))
    assert "[1]" in figure and "≥ 0.75" in figure


def test_a_walk_is_one_strong_effect_on_the_ground(toy: Path) -> None:
    made = toy / "runs/toy/blind_make"
    document = json.loads((toy / "runs/toy/blind_make_labels/labels.json").read_text())["cases"]["case_0001"]["label"]
    log = read(made / "cases/case_0001/log.parquet")
    assert (document["kind"], document["strength"], len(document["effects"])) == (WALK, "strong", 1)
    assert on_ground(log) and SMALL.on_foot(log) >= SMALL.still
    assert next(iter(document["effects"])).encode() not in (made / "cases/case_0001/log.parquet").read_bytes()


def test_walks_come_after_the_cases_in_the_air() -> None:
    mix = Mix(walk=20)
    slots = walk_slots(mix, np.random.default_rng(0))
    assert len(slots) == 20 and {slot.kind for slot in slots} == {WALK}
    assert mix.kinds == Mix().kinds
    assert len({slot.turn % len(list_walk_effects()) for slot in slots}) == min(20, len(list_walk_effects()))


def test_the_same_secret_makes_the_same_walk(toy: Path, tmp_path: Path) -> None:
    keep_a_secret(tmp_path / "runs/toy/blind_make_labels")
    done("blind", "make", *TOY, WHOLE, folder=tmp_path)
    for file in ("blind_make/seals.json", "blind_make_labels/labels.json"):
        assert (tmp_path / "runs/toy" / file).read_bytes() == (toy / "runs/toy" / file).read_bytes()


def test_gaps_on_the_ground_grow_with_the_effect() -> None:
    sim, rng = BulletWorld(robot="nao", effects={}, start_noise=0.02), np.random.default_rng(1)
    yardstick = Yardstick.of(sim, SMALL, 0.0015, rng)
    for effect in ("ground_compliance", "command_latency"):
        gaps = [yardstick.gap(draw_on_foot(effect, sim.plant, rng))(share) for share in (1e-3, 0.3, 1.0)]
        assert 1.0 <= gaps[0] < 1.2 < gaps[1] < gaps[2]


def test_the_ground_as_it_is_does_nothing() -> None:
    plant, rng = nominal(nao()), np.random.default_rng(0)
    friction = draw_on_foot("ground_friction", plant, rng)
    assert friction.entry(0.0) == {"friction": plant.contact.foot_friction}
    soft = draw_on_foot("ground_compliance", plant, rng)
    assert soft.entry(1.0)["stiffness"] == 2e3 and soft.entry(0.1)["stiffness"] == pytest.approx(2e4)
    assert draw_on_foot("link_mass", plant, rng).fixed["link"] == nao().base
    assert draw_on_foot("deadband", plant, rng).fixed["joints"] == "all"
    assert not {"encoder_noise", "action_noise", "uneven_ground", "external_push"} & set(list_walk_effects())


def test_robots_of_a_make_differ() -> None:
    plant = nominal(nao())
    first, again, other = (Individual(seed).apply(plant) for seed in (1, 1, 2))
    assert np.array_equal(first.servo.kp, again.servo.kp) and first.contact == again.contact
    assert not np.array_equal(first.servo.kp, other.servo.kp) and first.contact != other.contact


def test_walks_count_apart() -> None:
    walk = replace(label(), kind=WALK, strength="strong")
    marks = [
        mark_answer(walk, answer(cause())),
        mark_answer(walk, answer(verdict="unknown")),
        mark_answer(label(), answer(cause())),
    ]
    by_name = {figure.name: figure for figure in figures(marks) if figure.generator == SAME}
    top = by_name["walk, strong: top-1"]
    assert (top.value, top.count, top.threshold, top.met) == (0.5, 2, 0.75, False)
    assert by_name["walk, strong: abstains wrongly"].value == 0.5
    assert by_name["abstains wrongly"].count == by_name["wall time [s]"].count == 1
    assert confusion(marks) == {"armature": {"armature": 1}, "walk: armature": {"armature": 1, "unknown": 1}}
    assert [right(mark) for mark in marks] == [True, False, True]


def test_twins_in_the_air_are_apart_on_the_ground() -> None:
    truth = {"effects": {"sensor_bias": {"bias": 0.02}}, "neutral": {"sensor_bias": {"bias": 0.0}}}
    reply = answer(cause("zero_offset") | {"parameters": {"offset": {"value": 0.02, "low": 0.0, "high": 0.1}}})
    assert mark_answer(replace(label(**truth), kind=SINGLE), reply).first
    assert not mark_answer(replace(label(**truth), kind=WALK), reply).first
