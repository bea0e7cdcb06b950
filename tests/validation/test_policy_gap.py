"""What policies return in real, against what two simulators say of them; and what cannot be compared is refused."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from commands import done, refused
from scenarios import AIR, QUIET, REACH

from gsl.core.described import describe, restore
from gsl.core.seeds import derive_seed
from gsl.core.statistics import bootstrap_interval, rank_correlation
from gsl.effects.effect import names
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.rollout.parallel import Job, episodes
from gsl.rollout.rollout import Scenario
from gsl.storage import manifest
from gsl.storage.policies import write_policies
from gsl.storage.policy_choice import EVALUATION, policies, record
from gsl.tasks.arm import Arm
from gsl.validation.policy_gap import Effort, policy_gap
from gsl.validation.real_returns import MOST, list_parents, real_returns
from gsl.worlds.bullet import BulletWorld

pytestmark = pytest.mark.slow

TASK = Arm(duration=0.4)
WORN = {"servo_gain": {"kp": 0.4}}
HELD = ("world.floating=false", "world.settle=0.1")
NAMES = ("pi0", "generation_01")
LOW = ("episodes=2", "check=1", "confirmation=2", "workers=1")


def lifting(count: int) -> list[np.ndarray]:
    """Policies that lift the arms further and further."""
    return [REACH.initial - np.r_[np.zeros(8), [lift, lift]] for lift in np.linspace(0.1, 0.7, count)]


def evaluated(folder: Path, count: int, *overrides: str, run: str = "arm") -> Path:
    """An artifact of evaluate: some policies of the arm in a worn world."""
    chosen = [record(REACH, f"lift_{k}", theta) for k, theta in enumerate(lifting(count))]
    write_policies(folder / f"{run}.json", policies(REACH, TASK, chosen))
    worn = "world.effects.servo_gain.kp=0.4"
    more = (*HELD, worn, f"task.duration={TASK.duration}", *LOW, *overrides)
    done(
        "evaluate", f"policies={run}.json", f"name={run}", "world=nao_ideal", "task=arm", "policy=linear", *more,
        folder=folder,
    )  # fmt: skip
    return folder / "runs" / run / "evaluate"


@pytest.fixture(scope="module")
def arms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with runs/arm/evaluate, a log and nothing else; nobody may change anything in it for good."""
    folder = tmp_path_factory.mktemp("arms")
    evaluated(folder, 4)
    motions = ("policy.motions=[steps_large,triangle_slow]", "policy.duration=1.5", "policy.repeated=[steps_large]")
    done("collect", "task=excite", "name=log", "world=nao_ideal", *motions, "workers=1", folder=folder)
    return folder


def gap(folder: Path, after: BulletWorld, monkeypatch: pytest.MonkeyPatch, **settings: Any) -> Mapping[str, Any]:
    """The policy gap of the arm's simulator and another one."""
    monkeypatch.chdir(folder)
    effort = Effort(2, 1, 1)
    return policy_gap(
        real_returns("arm", AIR), AIR, after, console=QUIET, **{"named": True, "effort": effort} | settings
    )


def test_the_world_that_was_measured_predicts_its_returns(arms: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    comparison = gap(arms, replace(AIR, effects=WORN), monkeypatch)
    assert (comparison["policies"], comparison["measured"], comparison["episodes"]) == (4, 4, 2)
    assert comparison["gap"]["after"]["value"] < 0.1 * comparison["gap"]["before"]["value"]
    assert comparison["correlation"]["after"]["value"] == pytest.approx(1.0)
    assert [row["name"] for row in comparison["rows"]] == [f"lift_{k}" for k in range(4)]
    assert all(row["real"]["low"] <= row["real"]["value"] <= row["real"]["high"] for row in comparison["rows"])
    assert comparison["caveats"] == []


def test_both_simulators_play_the_same_seeds(arms: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    comparison = gap(arms, AIR, monkeypatch, named=False)
    assert all(row["sim"] == row["diagnosed"] for row in comparison["rows"])
    assert comparison["gap"]["before"] == comparison["gap"]["after"]
    assert comparison["simulator"] == "calibrated" and "names no cause" in comparison["caveats"][0]


def test_fresh_episodes_are_the_real_ones_where_there_are_any(arms: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(arms)
    table = json.loads((arms / "runs/arm/evaluate/evaluation.json").read_text())
    first, *_, last = real_returns("arm", AIR).policies
    assert list(first.values) == table["confirmation"][0]["values"]
    assert list(last.values) in [row["values"] for row in (*table["policies"], *table["confirmation"])]


def test_episodes_begin_as_the_real_ones_did(arms: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(arms)
    ground = BulletWorld(robot="nao", effects={}, settle=0.7)
    begun = real_returns("arm", ground).setup(ground)
    assert (begun.floating, begun.settle, begun.start_noise) == (False, 0.1, 0.02)
    other = replace(real_returns("arm", ground), world={"_target_": "lab.Robot", "robot": "nao"})
    assert other.setup(ground) == ground


def test_of_many_policies_some_are_taken_that_are_spread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluated(tmp_path, 15, "task.duration=0.1")
    monkeypatch.chdir(tmp_path)
    returns = real_returns("arm", AIR)
    assert (len(returns.policies), returns.total) == (MOST, 15)
    assert (returns.policies[0].name, returns.policies[-1].name) == ("lift_0", "lift_14")
    comparison = policy_gap(returns, AIR, AIR, named=True, effort=Effort(1, 1, 1), console=QUIET)
    assert comparison["caveats"][0] == "15 policies were measured; these 12 are spread over the list."
    assert comparison["rows"][0]["sim"]["low"] is None  # one episode has no interval


def test_two_policies_have_no_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluated(tmp_path, 2, "task.duration=0.1")
    comparison = gap(tmp_path, AIR, monkeypatch)
    assert comparison["correlation"] == {"before": None, "after": None} and comparison["gap"]["before"]["value"] >= 0.0
    assert "3 policies are the least for a rank correlation." in comparison["caveats"]


def test_an_iterate_stands_for_its_evaluations(arms: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = ("experiment=arm", "preset=toy", "grounding=none", "task.duration=0.4", "sim=nao_ideal", "workers=1")
    sizes += ("preset.arm_generations=1", "preset.confirmation=2", "recipe.real_neighbours=0")
    done("iterate", "name=whole", *sizes, folder=tmp_path)
    monkeypatch.chdir(tmp_path)
    assert [path.name for path in list_parents("whole").values()] == ["iterate", "evaluate", "optimize"]
    assert [policy.name for policy in real_returns("whole", AIR).policies] == list(NAMES)
    done("iterate", "name=twice", "iterations=2", *sizes, folder=tmp_path)
    policies = real_returns("twice", AIR).policies  # the second begins with what the first has returned
    first, second = ([f"iteration_0{k}/{name}" for name in names] for k, names in ((1, NAMES), (2, NAMES[1:])))
    assert [entry.name for entry in policies] == [*first, *second]


@pytest.mark.parametrize(("episodes", "stopped"), [(2, False), (1, True)])
def test_a_policy_that_fell_in_all_its_episodes_was_not_stopped(
    episodes: int, stopped: bool, arms: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(arms, tmp_path / "copy")
    monkeypatch.chdir(tmp_path / "copy")
    path = Path("runs/arm/evaluate") / EVALUATION
    table = json.loads(path.read_text())
    chosen = {row["name"] for row in table["confirmation"]}
    row = next(row for row in table["policies"] if row["name"] not in chosen)
    row |= {"falls": 1, "episodes": episodes, "values": row["values"][:episodes]}  # of 2
    path.write_text(json.dumps(table))
    assert {policy.name: policy.stopped for policy in real_returns("arm", AIR).policies}[row["name"]] == stopped


def test_a_policy_that_was_stopped_at_its_fall_is_told_apart(arms: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(arms)
    whole = real_returns("arm", AIR)
    fallen = whole.policies[1]._replace(values=np.array([0.3, 0.0]), falls=1, stopped=True)
    comparison = policy_gap(
        replace(whole, policies=(whole.policies[0], fallen, *whole.policies[2:])), AIR, replace(AIR, effects=WORN),
        named=True, effort=Effort(1, 1, 1), console=QUIET,
    )  # fmt: skip
    assert comparison["rows"][1]["real"] == {"value": 0.15, "low": None, "high": None, "falls": 1, "episodes": 2}
    assert comparison["never_stopped"]["policies"] == 3
    assert comparison["never_stopped"]["gap"]["after"]["value"] < comparison["gap"]["after"]["value"]
    assert comparison["caveats"][0].startswith("1 policy was stopped at the first fall on the real side")
    assert "rank correlations" in comparison["caveats"][0]


# --- the command


def test_the_diagnosis_tells_of_policies(arms: Path) -> None:
    without = ",".join(sorted({*names()} - {"servo_gain", "command_latency"}))
    quick = (
        f"without=[{without}]",
        "duels=0",
        "nulls=0",
        "most=1",
        "workers=1",
        "sim=nao_ideal",
        "episodes=2",
        "name=told",
    )
    said = done("diagnose", "real=log", "policies=arm", *quick, folder=arms)
    report = json.loads((arms / "runs/told/diagnose/report.json").read_text())
    assert report["policy_gap"]["policies"] == 4 and report["verdict"] == "no_gap"
    assert "4 policies: returns are " in said.out and "Rank correlation with real: " in said.out
    page = (arms / "runs/told/diagnose/report.html").read_text()
    assert "<h2>Policies</h2>" in page and "calibrated simulator" in page
    again = done("diagnose", "real=log", "policies=arm", *quick, "--json", folder=arms)
    assert json.loads(again.out)["unchanged"] and json.loads(again.out)["policy_gap"] == report["policy_gap"]
    world = yaml.safe_load((arms / "runs/told/diagnose/world/diagnosed.yaml").read_text())
    _played_as_written(report["policy_gap"], world)
    evaluated(arms, 4, "seed=2", run="other")
    line = refused("diagnose", "real=log", "policies=other", *quick, folder=arms)
    assert "runs/told/diagnose: was built otherwise (changed: the data of policies" in line


def _played_as_written(comparison: Mapping[str, Any], world: Mapping[str, Any]) -> None:
    """The second simulator is the one in the written file, held in the air as the real one was."""
    second = replace(restore(world), floating=False, settle=0.1, start_noise=0.02)
    scenario = Scenario(second, TASK, REACH, "real", NoGrounding())
    jobs = [Job(lifting(4)[0], derive_seed(1, "policy_gap", "lift_0", number)) for number in range(2)]
    values = [episode.value for episode in episodes(scenario, jobs, workers=1, progress=_Silent())]
    assert comparison["rows"][0]["diagnosed"]["value"] == pytest.approx(np.mean(values), rel=1e-12)


class _Silent:
    def fell(self, count: int) -> None:
        pass

    def advance(self, steps: int = 1, *, worked: bool = True) -> None:
        """Say nothing."""


@pytest.mark.parametrize(
    ("reference", "line"),
    [
        ("nothing", "nothing: there is no such path and no such run in runs"),
        ("log", "runs/log: holds collect, but evaluate is needed"),
        ("arm.json", "arm.json: holds no real returns; name an artifact of evaluate or iterate"),
    ],
)
def test_what_holds_no_real_returns_is_refused(reference: str, line: str, arms: Path) -> None:
    settings = ("real=log", f"policies={reference}", "out=runs/refused")
    assert refused("diagnose", *settings, folder=arms).startswith(line)


def rewritten(folder: Path, name: str, change: tuple[str, str]) -> None:
    """A copy of the evaluation whose settings say something else, and whose manifest knows."""
    shutil.copytree(folder / "runs/arm", folder / "runs" / name)
    place = folder / "runs" / name / "evaluate"
    config = place / "config.yaml"
    assert change[0] in config.read_text()
    config.write_text(config.read_text().replace(*change))
    manifest.write(place, replace(manifest.read(place), files=manifest.inventory(place)))


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (("robot: nao", "robot: pepper"), "its policies are of another robot: pepper, but sim= is the nao"),
        (("period: 0.02", "period: 0.01"), "its policies act every 0.01 s, but sim= every 0.02 s"),
        (
            ("gsl.tasks.arm.Arm", "gsl.tasks.walk.Walk"),
            "its policies are of another task: found for Arm, measured at W",
        ),
        (
            ("gsl.policies.linear.Linear", "lab.Linear"),
            "policies.policy._target_ = lab.Linear: is code that is not gsl's; say trust=lab if",
        ),
    ],
)
def test_policies_of_another_robot_or_task_are_refused(change: tuple[str, str], line: str, arms: Path) -> None:
    rewritten(arms, "foreign", change)
    try:
        assert line in refused("diagnose", "real=log", "policies=foreign", "out=runs/refused", folder=arms)
    finally:
        shutil.rmtree(arms / "runs/foreign")


def test_policies_that_have_changed_or_gone_since_are_refused(arms: Path) -> None:
    file = arms / "arm.json"
    whole = file.read_text()
    asked = ("diagnose", "real=log", "policies=arm", "out=runs/refused")
    try:
        file.write_text(whole.replace("lift_1", "lift_9"))
        assert "arm.json: has changed since runs/arm/evaluate measured its policies" in refused(*asked, folder=arms)
        file.unlink()
        assert "arm.json: is gone, but runs/arm/evaluate has measured its policies" in refused(*asked, folder=arms)
    finally:
        file.write_text(whole)


# --- what it stands on


def test_a_component_comes_back_from_its_description() -> None:
    for thing in (TASK, REACH, AIR):
        assert restore(describe(thing)) == thing
        assert restore(yaml.safe_load(yaml.safe_dump(describe(thing)))) == thing
    with pytest.raises(ConfigError, match=r"task\.duration = -1"):
        restore({"_target_": "gsl.tasks.arm.Arm", "duration": -1}, where="task")
    for name in ("os.system", "gsl.tasks.arm.math", "gsl.tasks.arm.Nothing", "gsl.tasks.arm.Mapping"):
        with pytest.raises(ConfigError, match="_target_"):
            restore({"_target_": name})


def test_a_bootstrap_interval_holds_its_statistic_and_leaves_out_what_is_none() -> None:
    values = np.array([1.0, 2.0, 3.0, 4.0])
    rng = np.random.default_rng(0)
    interval = bootstrap_interval(lambda chosen: float(values[chosen].mean()), 4, rng)
    assert interval.mean == 2.5 and 1.0 < interval.lower < 2.5 < interval.upper < 4.0
    order = bootstrap_interval(lambda chosen: rank_correlation(values[chosen], values[chosen]), 4, rng)
    assert order == pytest.approx((1.0, 1.0, 1.0))  # draws of one value four times over have no order
    assert np.isnan(rank_correlation(values, np.ones(4)))
