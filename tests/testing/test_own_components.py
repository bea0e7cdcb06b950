"""A grounding with a model and an optimiser of a user's own: one file and one yaml each, in his folder."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import SMALL, done, gsl, refused

from gsl.core.checkpoint import read_checkpoint
from gsl.grounding.preparation import KIND, MODEL
from gsl.robots.nao import nao
from gsl.testing import check_grounding, check_search, check_task

pytestmark = pytest.mark.slow

GROUNDING = '''
"""Actions move as much less far in the simulator as the real joints move less fast."""
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.interfaces import Trainable
from gsl.core.setting import component, setting


@component
class Shrink(Trainable):
    """Learns the ratio of mean speeds, joint by joint."""

    needs: ClassVar[tuple[str, ...]] = ("real", "sim")
    model: Annotated[str, setting("path or run of train-grounding")] = ""
    most: Annotated[float, setting("of the ratio", gt=0)] = 1.0

    def learn(self, evidence, seed):
        real, sim = (np.concatenate([np.abs(one.velocity) for one in part.episodes]).mean(axis=0) + 1e-6
                     for part in (evidence.real, evidence.sim))
        return {"ratio": np.minimum(self.most, real / sim)}

    def load(self, arrays):
        return Shrunk(arrays["ratio"])


class Shrunk:
    def __init__(self, ratio):
        self.ratio = ratio

    def start(self, layout, rng):
        self.place = layout["position"]
        return self

    def transform(self, observation, action):
        here = observation[self.place]
        return here + self.ratio * (action - here)
'''

OPTIMISER = '''
"""Random search around the best so far."""
from typing import Annotated

import numpy as np

from gsl.core.setting import component, setting


@component
class RandomSearch:
    """Draws candidates around the best one that it has seen."""

    candidates: Annotated[int, setting("of a generation", ge=1)] = 3
    generations: Annotated[int, setting("generations", ge=1)] = 2
    spread: Annotated[float, setting("in units of a parameter's scale", gt=0)] = 0.05

    def start(self, parameters, scale, seed):
        return Run(self, np.asarray(parameters), scale, np.random.default_rng(seed))


class Run:
    def __init__(self, settings, best, scale, rng):
        self.settings, self.best, self.scale, self.rng, self.value = settings, best, scale, rng, -np.inf

    def ask(self):
        count, size = self.settings.candidates, len(self.best)
        steps = self.settings.spread * self.scale * self.rng.standard_normal((count, size))
        self.asked = [self.best + step for step in steps]
        return self.asked

    def tell(self, values):
        if max(values) > self.value:
            self.value, self.best = max(values), self.asked[int(np.argmax(values))]
'''


PLAIN = '''
"""All joints go too far."""
from gsl.core.setting import component


@component
class TooFar:
    def start(self, layout, rng):
        return self

    def transform(self, observation, action):
        return action + 0.7
'''

TASK = '''
"""A walk that is worth its distance in feet."""
from typing import ClassVar

from gsl.core.setting import component
from gsl.tasks.walk import Walk


@component
class Feet(Walk):
    unit: ClassVar[str] = "ft/s"
    shown: ClassVar[float] = 3.28
'''


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's folder: two modules, and a yaml file of each."""
    folder: Path = tmp_path_factory.mktemp("own")
    (folder / "own_grounding.py").write_text(GROUNDING)
    (folder / "own_optimiser.py").write_text(OPTIMISER)
    (folder / "own_task.py").write_text(TASK)
    (folder / "own_plain.py").write_text(PLAIN)
    for group, text in {
        "grounding/shrink": "_target_: own_grounding.Shrink\nmodel: ''\nmost: 1.0\n",
        "grounding/plain": "_target_: own_plain.TooFar\n",
        "task/feet": "_target_: own_task.Feet\nduration: 1.6\nfall_cost: 0.15\n",
        "optimizer/random_search": "_target_: own_optimiser.RandomSearch\ncandidates: 3\ngenerations: 2\n",
    }.items():
        path = folder / f"mine/{group}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


@pytest.fixture(autouse=True)
def importable(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(home))
    monkeypatch.setenv("GSL_TRUST", ",".join(TRUSTED))


OWN = ("--config-dir", "mine")
FEW = ("recipe.sim_episodes=3", "recipe.sim_neighbours=1", "budget.rollouts=1", "budget.check=1", "budget.episodes=1")
TRUSTED = (
    *("own_grounding", "own_optimiser", "own_task", "own_plain", "own_sim", "own_edited", "own_fault"),
    *(f"own_{kind}_{number}" for kind in ("lacking", "bad", "wrong") for number in range(9)),
)


@pytest.fixture(scope="module")
def iterated(home: Path) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(home))
        done("iterate", *OWN, *SMALL, *FEW, "grounding=shrink", "optimizer=random_search", "accept=true",
             "trust=[own_grounding,own_optimiser]", "name=own", folder=home)  # fmt: skip
    return home / "runs/own"


def test_both_keep_the_contracts(home: Path) -> None:
    check_grounding(importlib.import_module("own_grounding").Shrink())
    check_search(importlib.import_module("own_optimiser").RandomSearch())
    check_grounding(importlib.import_module("own_plain").TooFar())
    check_task(importlib.import_module("own_task").Feet(duration=0.5))


def test_an_iteration_trains_checks_and_searches_with_both(iterated: Path) -> None:
    first = iterated / "iteration_01"
    for stage in ("iterate", "iteration_01/optimize"):
        recorded = json.loads((iterated / stage / "manifest.json").read_text())["trust"]
        assert sorted(recorded) == ["own_grounding", "own_optimiser"]
    arrays, about = read_checkpoint(first / "train_grounding" / MODEL, kind=KIND)
    assert about["class"] == "own_grounding.Shrink"
    assert arrays["ratio"].max() <= 1.0
    report = json.loads((first / "optimize/grounding.json").read_text())
    assert set(report["errors"]["pi0"]) == {"grounded", "ungrounded", "no_change"}
    generations = [json.loads(line) for line in (first / "optimize/generations.jsonl").read_text().splitlines()]
    assert [len(generation["values"]) for generation in generations] == [3, 3]


def test_what_is_held_out_is_not_learned_from(iterated: Path) -> None:
    metrics = json.loads((iterated / "iteration_01/train_grounding/metrics.json").read_text())
    collected = json.loads((iterated / "iteration_01/collect_real/metrics.json").read_text())
    assert 0 < metrics["trajectories"] < collected["episodes"]
    assert metrics["arrays"] == {"ratio": [len(nao().controlled)]}


def test_the_same_by_hand(iterated: Path, home: Path) -> None:
    """What `iterate` does, stage by stage: the same model comes out."""
    data = ("real=runs/own/iteration_01/collect_real", "sim=runs/own/iteration_01/collect_sim")
    done("train-grounding", *OWN, "grounding=shrink", *data, "name=hand", folder=home)
    here, there = (
        read_checkpoint(home / f"runs/{place}/train_grounding" / MODEL, kind=KIND)[0]
        for place in ("hand", "own/iteration_01")
    )
    np.testing.assert_array_equal(here["ratio"], there["ratio"])
    chosen = ("grounding=shrink", "grounding.model=hand", "optimizer=random_search", "accept=true", "name=hand")
    chosen += ("optimizer.generations=1", "optimizer.candidates=2")
    done("optimize", *OWN, *SMALL, *chosen, folder=home)


def test_both_appear_in_compare(iterated: Path, home: Path) -> None:
    methods = [f"~methods.{name}" for name in ("none", "ane_01", "ane_02", "gat", "gat_005", "effects", "effects_gat")]
    own = ("+grounding@methods.shrink=shrink", "optimizer@iterate.optimizer=random_search", "trials=1")
    own += ("iterate.optimizer.generations=1", *(f"iterate.{setting}" for setting in FEW[2:]))
    done("compare", *OWN, *SMALL[:1], "iterate.task.duration=0.6", "iterate.workers=1", *methods, "~worlds.nao_weak",
         *own, "name=set", folder=home)  # fmt: skip
    assert "| shrink |" in (home / "runs/set/compare/table.md").read_text()


def test_what_is_missing_is_said_in_one_line(home: Path) -> None:
    said = refused("optimize", *OWN, "grounding=shrink", "name=refused", folder=home)
    assert said == "grounding.model: is missing; name a run of gsl train-grounding"
    said = refused("train-grounding", *OWN, "grounding=shrink", "name=refused", folder=home)
    assert said == "real: is missing; the grounding learns from real trajectories: a run of gsl collect"
    said = refused("optimize", *OWN, "grounding=shrink", "grounding.most=-1", "name=refused", folder=home)
    assert "grounding.most" in said


def test_a_task_of_ones_own_is_shown_in_its_unit(home: Path) -> None:
    said = done("collect", *OWN, "task=feet", "preset=toy", "workers=1", "name=feet", "world=nao_ideal", folder=home)
    assert "[ft/s]" in said.out
    assert " ft/s" in done("runs", folder=home).out


def test_a_grounding_that_nothing_is_known_of_is_checked_by_falls(home: Path) -> None:
    said = gsl("optimize", *OWN, *SMALL, "task.duration=4", "grounding=plain", "name=plain", folder=home)
    assert "TooFar is no grounding of gsl's: only the falls of π0 in it are checked" in said.err
    assert said.code == 1
    assert "π0 falls in 4 of 4 episodes of the grounded simulator. Let TooFar change less" in said.lines[-1]


SIM_ALONE = """
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.interfaces import Trainable
from gsl.core.setting import component, setting
from gsl.grounding.ane import ActionNoise


@component
class FromSim(Trainable):
    needs: ClassVar[tuple[str, ...]] = ("sim",)
    model: Annotated[str, setting("path or run of train-grounding")] = ""

    def learn(self, evidence, seed):
        assert evidence.real is None
        return {"sd": np.array(1e-4 * len(evidence.sim))}

    def load(self, arrays):
        return ActionNoise(sd=float(arrays["sd"]))
"""


def test_what_learns_from_the_simulator_alone_costs_no_real_data(home: Path) -> None:
    (home / "own_sim.py").write_text(SIM_ALONE)
    (home / "mine/grounding/sim_alone.yaml").write_text("_target_: own_sim.FromSim\nmodel: ''\n")
    search = ("optimizer=random_search", "optimizer.generations=1", "optimizer.candidates=2")
    done("iterate", *OWN, *SMALL, *FEW, "grounding=sim_alone", *search, "name=alone", folder=home)
    metrics = json.loads((home / "runs/alone/iterate/metrics.json").read_text())
    assert metrics["learned_from"] == 0
    assert not (home / "runs/alone/iteration_01/collect_real").exists()


def test_a_model_that_a_chain_makes_itself_is_not_given(home: Path) -> None:
    said = refused("iterate", *OWN, "grounding=shrink", "grounding.model=hand", "name=refused", folder=home)
    assert said == "grounding.model: is made here; gsl optimize takes one that is there"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("", "grounding = Lacking: has no setting `model`; add "),
        ("    model: str = ''\n", "grounding = Lacking: has no method `learn`"),
        (
            "    model: str = ''\n    needs = ('air',)\n    learn = load = lambda self, *_: {}\n",
            "grounding = air: its `needs`",
        ),
    ],
)
def test_a_class_that_lacks_something_is_refused_before_anything_is_collected(
    body: str, said: str, home: Path, request: pytest.FixtureRequest
) -> None:
    number = request.node.callspec.indices["body"]
    head = "from gsl.core.interfaces import Trainable\nfrom gsl.core.setting import component\n\n@component\n"
    (home / f"own_lacking_{number}.py").write_text(f"{head}class Lacking(Trainable):\n    ...\n{body}")
    (home / f"mine/grounding/lacking_{number}.yaml").write_text(f"_target_: own_lacking_{number}.Lacking\n")
    assert refused("iterate", *OWN, f"grounding=lacking_{number}", "name=refused", folder=home).startswith(said)


@pytest.mark.parametrize(
    ("returned", "said"),
    [
        ("None", "grounding: its learn() returned NoneType, not arrays by name"),
        ("{'a': 'text'}", "grounding: its learn() returned <U4 as a, which are no numbers"),
    ],
)
def test_what_is_no_array_is_refused(returned: str, said: str, iterated: Path, home: Path) -> None:
    name = f"own_wrong_{len(list(home.glob('own_wrong_*.py')))}"
    (home / f"{name}.py").write_text(f"from own_grounding import *\n\n@component\nclass Wrong(Shrink):\n"
                                     f"    def learn(self, evidence, seed):\n        return {returned}\n")  # fmt: skip
    (home / f"mine/grounding/{name}.yaml").write_text(f"_target_: {name}.Wrong\nmodel: ''\n")
    data = ("real=runs/own/iteration_01/collect_real", "sim=runs/own/iteration_01/collect_sim")
    result = gsl("train-grounding", *OWN, f"grounding={name}", *data, f"name={name}", folder=home)
    assert (result.code, result.lines[-1]) == (2, f"gsl train-grounding: {said}")


def test_after_an_edit_of_ones_class_it_learns_anew(iterated: Path, home: Path) -> None:
    data = ("real=runs/own/iteration_01/collect_real", "sim=runs/own/iteration_01/collect_sim")
    path, command = home / "own_edited.py", ("train-grounding", *OWN, "grounding=edited", *data, "name=edited")
    path.write_text(GROUNDING)
    (home / "mine/grounding/edited.yaml").write_text("_target_: own_edited.Shrink\nmodel: ''\n")
    done(*command, folder=home)
    path.write_text(GROUNDING.replace("real / sim", "sim / real"))
    assert "own_edited.py: was changed after it was loaded" in refused(*command, folder=home, code=1)
    importlib.reload(sys.modules["own_edited"])
    assert refused(*command, folder=home).startswith("runs/edited/train_grounding: was built otherwise")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (
            "[step[:3] for step in steps]",
            "optimizer: its ask() returned a candidate of shape (3,); the policy has",
        ),
        ("[]", "optimizer: its ask() returned 0 instead of the "),
        ("None", "optimizer: its ask() returned no list of candidates: "),
        (
            "[np.nan * step for step in steps]",
            "optimizer: its ask() returned a candidate with a number that is not",
        ),
        ("[1 / 0]", "own_bad_4.Run.ask failed (own_bad_4.py, line 29): ZeroDivisionError: division by zero"),
        ("[self.best + step for step in steps[1:]]", "optimizer: its ask() returned 2 instead of the 3 candidates"),
    ],
)
def test_what_an_optimiser_asks_for_is_checked(
    asked: str, said: str, home: Path, request: pytest.FixtureRequest
) -> None:
    number = request.node.callspec.indices["asked"]
    text = OPTIMISER.replace("[self.best + step for step in steps]", asked)
    (home / f"own_bad_{number}.py").write_text(text)
    (home / f"mine/optimizer/bad_{number}.yaml").write_text(f"_target_: own_bad_{number}.RandomSearch\n")
    result = gsl(
        "optimize", *OWN, *SMALL, "grounding=none", f"optimizer=bad_{number}", f"name=bad_{number}", folder=home
    )
    assert result.code in (1, 2)
    assert result.lines[-1].startswith(f"gsl optimize: {said}")


@pytest.mark.parametrize("workers", [1, 2])
def test_own_code_that_fails_in_a_rollout_is_one_line(workers: int, home: Path) -> None:
    (home / "own_fault.py").write_text(PLAIN.replace("action + 0.7", "action + np.ones(3)"))
    (home / "mine/grounding/fault.yaml").write_text("_target_: own_fault.TooFar\n")
    sizes = ("preset=toy", "task.duration=1.6", f"workers={workers}")
    result = gsl("optimize", *OWN, *sizes, "grounding=fault", "accept=true", f"name=fault_{workers}", folder=home)
    fault = "own_fault.TooFar.transform failed (own_fault.py, line 12): NameError: name 'np' is not defined"
    assert result.code == 1 and fault in result.lines[-1] and "internal" not in result.err
