"""The example of examples/bring, from a policy that gsl did not make to one that was trained on, at toy size."""

from __future__ import annotations

import runpy
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from commands import done, refused

import gsl
from gsl.effects.effect import names
from gsl.errors import ConfigError
from gsl.optimizers.sb3 import Sb3
from gsl.policies.policy import size
from gsl.policies.sb3 import Sb3Policy
from gsl.rollout.rl_env import GroundedSimulator
from gsl.rollout.rollout import Scenario
from gsl.storage.policies import read_policies

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:::stable_baselines3")]
sb3 = pytest.importorskip("stable_baselines3")

ROOT = Path(__file__).parents[2]
CONF = f"--config-dir={ROOT}/examples/bring/my_conf"
TRUST = "trust=[examples.bring.mark,stable_baselines3]"
MINE = (CONF, "task=mark", "policy=mine", TRUST, "workers=1")
FEW = ("episodes=2", "check=2", "confirmation=2")


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which a policy was trained in the plain simulator, and the other world was diagnosed."""
    folder = tmp_path_factory.mktemp("bring")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        train(folder, 1000)
        small = ("policy.motions=[steps_large,triangle_slow]", "task.duration=1.5", "workers=1")
        done("collect", CONF, "world=real_pendulum", "task=excite", "name=mine", *small, folder=folder)
        few = f"without={sorted(set(names()) - {'command_latency', 'coulomb_friction'})}"
        quick = ("most=1", "duels=0", "nulls=0", "limits=false", "workers=1", few)
        done("diagnose", CONF, "real=mine", "sim=plain_pendulum", "name=mine", *quick, folder=folder)
    return folder


@pytest.fixture(autouse=True)
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))


def train(folder: Path, steps: int, *more: str) -> None:
    """Run the example's own loop."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "argv", ["train.py", str(steps), *more])
        runpy.run_path(str(ROOT / "examples/bring/train.py"), run_name="__main__")


def test_the_users_own_loop_goes_on_in_the_grounded_simulator(home: Path) -> None:
    train(home, 500, "mine")
    for file in ("mine.zip", "better.zip"):
        world = ("world=real_pendulum", f"policy.file={file}", "policies=null", f"name={file[:-4]}_real")
        assert "pi0, fresh" in done("evaluate", *MINE, *world, *FEW, folder=home).out


def test_optimizer_sb3_goes_on_with_the_zip_in_the_same_simulator(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(home)
    grounded = ("world=plain_pendulum", "grounding=effects", "grounding.diagnosis=mine", "name=again")
    small = ("optimizer=sb3", "optimizer.steps=600", "optimizer.generations=2", "optimizer.settings.n_steps=200")
    done("optimize", *MINE, *grounded, *small, "rollouts=1", folder=home)
    start, first, second = read_policies(home / "runs/again/optimize/policies.json").records
    assert start.parameters != first.parameters != second.parameters
    done("evaluate", *MINE, "world=real_pendulum", "name=again", *FEW, folder=home)
    env = gsl.grounded_env("again", trust=["examples.bring.mark", "stable_baselines3"])
    sb3.PPO.load(home / "mine.zip", env=env).learn(500)


def test_the_whole_chain_takes_a_policy_of_stable_baselines(home: Path) -> None:
    worlds = ("sim=plain_pendulum", "real=real_pendulum", "grounding=effects", "preset=toy", "name=whole")
    small = ("optimizer=sb3", "optimizer.steps=500", "optimizer.generations=1", "optimizer.settings.n_steps=250")
    quick = ("diagnosis.excitation.robot=pendulum", "accept=true")
    done("iterate", *MINE, *worlds, *small, *quick, folder=home)
    assert (home / "runs/whole/iterate/policies.json").is_file()


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
    base = (CONF, "world=plain_pendulum", "task=mark", "policy=mine", "grounding=none", "optimizer=sb3")
    said = refused("optimize", *base, "trust=examples.bring.mark", folder=home)
    assert "say 'trust=[examples.bring.mark,stable_baselines3]'" in said
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
