"""A grounding that passes its check at first and is refused in a later iteration, with components of a user's own."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import SMALL, done, gsl

from gsl.policies.walk_engine import WalkEngine

pytestmark = pytest.mark.slow

PI0 = dict(zip(WalkEngine().names, WalkEngine().initial.tolist(), strict=True))
FAST = [*(PI0 | {"max_forward": 0.33, "max_forward_change": 0.25}).values()]

CHOOSY = '''
"""Does nothing in the first rounds, and sends all joints far too far from some round on."""
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.interfaces import Trainable
from gsl.core.setting import component, setting


@component
class Choosy(Trainable):
    needs: ClassVar[tuple[str, ...]] = ("real",)
    model: Annotated[str, setting("path or run of train-grounding")] = ""
    wrong: Annotated[int, setting("seed from which it is wrong; rounds are 1000 apart")] = 1000

    def learn(self, evidence, seed):
        return {"push": np.array(0.3 if seed >= self.wrong else 0.0)}

    def load(self, arrays):
        return Pushing(float(arrays["push"]))


class Pushing:
    def __init__(self, push):
        self.push = push

    def start(self, layout, rng):
        return self

    def transform(self, observation, action):
        return action + self.push
'''

STRIDES = '''
"""A walk that is worth how much its joints move: larger strides are worth more, in every episode."""
import numpy as np

from gsl.core.interfaces import Step
from gsl.core.setting import component
from gsl.tasks.walk import Walk


@component
class Strides(Walk):
    def start(self, layout, observation, role):
        return Moved(layout["position"])


class Moved:
    def __init__(self, place):
        self.place = place

    def step(self, before, after, fell):
        return Step(float(np.abs(after[self.place] - before[self.place]).sum()), ended=False)
'''

BOLD = f'''
"""Proposes one policy with long strides."""
import numpy as np

from gsl.core.setting import component


@component
class Bold:
    candidates: int = 1
    generations: int = 1

    def start(self, parameters, scale, seed):
        return self

    def ask(self):
        return [np.array({FAST})]

    def tell(self, values):
        pass
'''


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for module, text in {"choosy": CHOOSY, "strides": STRIDES, "bold": BOLD}.items():
        (tmp_path / f"{module}.py").write_text(text)
    for group, text in {
        "grounding/choosy": "_target_: choosy.Choosy\nmodel: ''\nwrong: 1000\n",
        "task/strides": "_target_: strides.Strides\nduration: 1.0\nfall_cost: 0.0\n",
        "optimizer/bold": "_target_: bold.Bold\ncandidates: 1\ngenerations: 1\n",
    }.items():
        path = tmp_path / f"mine/{group}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("GSL_TRUST", "choosy,strides,bold")
    return tmp_path


def test_an_iteration_whose_grounding_is_refused_leaves_what_the_one_before_found(home: Path) -> None:
    own = ("grounding=choosy", "task=strides", "optimizer=bold", "iterations=3")
    line = ("iterate", "--config-dir", "mine", *SMALL[::2], *own, "name=chain")
    said = done(*line, folder=home)
    refused = "off π0 are farther from the real ones"
    assert "warning: this grounding is refused: " in said.err and refused in said.err
    table = (home / "runs/chain/iterate/table.md").read_text()
    assert "| 2 | grounding refused |  |  |  |  |  | 6 |" in table
    assert "The grounding of iteration 2 was refused: " in table and refused in table
    places = [home / "runs/chain" / name for name in ("iterate", "iteration_01/evaluate")]
    first, second = ((place / "policies.json").read_text() for place in places)
    assert first == second and not (home / "runs/chain/iteration_02/optimize").exists()
    assert "(unchanged)" in done(*line, folder=home).out
    assert refused in gsl(*line, "grounding.wrong=0", "force=true", folder=home).lines[-1]
