"""Every table and figure of the paper from one command each, at toy size; and how their figures are told."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from browser import check_seen
from commands import done, gsl

from gsl.commandline.composer import compose
from gsl.commandline.config import prepare, resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.core.console import Silent
from gsl.errors import ArtifactError
from gsl.grounding.gat import ActionTransformation
from gsl.models.config import ModelConfig
from gsl.optimizers.cma_es import CmaEs
from gsl.stages.effort import APART, LEARNED
from gsl.tasks.arm import Arm
from gsl.tasks.distance import Distance
from gsl.tasks.walk import Walk
from gsl.worlds.bullet import BulletWorld
from gsl_experiments.effort import duration_told, seconds_of_rounds
from gsl_experiments.ledger import Ledger, recipe
from gsl_experiments.paper_cells import one_by_one
from gsl_experiments.paper_table_2 import Table2
from gsl_experiments.paper_tables import Figure5, LinearWalkTable, Table3, Table4
from gsl_experiments.sizes import numbers, trials_of
from gsl_experiments.trial import Trial

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[2] / "examples"

KEPT = {  # what a study needs to run as itself; groundings have tests of their own
    "table2": ("none", "ane_02"),
    "table2-paper": ("none",),
    "table3": ("none",),
    "table4": ("sgat",),
    "linear-walk": ("none",),
    "worlds": ("none",),
    "motion": ("none",),
}
ALL = (
    *("none", "ane_005", "ane_01", "ane_02", "ane_04", "randomised", "gat", "gat_005", "gat_residual"),
    *("gat_residual_01", "gat_multi_step", "gat_gated", "sgat"),
    *("identified", "effects", "effects_gat", "effects_sgat"),
)
OFFERED = {
    "table2": ALL,
    "table2-paper": ("none", "ane_02", "gat", "gat_alpha_1", "sgat"),
    "table3": ("gat", "effects"),
    "table4": ("none", "ane_02", "gat", "sgat", "sgat_005"),
    "linear-walk": ("none", "ane_02", "gat", "gat_residual", "effects"),
    "fig5": ("none", "ane_02", "gat", "gat_005", "sgat", "effects"),
    "worlds": ("none", "ane_02", "gat_residual_01", "effects"),
    "motion": ("none", "ane_02", "gat", "gat_005", "gat_residual_01", "sgat"),
}
FEW = (
    "preset=toy", "iterate.workers=1", "iterate.optimizer.candidates=4", "iterate.optimizer.generations=1",
    "iterate.task.duration=1.2", "iterate.budget.rollouts=1", "iterate.budget.episodes=1", "iterate.budget.check=1",
    "iterate.budget.confirmation=2",
)  # fmt: skip


@pytest.mark.parametrize("what", KEPT)
def test_a_table_is_one_command(what: str, tmp_path: Path) -> None:
    left_out = [f"~methods.{name}" for name in OFFERED[what] if name not in KEPT[what]]
    left_out += ["~worlds.nao_weak"] if what == "table2" else []
    left_out += ["~worlds.nao_harsh", "~worlds.nao_drawn_b"] if what == "worlds" else []
    left_out += ["rank=false"] if what in ("worlds", "motion") else []  # table 2 ranks
    left_out += ["iterate.iterations=1", "+grounding@methods.none=none"] if what == "table3" else []
    left_out += ["recipe.forward=linear"] if what == "table4" else []  # no choice of a family
    left_out += ["iterate.aggregate=true", "iterate.budget.check=2"] if what == "table4" else []
    said = done("reproduce", what, *FEW, *left_out, folder=tmp_path)
    assert " for all of its results; a study that was stopped goes on where it was" in said.err
    folder = next((tmp_path / "runs").glob("*/reproduce"))
    trials = json.loads((folder / "trials.json").read_text())
    assert {trial["method"] for trial in trials} == set(KEPT[what])
    iterations = {"table4": 2, "linear-walk": 2}.get(what, 1)
    assert {trial["iteration"] for trial in trials} == set(range(1, iterations + 1))
    table = (folder / "table.md").read_text()
    assert all(f"| {name} " in table for name in KEPT[what]) and "Sizes: preset=toy, but" in table
    assert len((folder / "trials.md").read_text().splitlines()) == 2 + len(trials)
    assert {trial["simulator"] for trial in trials} == ({"nao_ideal", "nao_weak"} if what == "table3" else {""})
    assert all((trial["rank"] is not None) == (what == "table2") for trial in trials)
    for trial in trials:
        assert [policy[0] for policy in trial["tried"]] == list(range(trial["winners"] + 1))
        if what != "table4":  # where falls are tolerated
            assert sum(policy[3] == 0 for policy in trial["tried"][1:]) == trial["stable"]
        assert all((policy[2] is not None) == ("gat" in trial["method"]) for policy in trial["tried"])
    if what == "table2":
        check_seen(folder / "report.html", *KEPT[what], "Sizes: preset=toy")
    learned = {
        path.parent.parent.name: json.loads(path.read_text())["trajectories"]
        for path in folder.parent.rglob("sgat/*/**/train_forward/metrics.json")
    }
    if what == "table4":
        assert learned["iteration_02"] > learned["trial_01"]  # it knows what the first iteration has collected
        assert "likelihood: gaussian" in next(folder.parent.rglob("sgat/*/train_forward/config.yaml")).read_text()


def test_a_study_goes_on_from_trials_that_were_made_elsewhere(tmp_path: Path) -> None:
    left_out = ("~methods.gat", "~methods.gat_005", "~methods.sgat", "~methods.effects")
    few = (*FEW, *left_out)
    done("reproduce", "fig5", *few, folder=tmp_path)
    table = (tmp_path / "runs/fig5/reproduce/table.md").read_text()
    assert "| none " in table and "| ane_02 " in table and "Sizes: preset=toy, but" in table
    first = tmp_path / "runs/fig5/trials.json"
    rows = json.loads(first.read_text())
    assert [row["number"] for row in rows] == [1, 1]
    rows[0]["made_by"] = "a1b2c3d"
    del rows[0]["last_falls"]  # which files have not had from the beginning
    (tmp_path / "more.json").write_text(json.dumps(rows[1:]))
    (tmp_path / "elsewhere.json").write_text(json.dumps([rows[0], {**rows[0], "recipe": "of another study"}]))
    files = "known=[elsewhere.json,more.json]"
    said = done("reproduce", "fig5", *few, "trials=2", files, "name=on", folder=tmp_path)
    assert "1 of 3 known trials are of other settings" in said.err
    again = json.loads((tmp_path / "runs/on/reproduce/trials.json").read_text())
    assert again[:2] == rows and [row["number"] for row in again] == [1, 1, 2, 2]
    assert not list((tmp_path / "runs/on").rglob("trial_01"))
    table = (tmp_path / "runs/on/reproduce/table.md").read_text()
    assert f"Made by a1b2c3d: trial 1 ({rows[0]['method']}). Made by " in table
    assert f": trials 1 ({rows[1]['method']}), 2." in table
    assert len(json.loads((tmp_path / "runs/on/trials.json").read_text())) == 5  # nothing that was known is lost
    second = "first=2", "trials=1", "name=second", "known=runs/on/reproduce/trials.json"
    assert "2 of this study's 2 results are in" in done("reproduce", "fig5", *few, *second, folder=tmp_path).err
    assert json.loads((tmp_path / "runs/second/reproduce/trials.json").read_text()) == again[2:]
    one_method = "first=2", "trials=1", "name=alone", "~methods.ane_02"
    done("reproduce", "fig5", *few, *one_method, folder=tmp_path)  # run, and not known
    alone = json.loads((tmp_path / "runs/alone/reproduce/trials.json").read_text())
    assert [{**row, "made_by": ""} for row in alone] == [{**again[2], "made_by": ""}]
    assert " 1 trial (2). " in (tmp_path / "runs/second/reproduce/table.md").read_text()


def test_a_file_that_holds_no_trials_is_refused(tmp_path: Path) -> None:
    (tmp_path / "figures.json").write_text('[{"value": 1}]')
    said = gsl("reproduce", "fig5", *FEW, "known=figures.json", folder=tmp_path)
    assert said.code == 2 and "figures.json: row 1 is no result of such a study: " in said.lines[-1]


def test_a_trace_is_of_a_joint_that_the_models_know(tmp_path: Path) -> None:
    said = gsl("reproduce", "fig6", "preset=toy", "joint=RKneePitch", folder=tmp_path)
    assert said.code == 2 and "joint = RKneePitch: the models know no joint of this name" in said.lines[-1]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("fig6 grounding@iterate.grounding=none", "iterate.grounding: only a transformation of actions can be drawn"),
        ("fig6 duration=0.001", "duration = 0.001: is less than a tick, 0.02 s"),
        ("fig7 begin=50 iterate.task.duration=1.2", "begin = 50: π0's real walk is over after "),
        ("budget +grounding@methods.none=gat", "methods.none: is what all others are set against; take another name"),
        ("fig13 noises=[0.6,0.6]", "noises = [0.6,0.6]: are to rise, the least of them first"),
        ("fig11 noises=[0.5,0.5]", "noises = [0.5,0.5]: are to rise, the least of them first"),
        (
            "table2 methods.effects.diagnosis=mine",
            "methods.effects.diagnosis: is made here; gsl optimize takes one that is there",
        ),
        ("budget budgets=[2]", "budgets.0 = 2: must be at least 3"),
        (
            "budget world@iterate.sim=inverted_pendulum world@iterate.real=inverted_pendulum_noisy"
            " trial@iterate=gymnasium optimizer@iterate.optimizer=cma_es",
            "iterate.real: is no robot; replays begin in a robot's real states",
        ),
        ("fig11 noises=[0.5,2]", "noises.1 = 2: must be at most 1"),
        ("fig5 task@iterate.task=walk", "table = Figure5 of Walk: tells of Arm alone; choose another table="),
        ("budget known=[]", "known: is an empty list; leave it out"),
        ("budget first=0", "first = 0: must be at least 1"),
        ("budget iterate.iterations=2", "iterate.iterations = 2: this study is of the first"),
        ("budget grounding@methods.gat=effects_gat", "methods.gat: learns from real trajectories alone"),
        ("budget grounding@methods.gat=none", "methods.gat: learns from real trajectories alone"),
    ],
)
def test_what_cannot_be_drawn_is_refused_before_anything_is_made(arguments: str, line: str, tmp_path: Path) -> None:
    what, *more = arguments.split()
    said = gsl("reproduce", what, "preset=toy", *more, folder=tmp_path)
    assert said.code == 2 and said.lines[-1].startswith(f"gsl reproduce {what}: {line}")
    assert not list(tmp_path.iterdir())


class Listening(Silent):
    """A console that remembers what was said."""

    def __init__(self) -> None:
        self.said = list[str]()

    def status(self, text: str) -> None:
        self.said.append(text)


class Figure(NamedTuple):
    number: int
    value: float
    contradiction = ""


def test_a_ledger_only_grows(tmp_path: Path) -> None:
    path, earlier = tmp_path / "trials.json", tmp_path / "given.json"
    before = Ledger(path, {}, Figure, Silent())
    before.add("a", [{"number": 1, "value": 1.0}])
    before.add("b", [{"number": 2, "value": 2.0}])
    earlier.write_text(path.read_text().replace('"b"', '"c"'))
    after = Ledger(path, {"known": earlier}, Figure, Silent())
    assert not after.take("d")
    after.add("b", [{"number": 2, "value": 3.0}])
    assert {row["recipe"]: row["value"] for row in json.loads(path.read_text())} == {"b": 3.0, "a": 1.0, "c": 2.0}
    assert after.take("a") and after.figures == [{"number": 1, "value": 1.0}, {"number": 2, "value": 3.0}]
    with pytest.raises(ArtifactError, match="is what this study writes"):
        Ledger(path, {"known": path}, Figure, Silent())
    with pytest.raises(ArtifactError, match=r"say number 2 says 1; leave it out"):
        Ledger(tmp_path / "new.json", {"known": earlier}, Figure, Silent()).judge({"a": {"number": 2}})
    earlier.write_text(path.read_text().replace("3.0", '"fast"'))
    with pytest.raises(ArtifactError, match="row 1 has value 'fast': input should be a valid number"):
        Ledger(tmp_path / "new.json", {"known": earlier}, Figure, Silent())
    earlier.write_text(path.read_text().replace("3.0", "NaN"))
    with pytest.raises(ArtifactError, match="NaN is no figure"):
        Ledger(tmp_path / "new.json", {"known": earlier}, Figure, Silent())
    earlier.write_text(json.dumps([*json.loads(path.read_text()), json.loads(path.read_text())[0]]))
    with pytest.raises(ArtifactError, match="row 4 is of a trial that the file has already"):
        Ledger(tmp_path / "new.json", {"known": earlier}, Figure, Silent())


def test_a_growing_file_that_was_damaged_is_not_believed(tmp_path: Path) -> None:
    path, copy = tmp_path / "trials.json", tmp_path / "copy.json"
    ledger = Ledger(path, {}, Figure, Silent())
    ledger.add("a", [{"number": 1, "value": 1.0}])
    before = path.read_bytes()
    ledger.add("b", [{"number": 2, "value": 2.0}])
    path.write_bytes(before)  # a kill between hash and file leaves what was there
    Ledger(path, {}, Figure, Silent()).add("b", [{"number": 2, "value": 2.0}])
    copy.write_bytes(path.read_bytes().replace(b"2.0", b"3.0"))
    Ledger(tmp_path / "new.json", {"known": copy}, Figure, Silent())
    path.write_bytes(copy.read_bytes())
    with pytest.raises(ArtifactError, match="trials.json: is not as the study wrote it; take it away"):
        Ledger(path, {}, Figure, Silent())


def test_two_studies_may_write_one_ledger(tmp_path: Path) -> None:
    path = tmp_path / "trials.json"
    first, second = (Ledger(path, {}, Figure, Silent()) for _ in range(2))
    first.add("a", [{"number": 1, "value": 1.0}])
    second.add("b", [{"number": 2, "value": 2.0}])
    assert [row["recipe"] for row in json.loads(path.read_text())] == ["b", "a"]
    third = Ledger(path, {}, Figure, Silent())
    first.add("c", [{"number": 3, "value": 3.0}])
    assert third.take("a")
    assert {row["recipe"] for row in json.loads(path.read_text())} == {"a", "b", "c"}


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ({"stable": 6}, "stable 6, winners 5"),
        ({"improvement": 55.0}, "improvement 55.0, but start 0.2 and value 0.25"),
        ({"falls": 11}, "falls 11, episodes 10"),
        ({"number": -3}, "number -3"),
        ({"start": 0.0}, "improvement 25.0, but start 0.0 and value 0.25"),
    ],
)
def test_figures_that_contradict_each_other_are_no_trial(more: dict[str, Any], problem: str, tmp_path: Path) -> None:
    path, earlier = tmp_path / "trials.json", tmp_path / "given.json"
    row = {**a_trial("gat", 1)._asdict(), "recipe": "a", "made_by": "b"}
    earlier.write_text(json.dumps([row]))
    ledger = Ledger(path, {"known": earlier}, Trial, Silent())
    ledger.judge({"a": {"iteration": [1], "method": "gat"}})
    assert ledger.take("a")
    earlier.write_text(json.dumps([{**row, **more}]))
    with pytest.raises(ArtifactError, match=f"row 1 contradicts itself: {problem}"):
        Ledger(tmp_path / "new.json", {"known": earlier}, Trial, Silent())


def test_what_is_known_of_a_study_is_announced(tmp_path: Path) -> None:
    earlier, console = tmp_path / "given.json", Listening()
    earlier.write_text(json.dumps([{"number": 1, "value": 1.0, "recipe": "a", "made_by": "b"}]))
    path = tmp_path / "t.json"
    wanted = {"a": "none", "b": "gat", "c": "gat", "d": "sgat"}
    Ledger(path, {}, Figure, console).announce(wanted, lambda: 6000.0)
    ledger = Ledger(path, {"known": earlier}, Figure, console)
    ledger.announce(wanted, lambda: 6000.0)
    ledger.add("d", [{"number": 4, "value": 1.0}])
    Ledger(path, {"known": earlier}, Figure, console).announce(wanted, lambda: 6000.0)
    Ledger(path, {"known": earlier}, Figure, console).announce({"a": "none"}, lambda: 6000.0)
    goes_on = "; a study that was stopped goes on where it was"
    sentence = f"1 of this study's 4 results are in {earlier}"
    assert console.said == [
        f"about 1.7 hours for all of its results{goes_on}",
        *(sentence, f"about 75 minutes for 3 of 4 results, gat (2), sgat (1){goes_on}"),
        *(
            sentence,
            f"1 of this study's 4 results are in {path}",
            f"about 50 minutes for 2 of 4 results, gat (2){goes_on}",
        ),
        f"1 of this study's 1 results are in {earlier}",
    ]
    old = tmp_path / "old.json"
    old.write_text(earlier.read_text())
    Ledger(old, {}, Figure, console).announce({"a": "none"}, lambda: 6000.0)
    assert "1 of this study's 1 results in" in console.said[-2]
    assert "are of another version of gsl and not taken" in console.said[-2]
    other = tmp_path / "other.json"
    rows = [
        {"number": 1, "value": 1.0, "recipe": "a", "made_by": "c"},
        {"number": 9, "value": 9.0, "recipe": "b", "made_by": "c"},
    ]
    other.write_text(json.dumps(rows))
    both = Ledger(tmp_path / "both.json", {"known.0": earlier, "known.1": other, "known.2": earlier}, Figure, console)
    both.announce(wanted)
    assert console.said[-2:] == [sentence, sentence.replace("given", "other")]
    both.judge({"a": {"number": 1}, "b": {"number": 9}})
    assert both.take("a") and both.take("b")
    with pytest.raises(ArtifactError, match=r"other\.json: a trial whose settings .* say number 2 says 9; leave"):
        both.judge({"b": {"number": 2}})
    Ledger(path, {"known.0": earlier, "known.1": other}, Figure, console).announce(
        {"b": "gat"}
    )  # one of them is enough
    assert console.said[-1] == f"1 of this study's 1 results are in {other}"
    other.write_text(json.dumps([{**rows[0], "value": 2.0}]))
    with pytest.raises(ArtifactError, match=r"other\.json: tells a trial .* otherwise than .*given\.json; leave"):
        Ledger(path, {"known.0": earlier, "known.1": other}, Figure, console)
    with pytest.raises(ArtifactError, match="holds no result of this study: its trials have other settings, seeds"):
        Ledger(path, {"known": earlier}, Figure, console).announce({"b": "gat"})


def test_a_recipe_is_of_what_a_trial_comes_from(tmp_path: Path) -> None:
    text = (EXAMPLES / "arm.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(text)
    world = BulletWorld(str(tmp_path / "arm.urdf"), {}, floating=False)
    gat = ActionTransformation("one/train_forward", "one/train_inverse")
    first = recipe(world, gat, 1)
    assert first == recipe(world, ActionTransformation("two/train_forward", "two/train_inverse"), 1)
    assert first != recipe(world, gat, 2) and first != recipe(replace(world, step=0.001), gat, 1)
    search = CmaEs(candidates=4, generations=2)
    assert recipe(search, world) != recipe(replace(search, sigma=0.1), world)
    idle = {"workers": 2, "preset_name": "quick", "first": 1, "diagnosis": "one", "servo": "one/train_servo"}
    assert recipe({"_target_": "Stage", **idle}) == recipe({"_target_": "Stage"})
    assert all(recipe({"kwargs": {name: value}}) != recipe({"kwargs": {}}) for name, value in idle.items())
    assert recipe(ModelConfig()) != recipe(ModelConfig(covariance="full"))
    (tmp_path / "arm.urdf").write_text(text.replace('<mass value="', '<mass value="1'))
    assert recipe(world, gat, 1) != first


@pytest.mark.parametrize(
    ("what", "figures"), [("fig6", ["figure_6.png"]), ("fig7", ["figure_7a.png", "figure_7b.png"])]
)
def test_a_figure_is_one_command(what: str, figures: list[str], tmp_path: Path) -> None:
    said = done("reproduce", what, "preset=toy", "iterate.workers=1", folder=tmp_path)
    folder = tmp_path / "runs" / what / "reproduce"
    assert sorted(path.name for path in folder.glob("*.png")) == figures
    assert "RMS distance from real" in said.out and "from nothing" in said.err
    assert "Sizes: preset=toy, but" in (folder / "table.md").read_text()


def test_replays_without_a_search_are_one_command(tmp_path: Path) -> None:
    left_out = ("gat_x_auto", "gat_residual", "gat_multi_step", "gat_gated", "effects", "effects_gat", "effects_servo")
    few = ("preset=toy", "iterate.workers=1", "iterate.task.duration=1.2", *(f"~methods.{name}" for name in left_out))
    few += ("preset.evaluations=160", "recipe.forward=linear")
    gains = f"gains={Path(__file__).parents[2] / 'experiments/trials/table2/trials.json'}"
    said = done("reproduce", "replays", *few, "~worlds.nao_weak", gains, folder=tmp_path)
    assert "about 1 minute for all of its results" in said.err
    folder = tmp_path / "runs/replays/reproduce"
    rows = {row["method"]: row for row in json.loads((folder / "replays.json").read_text())}
    assert set(rows) == {"none", "gat", "identified", "servo"} and not list(tmp_path.rglob("optimize"))
    assert rows["identified"]["joints"] < rows["none"]["joints"] != rows["gat"]["joints"]
    assert rows["servo"]["joints"] < rows["none"]["joints"] and 0.8 < rows["servo"]["stiffness"]["legs"] < 1.2
    assert rows["none"]["stiffness"] == rows["none"]["strength"] == {"legs": 0.0, "arms": 0.0}
    assert rows["none"]["unreached"] is None and 0.0 <= rows["gat"]["unreached"] < 1.0
    table = (folder / "table.md").read_text()
    assert all(f"| nao_worn | {name} | {row['joints']:.2f} |" in table for name, row in rows.items())
    assert (folder / "replays.png").stat().st_size > 10_000
    assert "3 points (nao_worn: none, gat, identified)" in table
    assert "| minus none (95 %, paired) |" in table and "effects and servos from motions in the air" in table
    replays, again = folder / "replays.json", ("~worlds.nao_weak", "force=true")
    (tmp_path / "known.json").write_text(replays.read_text())
    for more in (again, (*again, "name=known", "known=known.json")):  # of this version, and of any
        said = done("reproduce", "replays", *few, *more, folder=tmp_path)
        assert "grounded simulator against" not in said.err
        assert (tmp_path / "runs/known" if "name=known" in more else folder.parent).is_dir()
    assert json.loads((tmp_path / "runs/known/reproduce/replays.json").read_text()) == json.loads(replays.read_text())
    assert not (tmp_path / "runs/known/nao_worn").exists()
    for more, line in (
        (["+grounding@methods.ane=ane"], "methods.ane: is drawn anew each time; replays are of what is expected"),
        (["iterate.pretrained=true"], "iterate.pretrained = true: this study begins with π0 as it is"),
        (["iterate.task.duration=0.3"], "none of 12 real trajectories off π0 has the 16 ticks of a replay"),
    ):
        said = gsl("reproduce", "replays", *few, *more, "name=n", folder=tmp_path)
        assert said.code == 2 - ("trajectories" in line) and line in said.lines[-1]


def test_the_curve_over_budgets_is_one_command(tmp_path: Path) -> None:
    few = (*FEW, "recipe.forward=linear", "iterate.task.duration=0.8", "iterate.budget.sim_episodes=2")
    with open_hydra(None):
        study = prepare(resolve(compose("reproduce_budget", ["preset=toy", "budgets=[4,6]"])))[0]
    cells = [("none", 0), ("gat", 4), ("sgat", 4), ("gat", 6), ("sgat", 6)]
    assert [*study.recipes] == [(1, *cell) for cell in cells]
    said = done("reproduce", "budget", *few, "budgets=[4]", folder=tmp_path)
    assert "for all of its results" in said.err
    assert "gat, 4 trajectories, trial 1: grounded simulator against" in said.err
    folder = tmp_path / "runs/budget/reproduce"
    first = json.loads((folder / "points.json").read_text())
    assert [(point["method"], point["trajectories"]) for point in first] == cells[:3]
    said = done("reproduce", "budget", *few, "budgets=[4,6]", "~methods.sgat", "force=true", folder=tmp_path)
    assert "gat, 4 trajectories" not in said.err  # it is there
    points = json.loads((folder / "points.json").read_text())
    assert [(point["method"], point["trajectories"]) for point in points] == [*cells[:2], cells[3]]
    assert all(point["error"] > 0.0 < point["bare"] for point in (*points[1:], first[2]))
    assert points[1]["error"] != points[2]["error"]
    assert len(list((tmp_path / "runs/budget").rglob("collect_real"))) == 2  # what the methods share
    refused = gsl("reproduce", "budget", *few, "budgets=[6,6]", "name=n", folder=tmp_path)
    assert refused.lines == ["gsl reproduce budget: budgets = [6,6]: are to rise, the least of them first"]
    assert points[2]["bare"] == first[2]["bare"]  # measured on the same trajectories
    assert (folder / "budget.png").stat().st_size > 10_000
    assert " otherwise. 1 trial. Made by " in (folder / "table.md").read_text()
    (tmp_path / "half.json").write_text((folder / "points.json").read_text())
    part = "budgets=[6]", "~methods.sgat", "name=part", "known=half.json"  # a budget is asked for by itself
    assert "2 of this study's 2 results are in" in done("reproduce", "budget", *few, *part, folder=tmp_path).err
    assert "grounded simulator against" not in said.out and "real trajectories collected" in said.out


@pytest.mark.parametrize(("study", "names"), [("budget", ("gat", "sgat")), ("fig5", OFFERED["fig5"])])
def test_a_study_of_nothing_is_refused(study: str, names: tuple[str, ...], tmp_path: Path) -> None:
    refused = gsl("reproduce", study, "preset=toy", *(f"~methods.{name}" for name in names), folder=tmp_path)
    assert refused.lines == [f"gsl reproduce {study}: methods = {{}}: needs 1 at least"]
    misspelt = gsl("reproduce", study, "preset=toy", "~methods.gatt", folder=tmp_path)
    assert "did you mean" in misspelt.lines[0] and misspelt.code == 2


def a_trial(method: str, number: int, **more: Any) -> Trial:
    fields: dict[str, Any] = {
        "simulator": "",
        "world": "w",
        "iteration": 1,
        "start": 0.2,
        "value": 0.25,
        "improvement": 25.0,
        "surely": 0.01,
        "returned": "generation_02",
        "generation": 2,
        "falls": 0,
        "episodes": 10,
        "stable": 4,
        "improving": 3,
        "winners": 5,
        "alpha": None,
        "refused": False,
        "rank": 0.5,
        "real_episodes": 40,
        "outcome": {},
        "last": {"distance [deg]": 0.5, "mean distance [deg]": 2.0, "above [share]": 0.0},
    }
    return Trial(**{**fields, "method": method, "number": number, **more})


def test_table_2_marks_the_noise_that_only_real_figures_choose() -> None:
    trials = [
        a_trial(method, k, improvement=gain)
        for method, gain in (("none", 1.0), ("ane_01", 9.0), ("ane_02", 5.0))
        for k in (1, 2)
    ]
    text = Table2().markdown(trials, Walk())
    assert "| ane_01 (oracle: best by real) |" in text and "| ane_02 (chosen beforehand) |" in text
    assert "oracle" not in Table2().markdown([trial for trial in trials if trial.method != "ane_01"], Walk())
    best = Table2(width="ane_01").markdown(trials, Walk())
    assert "| ane_01 (chosen beforehand; oracle: best by real) |" in best and "| ane_02 |" in best
    assert "| 18.9 | 5 of 10 | 6.6 |" in next(line for line in text.splitlines() if line.startswith("| w | ane_02"))
    assert "| w | ane_02 | +4.0 (4.0 to 4.0) |  |" in text and "| w | none |  | -4.0 (-4.0 to -4.0) |" in text
    assert "| w | ane_01 - none |" not in text  # their order is not what is tested
    assert "| w | gat - none |" in Table2().markdown([*trials, a_trial("gat", 1), a_trial("gat", 2)], Walk())


@pytest.mark.parametrize("table", [Table2(), Table3(), Table4(), LinearWalkTable(), Figure5()])
def test_rows_say_where_trials_were(table: Any) -> None:
    trials = [
        a_trial("gat", k, world=world, iteration=iteration, outcome={"mean distance [deg]": 7.0})
        for k in (1, 2)
        for world in ("v", "w")
        for iteration in (1, 2)
    ]
    lines = table.markdown(trials, Walk()).split("\n\n")[0].splitlines()[2:6]
    cells = {tuple(cell for cell in line.split(" | ")[:3] if cell in ("| v", "| w", "1", "2")) for line in lines}
    assert cells == {("| v", "1"), ("| v", "2"), ("| w", "1"), ("| w", "2")}
    if isinstance(table, Table3 | LinearWalkTable):
        return
    paper = [any(value in line for value in ("22.5", "15.7 ± 3.0")) for line in lines]
    assert isinstance(table, Figure5) or paper == [True, False, True, False]  # which has figures of the first


@pytest.mark.parametrize("table", [Table2(), Table4(), LinearWalkTable()])
def test_differences_say_in_which_simulator(table: Any) -> None:
    trials = [
        a_trial(method, k, simulator=simulator, stable=stable)
        for k in (1, 2)
        for simulator, more in (("a", 0), ("b", 4))
        for method, stable in (("none", 0), ("gat", more))
    ]
    text = table.markdown(trials, Walk())
    for simulator, more in (("a", "+0.0 | 1.000"), ("b", "+4.0 | 0.500")):
        row = next(line for line in text.splitlines() if line.startswith(f"| {simulator} | w | gat - none |"))
        assert not isinstance(table, Table2) or more in row


def test_one_method_is_set_against_no_other() -> None:
    table = LinearWalkTable().markdown([a_trial("gat", 1), a_trial("gat", 2)], Distance())
    assert "| w | gat | 1 |" in table and "difference" not in table


@pytest.mark.parametrize(
    ("first", "count", "words"), [(1, 10, "10 trials"), (11, 10, "10 trials (11 to 20)"), (3, 1, "1 trial (3)")]
)
def test_a_table_says_which_trials_it_has(first: int, count: int, words: str) -> None:
    assert trials_of(first, count) == words and len(numbers(first, count)) == count


def test_everything_of_a_single_trial_is_told() -> None:
    nothing = a_trial("gat", 3, start=-1e-5, improvement=321020.4)
    trials = [a_trial("gat", 1, alpha=0.9, falls=2), a_trial("none", 2, improvement=None, rank=None, generation=0)]
    titles, _, first, second, third = one_by_one([*trials, nothing], Walk()).splitlines()
    row = dict(zip(titles.split(" | "), first.split(" | "), strict=True))
    assert (row["trial"], row["improvement [%]"], row["stable winners"], row["improving winners"]) == (
        *("1", "25.0", "4 of 5", "3"),
    )
    assert (row["falls"], row["rank"], row["alpha"], row["best generation"]) == ("2 of 10", "0.50", "0.9", "2")
    assert "| 20.0 | 25.0 |  | 1.0 |  | 4 of 5 |" in second
    assert "| gat | 3 | 0.0 | 25.0 |  | 1.0 | 2 |" in third  # a share of next to nothing tells nothing


def test_table_2_counts_how_often_the_last_generation_improves() -> None:
    trials = [
        a_trial("gat", k, last={"speed [cm/s]": speed}, last_falls=falls)
        for k, speed, falls in ((1, 19.9, 0), (2, 20.1, 0), (3, 30.0, 0), (4, 30.0, 1))
    ]
    row = next(line for line in Table2().markdown(trials, Walk()).splitlines() if line.startswith("| w | gat"))
    assert "| 16 of 20 | 12 of 20 | 2 of 4 |" in row  # π0 walks 20 cm/s
    before = Table2().markdown([trials[0]._replace(last_falls=None)], Walk())
    assert "| 4 of 5 | 3 of 5 |  |" in before  # a trial of a file that does not tell


def test_table_2_counts_failures_as_the_paper_does_and_more_strictly() -> None:
    trials = [a_trial("gat", 1), a_trial("gat", 2, falls=1), a_trial("gat", 3, improving=0, surely=0.0)]
    row = next(line for line in Table2().markdown(trials, Walk()).splitlines() if line.startswith("| w | gat"))
    assert "| 2 of 3 | 1 of 3 | 2.0 |" in row


def test_table_3_counts_where_chains_stop() -> None:
    trials = [
        a_trial("gat", k, simulator="s", iteration=i, surely=gained, value=value)
        for k in (1, 2)
        for i, gained, value in ((1, 0.01, 0.25), (2, 0.01, 0.3), (3, -0.01, 0.26))
    ]
    text = Table3().markdown(trials, Walk())
    rows = [line for line in text.splitlines() if line.startswith("| w | gat")]
    assert ["2 of 2" in row for row in rows[:3]] == [False, False, True]
    assert "43.3" in rows[1]
    assert "| 0 of 2 | 2 of 2 | 30.0 |" in rows[2]
    assert "| 30.0 |" in rows[1] and "| 26.0 |" in rows[2] and "| 2 of 2 | 30.0 |" in rows[2]


@pytest.mark.parametrize("table", [Table2(), Table3(), Table4(), LinearWalkTable(), Figure5()])
def test_one_trial_tells_no_interval(table: Any) -> None:
    text = table.markdown(
        [a_trial(method, 1, outcome={"mean distance [deg]": 7.0}) for method in ("none", "gat")], Walk()
    )
    assert "| - |" in text and "inf" not in text and "nan to" not in text


def test_table_4_counts_falls_over_episodes() -> None:
    first = [a_trial(method, k, value=0.2) for method in ("none", "gat") for k in (1, 2)]
    trials = [*first, *(a_trial("sgat", k, falls=k, outcome={"speed [cm/s]": 20.0 + k}) for k in (1, 2))]
    lines = Table4().markdown(trials, Walk()).splitlines()
    row = next(line for line in lines if line.startswith("| w | sgat"))
    assert "| 21.5 | 3 of 20 | 0 to 79 |" in row and "0 of 10" in row  # shares .1 and .2: over trials, not over walks
    for other in ("none", "gat"):
        assert f"| w | sgat - {other} | 1 | 5.0 | 5.0 to 5.0 | +1.5 | -4.9 to +7.9 |" in lines
    assert "| w | none | 1 | 20.0 | 20.0 to 20.0 | nan | 0 of 20 | 0 to 16 |" in "\n".join(lines)


def test_the_linear_walk_has_distances_where_percentages_mean_nothing() -> None:
    trials = [a_trial("gat", k, start=0.0, value=0.05, improvement=None, surely=0.01 * (k - 1)) for k in (1, 2)]
    trials += [a_trial("none", k, start=0.0, value=0.02, improvement=None, surely=0.0) for k in (1, 2)]
    row = next(line for line in LinearWalkTable().markdown(trials, Distance()).splitlines() if "gat" in line)
    assert "| 5.0 |" in row and "| 1 of 2 |" in row and "4.95" in row


def test_figure_5_is_told_in_degrees() -> None:
    def trial(method: str, k: int, on_average: float, above: float) -> Trial:
        last = {"distance [deg]": 0.5, "above [share]": above, "mean distance [deg]": on_average}
        return a_trial(method, k, last=last, outcome={"mean distance [deg]": 7.0})

    trials = [
        trial("none", 1, 10.0, 1.0),
        trial("gat", 1, 2.0, 0.0),
        trial("none", 2, 11.0, 1.0),
        trial("gat", 2, 4.0, 0.0),
    ]
    lines = Figure5().markdown(trials, Arm()).splitlines()
    assert "| gat | 3.0 | -9.7 to 15.7 | -7.5 (-13.9 to -1.1) | 0.5 | 0.5 to 0.5 | 0 of 2 | 7.0 |" in lines[-1]
    assert "| none | 10.5 | 4.1 to 16.9 |  | 0.5 | 0.5 to 0.5 | 2 of 2 |" in lines[-2]


def test_a_study_in_noisy_worlds_knows_beforehand_how_long_it_takes() -> None:
    """By hand, where every rollout takes a second."""
    searches = ("optimizer@iterate.optimizer=cma_es", "optimizer@further=cma_es")
    sizes = [
        f"{where}.{size}" for where in ("iterate.optimizer", "further") for size in ("candidates=5", "generations=3")
    ]
    budget = ("rollouts=2", "episodes=7", "check=2", "confirmation=4", "real_episodes=10", "sim_episodes=20")
    few = ("noises=[0.2,0.5]", "trials=3", "workers=1", *(f"iterate.budget.{size}" for size in budget))
    with open_hydra(None):
        study = prepare(resolve(compose("reproduce_fig12", ["preset=toy", *searches, *sizes, *few])))[0]
    assert [*study.methods] == ["none", "ane_02", "ane_04", "ane_06", "gat", "sgat"] and len(study.worlds) == 1
    search, measurement = 5 * 3 * 2, 7 + 2 + 2 * 4
    once = 1 + 4  # where all begin, and what knows no world
    at_each_noise = (1 + 2 * LEARNED) * search + 7 * measurement + 30 + 2 * APART  # the reference, gat and sgat
    assert seconds_of_rounds(study, lambda *_: 1.0) == pytest.approx(3 * (once * search + 2 * at_each_noise))
    assert seconds_of_rounds(replace(study, workers=2), lambda *_: 1.0) == pytest.approx(
        1.5 * (once * search + 2 * at_each_noise)
    )


@pytest.mark.parametrize(
    ("seconds", "text"), [(20.0, "about 1 minute"), (600.0, "about 10 minutes"), (36000.0, "about 10.0 hours")]
)
def test_durations_are_told_as_people_do(seconds: float, text: str) -> None:
    assert duration_told(seconds) == text
