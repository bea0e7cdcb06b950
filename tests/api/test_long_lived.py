"""A process that lives long, as a notebook: the second call comes to what a new process would come to."""

from __future__ import annotations

import importlib
import logging
import os
import random
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import gymnasium
import numpy as np
import pytest
from commands import forget_modules
from hydra import compose, initialize_config_dir
from hydra.core.override_parser.overrides_parser import OverridesParser

import gsl
from gsl.api.overrides import overrides
from gsl.core.trajectory import Batch
from gsl.errors import ConfigError, GslError
from gsl.optimizers.random_state import keep_apart
from gsl.policies.outside import read_once
from gsl.storage.workplace import log_to

pytestmark = pytest.mark.slow

TASK = """
from typing import ClassVar
from gsl.core.interfaces import Step
from gsl.core.setting import component

@component
class Mine:
    duration: float = 0.1
    unit: ClassVar[str] = ""
    shown: ClassVar[float] = 1.0
    falls: ClassVar[bool] = True

    def start(self, layout, observation, role):
        return self

    def step(self, before, after, fell):
        return Step(REWARD, ended=False)

    def outcome(self, layout, trajectory):
        return {}
"""
CAR = """
from gymnasium.envs.classic_control import Continuous_MountainCarEnv

class Car(Continuous_MountainCarEnv):
    steps = 0

    def step(self, action):
        state, _, ended, _, info = super().step(action)
        self.steps += 1
        return state, REWARD, ended, self.steps % 9 == 0, info
"""
PROMPT = """
import gsl
from gsl.errors import GslError
try:
    gsl.run("collect", task=Mine())
except GslError as error:
    print(error)
"""
ELSEWHERE = """
import os, sys
sys.path.insert(0, "")
import gsl, task_of_mine
os.chdir("other")
world, said = gsl.make_world("nao_ideal"), []
for workers in (1, 2):
    log = gsl.roll_out(world, task_of_mine.Mine(), episodes=2, workers=workers)
    said.append({float(reward) for reward in log.episodes[0].reward[1:]})
print(*said)
"""
FEW = {"world": "nao_ideal", "task": "mine", "episodes": 1, "neighbours": 0, "workers": 1}


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder from which modules can be imported, `task_of_mine` among them; none stays."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    rewarding(tmp_path, "1.0")
    yield tmp_path
    forget_modules(tmp_path)


def rewarding(folder: Path, reward: str, module: str = "task_of_mine", code: str = TASK) -> None:
    (folder / f"{module}.py").write_text(code.replace("REWARD", reward))
    importlib.invalidate_caches()


def named(folder: Path) -> Path:
    (folder / "conf/task").mkdir(parents=True)
    (folder / "conf/task/mine.yaml").write_text("_target_: task_of_mine.Mine\n")
    return folder / "conf"


def rewards(batch: Batch) -> set[float]:
    return {float(reward) for episode in batch.episodes for reward in episode.reward[1:]}


def rolled(module: ModuleType, workers: int) -> set[float]:
    return rewards(gsl.roll_out(gsl.make_world("nao_ideal"), module.Mine(), episodes=2, workers=workers))


def test_what_is_loaded_anew_acts_here_and_in_workers(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module behind a class, the class itself, and one of a folder that was added, one after the other."""
    (home / "late_task.py").write_text("VALUE = 1.0\n")
    rewarding(home, "late_task.VALUE", code=f"import late_task\n{TASK}")
    module = importlib.import_module("task_of_mine")
    assert [rolled(module, workers) for workers in (1, 2)] == [{1.0}, {1.0}]
    (home / "late_task.py").write_text("VALUE = 2.50\n")
    importlib.reload(sys.modules["late_task"])
    importlib.reload(module)
    assert [rolled(module, workers) for workers in (1, 2)] == [{2.5}, {2.5}]
    rewarding(home, "4.0")
    importlib.reload(module)
    assert [rolled(module, workers) for workers in (1, 2)] == [{4.0}, {4.0}]
    (home / "src").mkdir()
    rewarding(home / "src", "3.0", "later_task")
    monkeypatch.setattr(sys, "path", [str(home / "src"), *sys.path])
    assert rolled(importlib.import_module("later_task"), 2) == {3.0}


def test_workers_keep_a_module_of_the_folder_in_which_python_began(home: Path) -> None:
    (home / "other").mkdir()
    rewarding(home / "other", "9.0")
    said = subprocess.run([sys.executable, "-"], input=ELSEWHERE, capture_output=True, text=True, cwd=home, check=True)
    assert said.stdout == "{1.0} {1.0}\n"


def test_an_environment_that_is_defined_anew_acts(home: Path) -> None:
    rewarding(home, "1.0", "car_of_mine", CAR)
    world = gsl.make_world("gymnasium", env_id="car_of_mine:Car", trust="car_of_mine")
    policy, task = gsl.make_policy("mlp"), gsl.make_task("own_reward")
    assert rewards(gsl.roll_out(world, task, policy)) == {1.0}
    rewarding(home, "2.50", "car_of_mine", CAR)
    importlib.reload(sys.modules["car_of_mine"])
    assert rewards(gsl.roll_out(world, task, policy)) == {2.5}


def test_nothing_is_written_down_as_of_code_that_did_not_run(home: Path) -> None:
    conf = named(home)
    gsl.run("collect", config_dir=conf, trust="task_of_mine", name="before", **FEW)
    rewarding(home, "2.50")
    with pytest.raises(GslError, match=r"task_of_mine\.py: was changed after it was loaded; start Python anew, or rel"):
        gsl.run("collect", config_dir=conf, trust="task_of_mine", name="after", **FEW)
    assert not (home / "runs/after").exists()
    importlib.reload(sys.modules["task_of_mine"])
    gsl.run("collect", config_dir=conf, trust="task_of_mine", name="after", **FEW)
    assert rewards(gsl.read_trajectories("after")) == {2.5}


def test_a_module_of_another_folder_is_not_taken_for_one_of_this(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [place for place in sys.path if place != str(home)])
    for name, reward in {"A": "1.0", "B": "2.0"}.items():
        (home / name).mkdir()
        rewarding(home / name, reward)
        named(home / name)
    monkeypatch.chdir(home / "A")
    made = gsl.run("collect", config_dir="conf", trust="task_of_mine", name="x", **FEW)
    monkeypatch.chdir(home / "B")
    with pytest.raises(ConfigError, match=r"trust = task_of_mine: is loaded from .*/A already; start Python anew"):
        gsl.run("collect", config_dir="conf", trust="task_of_mine", name="x", **FEW)
    assert sys.path.index(str(home / "B")) < sys.path.index(str(home / "A"))
    assert made.folder == home / "A/runs/x/collect_real" and made.metrics["episodes"] > 0
    sys.modules.pop("task_of_mine")
    gsl.run("collect", config_dir="conf", trust="task_of_mine", name="x", **FEW)
    assert rewards(gsl.read_trajectories("x")) == {2.0}


def test_worlds_keep_the_effects_that_they_were_made_with() -> None:
    effects, worlds = {"servo_gain": {"kp": 1.0}}, []
    for factor in (1.0, 0.3):
        effects["servo_gain"]["kp"] = factor
        worlds.append(gsl.make_world("nao_ideal", effects=effects))
    assert [world.effects["servo_gain"]["kp"] for world in worlds] == [1.0, 0.3]  # type: ignore[attr-defined]


def test_a_class_of_a_prompt_has_no_file_that_an_artifact_could_note(tmp_path: Path) -> None:
    code = TASK.replace("REWARD", "1.0") + PROMPT
    said = subprocess.run([sys.executable, "-"], input=code, capture_output=True, text=True, cwd=tmp_path, check=True)
    assert said.stdout.startswith("Mine, of a notebook or prompt, has no file, and an artifact notes that of its co")


def test_a_program_around_gsl_has_its_own_hydra(tmp_path: Path) -> None:
    for name, text in {"mine": "user: me\n", "conf": "user: gsl\n"}.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "config.yaml").write_text(text)
    with initialize_config_dir(config_dir=str(tmp_path / "mine"), version_base="1.3"):
        gsl.make_world("nao_ideal", config_dir=tmp_path / "conf")
        assert dict(compose("config")) == {"user": "me"}
    with initialize_config_dir(config_dir=str(tmp_path / "mine"), version_base="1.3"):
        assert dict(compose("config")) == {"user": "me"}


def test_two_threads_may_ask_at_once() -> None:
    steps: list[float] = []

    def ask(step: float) -> None:
        steps.extend(gsl.make_world("nao_ideal", step=step).step for _ in range(3))  # type: ignore[attr-defined]

    threads = [threading.Thread(target=ask, args=(step,)) for step in (0.001, 0.002)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(steps) == [0.001] * 3 + [0.002] * 3


def test_a_learner_leaves_the_random_state_of_its_caller() -> None:
    def learn() -> Iterator[float]:
        np.random.seed(3)  # noqa: NPY002  as libraries do
        random.seed(3)
        for _ in range(2):
            yield float(np.random.random() + random.random())  # noqa: NPY002

    alone = list(learn())
    np.random.seed(5)  # noqa: NPY002
    expected = np.random.random(2).tolist()  # noqa: NPY002
    np.random.seed(5)  # noqa: NPY002
    seen, drawn = [], []
    for value in keep_apart(learn()):
        seen.append(value)
        drawn.append(float(np.random.random()))  # noqa: NPY002
    assert (seen, drawn) == (alone, expected)


def test_a_search_with_a_learner_leaves_it_too(home: Path) -> None:
    pytest.importorskip("sb3_contrib")
    np.random.seed(5)  # noqa: NPY002
    before = np.random.get_state()  # noqa: NPY002
    learner = {"steps": 64, "rollout": 32, "batch": 16, "envs": 1}
    settings = {"task": "own_reward", "policy": "mlp", "grounding": "none", "optimizer": "trpo", "rollouts": 1}
    settings |= {f"optimizer.{key}": value for key, value in learner.items()}
    gsl.run(
        "optimize", world="gymnasium", name="l", workers=1, **settings, **{"world.env_id": "MountainCarContinuous-v0"}
    )
    after = np.random.get_state()  # noqa: NPY002
    assert [str(part) for part in before] == [str(part) for part in after]


def test_a_file_of_the_same_name_and_time_in_another_folder_is_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("A", "B"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "net.txt").write_text(name)
        os.utime(tmp_path / name / "net.txt", ns=(10**18, 10**18))
        monkeypatch.chdir(tmp_path / name)
        assert read_once(Path.read_text, "net.txt") == name


def test_a_program_hears_of_the_log_what_it_heard_before(tmp_path: Path) -> None:
    heard: list[str] = []

    class Ear(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            heard.append(record.getMessage())

    root, ear = logging.getLogger(), Ear()
    level = root.level
    root.addHandler(ear)
    root.setLevel(logging.WARNING)
    try:
        with log_to(tmp_path) as outer, log_to(tmp_path):
            outer.info("quiet")
            outer.warning("loud")
        logging.getLogger("gsl").warning("afterwards")
    finally:
        root.removeHandler(ear)
        root.setLevel(level)
    assert heard == ["loud", "afterwards"]


def test_texts_reach_a_stage_as_they_are() -> None:
    for text in ("a\\b", "end\\", 'say "x"', "tab\tand\nline", "null", "plain"):
        (word,) = overrides({"note": [text]})
        (value,) = OverridesParser.create().parse_override(word).value()
        assert str(getattr(value, "text", value)) == text


@pytest.mark.parametrize("envs", [0, 1.5])
def test_environments_side_by_side_are_counted(envs: object) -> None:
    with pytest.raises(ConfigError, match="envs = .*: is how many environments stand side by side, 1 at least"):
        gsl.grounded_env(world="nao_ideal", task="walk", envs=envs)  # type: ignore[arg-type]


def test_a_class_is_no_component() -> None:
    world = gsl.make_world("nao_ideal")
    with pytest.raises(ConfigError, match=r"world = .*: is no world; gsl\.make_world makes one"):
        gsl.roll_out(type(world))  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"world = .*: is no world; gsl\.make_world makes one"):
        gsl.grounded_env(world=type(world), task="walk")  # type: ignore[arg-type]
    assert isinstance(gsl.grounded_env(world=world, task="walk", envs=2), gymnasium.vector.VectorEnv)
