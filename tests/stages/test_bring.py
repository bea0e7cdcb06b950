"""The example of examples/bring, from a policy that gsl did not make to one that was trained on, at toy size."""

from __future__ import annotations

import json
import runpy
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from commands import done, refused
from pages import commands

import gsl
from gsl.effects.effect import names
from gsl.errors import ConfigError
from gsl.optimizers.sb3 import Sb3
from gsl.policies.policy import size
from gsl.policies.sb3 import Sb3Policy
from gsl.rollout.rl_env import GroundedSimulator
from gsl.rollout.rollout import Scenario
from gsl.storage.policies import read_policies

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:::stable_baselines3"),
    pytest.mark.filterwarnings("ignore:.*torch.jit:DeprecationWarning"),  # the format that Isaac Lab exports
]
sb3 = pytest.importorskip("stable_baselines3")

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/howto/bring-a-policy.md"
CONF = "--config-dir=examples/bring/my_conf"
TRUST = "trust=[examples.bring.follow,stable_baselines3]"
MINE = (CONF, "task=follow", "policy=mine", TRUST, "workers=1")
STEPS = "1000"  # of every training
FEW = ("episodes=2", "check=2", "confirmation=2", "workers=1")
TRIED = sorted(set(names()) - {"command_latency", "coulomb_friction"})
# What the page's commands are made smaller by; this table says all that is run otherwise than it is printed.
SHRUNK = {
    "wiring": (),
    "collect": ("workers=1",),
    "diagnose": ("most=1", "duels=0", "nulls=0", "workers=1", f"without={TRIED}"),
    "evaluate": FEW,
    "optimize": ("preset=toy", "workers=1"),
    "iterate": (
        "preset=toy", "optimizer.steps=500", "optimizer.generations=1", "optimizer.settings.n_steps=250",
        "diagnosis.excitation.robot=pendulum", f"diagnosis.without={TRIED}", "accept=true", "workers=1",
    ),
}  # fmt: skip
EXCITED = ("policy.motions=[steps_large,triangle_slow]", "task.duration=1.5")


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which all commands of the page were run, in their order."""
    folder = tmp_path_factory.mktemp("bring")
    (folder / "examples").symlink_to(ROOT / "examples")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        for command in ordered():
            run(command, folder)
    return folder


@pytest.fixture(autouse=True)
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))


def ordered() -> list[tuple[str, ...]]:
    """The page's commands in its order; seeds have a test of their own."""
    return [command.words for command in commands(PAGE) if "examples/bring/seeds.py" not in command.words]


def run(words: tuple[str, ...], folder: Path) -> None:
    """Run a command of the page at toy size."""
    program, name, *rest = words
    if program == "python":
        script(name, *(STEPS if word.isdigit() else word for word in rest), folder=folder)
        return
    small = (*SHRUNK[name], *(EXCITED if "task=excite" in rest else ()))
    done(name, *rest, *small, folder=folder)


def script(path: str, *arguments: str, folder: Path) -> None:
    """Run a script of the example."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.syspath_prepend(str(ROOT / "examples/bring"))
        patch.setattr(sys, "argv", [path, *arguments])
        runpy.run_path(str(ROOT / path), run_name="__main__")


def test_the_whole_way_of_the_page_runs(home: Path) -> None:
    for file in ("mine", "better"):
        assert (home / f"{file}.zip").is_file() and (home / f"{file}.pt").is_file()
    for name in ("plain", "before", "after", "trimmed", "exported"):
        metrics = json.loads((home / f"runs/{name}/evaluate/metrics.json").read_text())
        assert 0.0 < metrics["returned"]["value"] <= 150.0, name
    assert (home / "runs/whole/iterate/policies.json").is_file()


def test_the_two_files_of_an_actor_do_the_same(home: Path) -> None:
    values = []
    for policy, trust in (("mine", TRUST), ("mine_torch", "trust=examples.bring.follow")):
        how = ("world=real_pendulum", "task=follow", f"policy={policy}", "policies=null", trust, f"name=of_{policy}")
        done("evaluate", CONF, *how, *FEW, folder=home)
        metrics = json.loads((home / f"runs/of_{policy}/evaluate/metrics.json").read_text())
        values.append(metrics["returned"]["value"])
    assert values[0] == pytest.approx(values[1], rel=1e-4)


def test_seeds_are_a_row_each(home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    for name in ("mine_1", "better_1"):  # what is there is not trained
        (tmp_path / f"{name}.zip").write_bytes((home / "mine.zip").read_bytes())
    script("examples/bring/seeds.py", "1", folder=tmp_path)
    row = capsys.readouterr().out.splitlines()[-1]
    seed, plain, came, better = (float(value) for value in row.strip("| ").split("|"))
    assert seed == 1.0 and came == better and 0.0 < came <= 150.0 and 0.0 < plain <= 150.0


def test_optimizer_sb3_goes_on_with_the_zip_in_the_same_simulator(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(home)
    grounded = ("world=plain_pendulum", "grounding=effects", "grounding.diagnosis=mine", "name=again")
    small = ("optimizer=sb3", "optimizer.steps=600", "optimizer.generations=2", "optimizer.settings.n_steps=200")
    done("optimize", *MINE, *grounded, *small, "rollouts=1", folder=home)
    start, first, second = read_policies(home / "runs/again/optimize/policies.json").records
    assert start.parameters != first.parameters != second.parameters
    env = gsl.grounded_env("again", trust=["examples.bring.follow", "stable_baselines3"])
    sb3.PPO.load(home / "mine.zip", env=env).learn(500)


def scenario(policy: Sb3Policy) -> Scenario:
    from gsl.grounding.none import NoGrounding
    from gsl.tasks.own_reward import OwnReward
    from gsl.worlds.gymnasium import GymnasiumWorld

    world = GymnasiumWorld(env_id="CartPole-v1") if "cart" in policy.file else GymnasiumWorld(env_id="Pendulum-v1")
    return Scenario(world, OwnReward(), size(policy, world), "sim", NoGrounding())


@pytest.mark.parametrize("kind", ["PPO", "SAC", "TRPO", "DQN"])
def test_every_algorithm_is_told_by_its_file_acts_alike_and_goes_on(kind: str, tmp_path: Path) -> None:
    library = pytest.importorskip("sb3_contrib") if kind == "TRPO" else sb3
    env = "CartPole-v1" if kind == "DQN" else "Pendulum-v1"
    small = {"n_steps": 64} if kind in ("PPO", "TRPO") else {"learning_starts": 10}
    more = {"batch_size": 32, "policy_kwargs": {"net_arch": [8]}}
    model = getattr(library, kind)("MlpPolicy", env, seed=1, device="cpu", **small, **more)
    path = tmp_path / f"{'cart' if kind == 'DQN' else 'swing'}.zip"
    model.learn(64).save(path)
    rolled = scenario(Sb3Policy(file=str(path)))
    policy = rolled.policy
    assert isinstance(policy, Sb3Policy)
    run = policy.start(policy.initial, rolled.world.layout)
    seen = np.array([0.1, -0.2, 0.3, 0.05])[: rolled.world.layout.states]
    action, _ = model.predict(seen.astype(np.float32), deterministic=True)
    wanted = float(action) if kind == "DQN" else float(np.clip(action[0] / 2.0, -1.0, 1.0))
    assert run.act(seen)[0] == pytest.approx(wanted, rel=1e-5)
    assert policy.names and len(set(policy.names)) == len(policy.initial)
    steps: list[int] = []
    optimizer = Sb3(steps=128, generations=2)
    learned = list(
        optimizer.learn(
            GroundedSimulator(rolled, policy.initial), policy, policy.initial, 1, bold=True, advance=steps.append
        )
    )
    assert len(learned) == 2 and not np.array_equal(learned[0], policy.initial)
    assert sum(steps) <= optimizer.steps_taken


def test_parameters_are_the_actors_weights_alone(tmp_path: Path) -> None:
    model = sb3.PPO("MlpPolicy", "Pendulum-v1", seed=1, device="cpu", n_steps=64, batch_size=32)
    model.save(tmp_path / "swing.zip")
    policy = Sb3Policy(file=str(tmp_path / "swing.zip"))
    assert len(policy.initial) == 3 * 64 + 64 + 64 * 64 + 64 + 64 + 1
    assert not any("value" in name or "log_std" in name for name in policy.names)


def test_a_zip_is_not_opened_without_trust_and_its_own_settings_are_known(home: Path) -> None:
    base = (CONF, "world=plain_pendulum", "task=follow", "policy=mine", "grounding=none", "optimizer=sb3")
    said = refused("optimize", *base, "trust=examples.bring.follow", folder=home)
    assert "say 'trust=[examples.bring.follow,stable_baselines3]'" in said
    said = refused("optimize", *base, TRUST, "optimizer.settings.learning_rat=1", "workers=1", folder=home, code=2)
    assert said.endswith("did you mean learning_rate?")
    with zipfile.ZipFile(home / "mine.zip") as file:
        assert "data" in file.namelist()


def test_an_environment_is_rewarded_as_the_task_says_and_stands_side_by_side() -> None:
    both = gsl.grounded_env(world="inverted_pendulum", envs=2)
    seen, _ = both.reset(seed=[1, 2])
    assert seen.shape == (2, 4) and both.single_action_space.high[0] == 3.0
    assert both.step(np.zeros((2, 1)))[1].tolist() == [1.0, 1.0]
    with pytest.raises(ConfigError, match="a robot has no reward of its own"):
        gsl.grounded_env(world="nao_ideal")
