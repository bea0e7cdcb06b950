"""Any gymnasium environment as a world: spaces, rewards, grounding, TRPO, and what is refused."""

from __future__ import annotations

import importlib
import json
import sys
import tempfile
import warnings
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from commands import done, gsl, refused

from gsl.commandline.composer import compose
from gsl.commandline.config import prepare, resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.core.layout import check_alike
from gsl.core.seeds import derive_seed
from gsl.core.trajectory import Batch
from gsl.errors import ConfigError, GslError, TrajectoryError
from gsl.grounding.ane import ActionNoise
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.none import NoGrounding
from gsl.grounding.random_choice import RandomChoice
from gsl.grounding.states import StateTransformation
from gsl.models.config import ModelConfig
from gsl.models.states import NearestChoice, StateForward, StateInverse
from gsl.optimizers.trpo import Trpo
from gsl.policies.mlp import Mlp
from gsl.policies.policy import size
from gsl.rollout.rl_env import GroundedSimulator
from gsl.rollout.rollout import Scenario, rollout
from gsl.storage.models import read_forward_model, read_inverse_model
from gsl.storage.trajectories import read, write
from gsl.tasks.own_reward import OwnReward
from gsl.training.data import Parts
from gsl.training.states import forward_of_states, inverse_of_states
from gsl.validation.uncharged import is_uncharged
from gsl.validation.values_of_states import ValueReport, value_report
from gsl.worlds.control_cost import Charged, Quadratic
from gsl.worlds.environments import own_module
from gsl.worlds.gymnasium import GymnasiumWorld
from gsl_experiments.noise_table import Point

pytestmark = pytest.mark.slow

CART = GymnasiumWorld(env_id="examples.cart:Cart")
POLE = GymnasiumWorld(env_id="CartPole-v1")
SLOPE = replace(CART, kwargs={"slope": 2.0})
SHALLOW = tuple(
    f"{model}.{size}" for model in ("forward_model", "inverse_model") for size in ("epochs=20", "hidden=[32]")
)
OF_TRIALS = tuple(f"iterate.{setting}" for setting in SHALLOW)
BRIEF = ("iterate.optimizer.rollout=256", "further.rollout=256")  # of TRPO, which steps whole rollouts


class Strange(gymnasium.Env):
    """An environment that can be wrong in every way."""

    def __init__(self, observes: Any = (2,), acts: float = 1.0, value: float = 0.0, reward: float = 0.0) -> None:
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, tuple(observes))
        self.action_space = gymnasium.spaces.Box(-acts, acts, (1,))
        self.value, self.reward = value, reward

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[np.ndarray, dict[str, Any]]:
        return np.zeros(self.observation_space.shape), {}  # type: ignore[arg-type]

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        state = np.zeros(self.observation_space.shape)  # type: ignore[arg-type]
        state[1] = self.value
        return state, self.reward, False, False, {}


class PlainCost:
    """Tells a cost, but no settings."""

    def cost(self, action: np.ndarray) -> float:
        return 0.0


class Nothing(gymnasium.Env):
    """Has no spaces."""


class Priced(Strange):
    """Tells what an action costs, to a power, or something else instead."""

    def __init__(self, power: float = 2.0, weight: float = 0.1, each: bool = False) -> None:
        super().__init__()
        self.power, self.weight, self.each = power, weight, each

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        price = -self.weight * float(np.abs(action[0])) ** self.power
        return np.zeros(2), price, False, False, {"reward_ctrl": np.array([price, price]) if self.each else price}


class Ends(Strange):
    """Insists on its range, which is uneven."""

    def __init__(self, low: float = -0.01, high: float = 0.43) -> None:
        super().__init__()
        self.action_space = gymnasium.spaces.Box(np.float32(low), np.float32(high), (1,))

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        assert self.action_space.contains(action)
        return super().step(action)


class InPlace(Strange):
    """Its state is one array that it changes, as an environment may."""

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[np.ndarray, dict[str, Any]]:
        self.state = np.zeros(2)
        return self.state, {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        self.state += 1.0
        return self.state, 0.0, False, False, {}


def a_policy(world: GymnasiumWorld, hidden: tuple[int, ...] = ()) -> Any:
    return size(Mlp(hidden=hidden), world)


def episodes(world: GymnasiumWorld, count: int, sd: float = 0.0, role: str = "sim") -> Batch:
    policy = a_policy(world)
    noise = RandomChoice(sd) if world.layout.choices else ActionNoise(sd=sd)
    scenario = Scenario(world, OwnReward(), policy, role, noise)
    env = scenario.make()
    trajectories = tuple(rollout(scenario, env, policy.initial, derive_seed(1, role, k)) for k in range(count))
    layout = world.layout
    about = {"robot": world.env_id, "role": role, "cells": layout.cells, "choices": layout.choices}
    return Batch(trajectories, layout.joints, layout.control_period, about)


def test_actions_are_scaled_and_states_are_vectors() -> None:
    world = GymnasiumWorld(env_id="Pendulum-v1")
    assert (world.layout.states, world.layout.joints, world.layout.control_period) == (3, ("0",), 0.05)
    env, inner = world.make(), gymnasium.make("Pendulum-v1")
    env.reset(seed=3)
    inner.reset(seed=3)
    ours, theirs = env.step(np.array([0.5])), inner.step(np.array([1.0]))
    np.testing.assert_allclose(ours[0], theirs[0], atol=1e-6)
    assert ours[1] == pytest.approx(float(theirs[1]))
    np.testing.assert_array_equal(env.step(np.array([7.0]))[4]["carried_out"], [1.0])


def test_noise_is_drawn_from_the_seed_of_the_episode() -> None:
    env = replace(CART, action_noise=0.3).make()
    ways = []
    for seed in (1, 1, 2):
        env.reset(seed=seed)
        ways.append(np.array([env.step(np.zeros(1))[0][1] for _ in range(20)]))
    np.testing.assert_array_equal(ways[0], ways[1])
    assert not np.array_equal(ways[0], ways[2])


def test_a_batch_of_states_makes_the_trip_through_its_file(tmp_path: Path) -> None:
    batch = episodes(CART, 3, 0.2)
    write(tmp_path / "log.parquet", batch)
    log = read(tmp_path / "log.parquet")
    assert log.states == 2
    for episode, other in zip(log.episodes, batch.episodes, strict=True):
        np.testing.assert_array_equal(episode.state, other.state)
        np.testing.assert_array_equal(episode.grounded_action, other.grounded_action)
        np.testing.assert_array_equal(episode.sensors["terminated"], other.sensors["terminated"])
    import pyarrow.parquet as pq

    columns = pq.read_table(tmp_path / "log.parquet").to_pydict()
    assert columns["next_state.1"][:5] == columns["state.1"][1:6]


def test_a_next_state_that_is_not_the_next_rows_is_refused(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    write(tmp_path / "log.parquet", episodes(CART, 2))
    table = pq.read_table(tmp_path / "log.parquet")
    column = table.column("next_state.0").to_numpy().copy()
    column[3] += 1.0
    pq.write_table(table.set_column(table.column_names.index("next_state.0"), "next_state.0", [column]), tmp_path / "l")
    with pytest.raises(TrajectoryError, match=r"next_state\.0, row 3: is not the state of the next row"):
        read(tmp_path / "l")


def test_an_environment_may_change_its_state_in_place() -> None:
    env = GymnasiumWorld(env_id="test_gymnasium:InPlace").make()
    first, _ = env.reset(seed=0)
    second = env.step(np.zeros(1))[0]
    assert (first[0], second[0]) == (0.0, 1.0)


def test_noise_on_actions_is_not_the_environments_own() -> None:
    env = GymnasiumWorld(env_id="test_gymnasium:InPlace", action_noise=0.1).make()
    env.reset(seed=5)
    noise = env.step(np.zeros(1))[4]["carried_out"] / 0.1
    assert noise[0] != pytest.approx(np.random.default_rng(5).standard_normal())


def test_choices_of_a_noisy_world_are_replaced_now_and_then() -> None:
    env = replace(POLE, action_noise=0.5).make()
    env.reset(seed=1)
    sent = []
    for _ in range(400):
        _, _, ended, _, info = env.step(np.array([1.0]))
        sent.append(info["carried_out"][0])
        if ended:
            env.reset(seed=len(sent))
    assert 0.15 < np.mean(np.array(sent) == 0.0) < 0.35


def test_the_reward_charges_for_the_action_of_the_agent() -> None:
    """Grounded to a quarter of its size, an action costs as if it were whole."""

    class Quarter:
        def start(self, layout: Any, rng: Any) -> Any:
            return self

        def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
            return 0.25 * action

    rewards = {}
    for name, world in {"told": CART, "given": replace(CART, control_cost=Quadratic(0.1))}.items():
        scenario = Scenario(world, OwnReward(), a_policy(world), "sim", Quarter())
        env = scenario.make()
        env.reset(seed=0)
        state, rewards[name], *_ = env.step(np.array([0.8]))
    assert rewards["told"] == pytest.approx(-abs(state[0]) - 0.1 * 0.8**2)
    assert rewards["given"] == pytest.approx(rewards["told"])


def test_a_price_in_the_actuators_own_units_is_charged_in_them() -> None:
    low, high = np.array([0.0, -4.0]), np.array([2.0, 4.0])
    raw = {"sent": np.array([1.5, 1.0]), "agent": np.array([0.5, -2.0])}
    sent, agent = ((2.0 * action - high - low) / (high - low) for action in raw.values())
    price = {name: -0.3 * float(action @ action) for name, action in raw.items()}
    reward = Charged(None, low, high).correct(
        7.0 + price["sent"], agent, sent, {"carried_out": sent, "reward_ctrl": price["sent"]}
    )
    assert reward == pytest.approx(7.0 + price["agent"])


def test_noise_of_the_world_is_not_charged() -> None:
    env = GymnasiumWorld(env_id="test_gymnasium:Priced", action_noise=0.5).make()
    env.reset(seed=0)
    steps = [env.step(np.array([0.4])) for _ in range(20)]
    assert np.std([info["carried_out"][0] for *_, info in steps]) > 0.2
    np.testing.assert_allclose([reward for _, reward, *_ in steps], -0.1 * 0.4**2, rtol=1e-5)


@pytest.mark.parametrize("kwargs", [{"power": 1.0}, {"weight": -0.1}, {"each": True}], ids=str)
def test_a_price_that_is_not_quadratic_is_one_line(kwargs: dict[str, Any]) -> None:
    env = GymnasiumWorld(env_id="test_gymnasium:Priced", kwargs=kwargs, action_noise=0.5).make()
    env.reset(seed=0)
    with pytest.raises(GslError, match=r"info\['reward_ctrl'\] is no -w \|u\|².*control_cost="):
        for _ in range(5):
            env.step(np.array([0.4]))


def test_the_ends_of_a_range_are_within_it() -> None:
    rng = np.random.default_rng(0)
    for low, high in [(-0.01, 0.43), *np.sort(rng.uniform(-5.0, 5.0, (50, 2)), axis=1).tolist()]:
        env = GymnasiumWorld(env_id="test_gymnasium:Ends", kwargs={"low": low, "high": high}).make()
        env.reset(seed=0)
        for end in (-1.0, 1.0):
            env.step(np.array([end]))


def models(tmp_path: Path, sim: GymnasiumWorld, real: GymnasiumWorld, **config: Any) -> tuple[Any, Any]:
    config = ModelConfig("mlp", hidden=(32,), epochs=40, **config)
    for name, world, learn, role in (
        ("f", real, forward_of_states, "real"),
        ("i", sim, inverse_of_states, "sim"),
    ):
        (tmp_path / name).mkdir()
        parts = Parts(*(episodes(world, count, 0.6, role) for count in (24, 6, 6)))
        metrics = learn(tmp_path / name, parts, replace(config, likelihood="point") if name == "i" else config, 1)
        assert metrics["heldout"]
    return read_forward_model(str(tmp_path / "f/forward_model.safetensors")), read_inverse_model(
        str(tmp_path / "i/inverse_model.safetensors")
    )


def test_the_grounded_simulator_moves_like_the_real_world(tmp_path: Path) -> None:
    f, f_inv = models(tmp_path, CART, SLOPE)
    assert isinstance(f, StateForward) and isinstance(f_inv, StateInverse)
    policy = a_policy(CART)
    ways = {}
    for name, world, grounding in (
        ("real", SLOPE, NoGrounding()),
        ("bare", CART, NoGrounding()),
        ("grounded", CART, StateTransformation(f, f_inv)),
    ):
        scenario = Scenario(world, OwnReward(), policy, "sim", grounding)
        trajectory = rollout(scenario, scenario.make(), np.array([-1.5, -1.0, 0.0]), 4)
        assert trajectory.state is not None
        ways[name] = trajectory.state[:60, 0]
    off = {name: float(np.abs(ways[name] - ways["real"]).max()) for name in ("bare", "grounded")}
    assert off["grounded"] < 0.4 * off["bare"]


def test_a_stochastic_grounding_makes_the_noise_of_the_real_world(tmp_path: Path) -> None:
    f, f_inv = models(tmp_path, CART, replace(CART, action_noise=0.3), likelihood="gaussian")
    spread = []
    for world, grounding in (
        (replace(CART, action_noise=0.3), NoGrounding()),
        (CART, StateTransformation(f, f_inv, draws=True)),
        (CART, StateTransformation(f, f_inv)),
    ):
        scenario = Scenario(world, OwnReward(), a_policy(CART), "sim", grounding)
        env = scenario.make()
        ends = [rollout(scenario, env, np.array([-1.0, -1.0, 0.0]), k) for k in range(60)]
        spread.append(np.std([episode.state[60, 1] for episode in ends if episode.state is not None]))
    real, stochastic, plain = spread
    assert 0.6 * real < stochastic < 1.6 * real
    assert plain < 0.3 * real


def test_noise_on_actions_is_drawn_in_all_variables_at_once(tmp_path: Path) -> None:
    """An inverse model averages noise away that each variable has for itself."""
    sd, real = 0.3, replace(CART, action_noise=0.3)
    sends = {}
    for covariance in ("full", "diagonal"):
        (tmp_path / covariance).mkdir()
        f, f_inv = models(tmp_path / covariance, CART, real, likelihood="gaussian", covariance=covariance)
        assert (f.mixing is None) == (covariance == "diagonal")
        assert f.mixing is None or (f.mixing @ f.mixing.T)[0, 1] > 0.9
        run = StateTransformation(f, f_inv, draws=True).start(CART.layout, np.random.default_rng(0))
        sends[covariance] = np.std([run.transform(np.array([0.5, 0.0]), np.zeros(1))[0] for _ in range(500)])
    assert sends["full"] == pytest.approx(sd, rel=0.2)
    assert sends["diagonal"] < sends["full"]


def test_choices_are_grounded_by_the_nearest_effect(tmp_path: Path) -> None:
    f, f_inv = models(tmp_path, POLE, POLE)
    assert isinstance(f_inv, NearestChoice)
    states = np.random.default_rng(0).normal(size=(200, 4)) * [0.1, 0.3, 0.05, 0.3]
    actions = np.random.default_rng(1).integers(2, size=(200, 1)).astype(float)
    choices = f_inv.actions_for(states, f.changes(states, actions))
    assert (choices == actions).mean() > 0.95


def test_trpo_learns_and_goes_on_from_what_it_learned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sb3_contrib")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.delenv("SB3_LOGDIR", raising=False)
    policy = a_policy(CART, (16,))
    simulator = GroundedSimulator(Scenario(CART, OwnReward(), policy, "sim", NoGrounding()), policy.initial)
    trpo = Trpo(steps=8192, generations=2, rollout=1024)
    steps: list[int] = []
    first, second = trpo.learn(simulator, policy, policy.initial, 1, bold=True, advance=steps.append)
    assert sum(steps) == trpo.steps_taken == 8192
    assert not list(tmp_path.iterdir())
    scenario = Scenario(CART, OwnReward(), policy, "sim", NoGrounding())

    def value(parameters: np.ndarray) -> float:
        env = scenario.make()
        return float(np.mean([rollout(scenario, env, parameters, k).value for k in range(10)]))

    assert value(second) > value(policy.initial) + 3.0
    (again,) = Trpo(steps=1024, rollout=1024).learn(simulator, policy, second, 2, bold=False, advance=steps.append)
    assert value(again) > value(policy.initial) + 3.0
    once_more = trpo.learn(simulator, policy, policy.initial, 1, bold=True, advance=steps.append)
    np.testing.assert_array_equal(first, next(iter(once_more)))


def test_the_example_of_the_docs_wins_by_its_grounding(tmp_path: Path) -> None:
    few = ("budget.rollouts=3", "budget.episodes=5", "optimizer.candidates=8", "optimizer.generations=6", "workers=1")
    worlds = ("sim.env_id=examples.cart:Cart", "real.env_id=examples.cart:Cart", "real.kwargs.slope=2")
    search = ("optimizer=cma_es", "optimizer.sigma=0.5", "policy.hidden=[]", *SHALLOW)
    done("iterate", "experiment=gymnasium", "name=cart", *search, *worlds, *few, "beside=true", folder=tmp_path)
    metrics = json.loads((tmp_path / "runs/cart/iterate/metrics.json").read_text())
    assert metrics["gain"]["interval"][0] > 0.0
    assert metrics["returned"]["value"] > metrics["ungrounded"]["returned"]["value"]


def test_groundings_of_environments_are_compared(tmp_path: Path) -> None:
    worlds = ("iterate.sim.env_id=examples.cart:Cart", "worlds.real.env_id=examples.cart:Cart")
    search = ("optimizer@iterate.optimizer=cma_es", "iterate.policy.hidden=[]", "iterate.optimizer.sigma=0.5")
    few = ("trials=2", "preset=toy", "~methods.ane_02", "~methods.ane_05", "~methods.sgat", *OF_TRIALS)
    few += tuple(f"iterate.budget.{name}=4" for name in ("real_episodes", "sim_episodes", "episodes", "confirmation"))
    few += ("iterate.budget.rollouts=2",)
    slope = ("worlds.real.kwargs.slope=2", "iterate.workers=1")
    said = done("compare", "experiment=environments", "name=e", *few, *worlds, *slope, *search, folder=tmp_path)
    home = tmp_path / "runs/e"
    collected = (home / "real/data/trial_01/collect_real/config.yaml").read_text()
    assert "initial: runs/e/sim/pretrained/trial_01/best_in_simulation.json" in collected
    trials = json.loads((home / "compare/trials.json").read_text())
    assert [(trial["method"], trial["number"]) for trial in trials] == [
        ("none", 1),
        ("gat", 1),
        ("none", 2),
        ("gat", 2),
    ]
    assert trials[0]["start"] == trials[1]["start"]  # the same π0, in the same episodes
    assert "falls" not in said.out and "stable winners" not in said.out
    other = ("+world@worlds.other=gymnasium", "worlds.other.env_id=CartPole-v1")
    said = refused("compare", "experiment=environments", *few, *worlds, *search, *other, folder=tmp_path)
    assert said == "real: has 4 states, the simulator 2; a policy must fit both"


def test_the_check_of_pi0_is_with_the_noise_of_the_real_episodes() -> None:
    policy = a_policy(CART)
    real = episodes(CART, 30, 0.8).episodes
    scenario = Scenario(CART, OwnReward(), policy, "sim", NoGrounding())
    alike = value_report(scenario, policy.initial, real, ActionNoise(sd=0.8), 3)
    still = value_report(scenario, policy.initial, real, ActionNoise(sd=0.0), 3)
    assert abs(alike.values["grounded"].mean() - alike.values["real"].mean()) < 1.0
    assert abs(still.values["grounded"].mean() - still.values["real"].mean()) > 1.5


def test_all_bodies_are_heavier_with_all() -> None:
    pytest.importorskip("mujoco")
    light = GymnasiumWorld(env_id="HalfCheetah-v5")
    masses = [world.make().unwrapped_env.model.body_mass.sum() for world in (light, replace(light, mass={"all": 2.0}))]
    assert masses[1] == pytest.approx(2.0 * masses[0])


def test_heavier_bodies() -> None:
    pytest.importorskip("mujoco")
    light = GymnasiumWorld(env_id="InvertedPendulum-v5")
    heavy = replace(light, mass={"pole": 10.0})
    masses = [world.make().unwrapped_env.model.body("pole").mass[0] for world in (light, heavy)]
    assert masses[1] == pytest.approx(10.0 * masses[0])
    with pytest.raises(ConfigError, match=r"no such body; did you mean pole\?"):
        replace(light, mass={"pale": 2.0}).make()


@pytest.mark.parametrize(
    ("name", "body", "mass"),
    [("inverted_pendulum_heavy", "pole", 100.0), ("hopper_heavy", "torso", 6.0), ("walker2d_heavy", "torso", 10.0)],
)
def test_garat_s_worlds_weigh_what_they_say(name: str, body: str, mass: float) -> None:
    pytest.importorskip("mujoco")
    line = [f"world={name}", "task=own_reward", "policy=mlp"]
    with open_hydra(None):
        stage, *_ = prepare(resolve(compose("collect", line)))
    assert stage.world.make().unwrapped_env.model.body(body).mass[0] == pytest.approx(mass, rel=1e-3)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"env_id": "CartPol-v1"}, "there is no such environment: Environment `CartPol` doesn't exist"),
        ({"env_id": "examples.cart:Carriage"}, "there is no such environment"),
        ({"env_id": "nowhere.at:All"}, "No module named 'nowhere'"),
        ({"env_id": "nowhere:All-v0"}, "env_id = nowhere:All-v0: cannot be made: ModuleNotFoundError"),
        ({"env_id": "test_gymnasium:Nothing"}, "env_id = test_gymnasium:Nothing: has no observation_space"),
        ({"env_id": "a_broken_module:Any"}, "its module cannot be imported: NameError"),
        ({"env_id": "test_gymnasium:Strange", "kwargs": {"observes": [8, 8, 3]}}, "observes a Box of shape (8, 8, 3)"),
        ({"env_id": "test_gymnasium:Strange", "kwargs": {"acts": float("inf")}}, "its actions have no bounds"),
        (
            {"env_id": "examples.cart:Cart", "kwargs": {"slop": 1.0}},
            "examples.cart:Cart cannot be made: TypeError",
        ),
        ({"env_id": "examples.cart:Cart", "mass": {"all": 2.0}}, "mass: is for MuJoCo environments"),
    ],
)
def test_an_environment_that_does_not_fit_is_one_line(
    changes: dict[str, Any], line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a_broken_module.py").write_text("nothing_of_this_name\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ConfigError) as caught:
        GymnasiumWorld(**changes).make()
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("wrong", "line"), [("value", r"state\.1 is nan"), ("reward", "the reward is nan")])
def test_an_environment_that_breaks_is_one_line(wrong: str, line: str) -> None:
    world = GymnasiumWorld(env_id="test_gymnasium:Strange", kwargs={wrong: float("nan")})
    env = world.make()
    env.reset(seed=0)
    with pytest.raises(GslError, match=line):
        env.step(np.zeros(1))


def test_a_setting_without_settings_of_its_own_is_refused(tmp_path: Path) -> None:
    cost = f"world.control_cost={{_target_: {__name__}.PlainCost}}"
    place = ("world=gymnasium", "world.env_id=examples.cart:Cart", "task=own_reward", "policy=mlp", "role=sim")
    said = refused("collect", *place, cost, "episodes=3", "neighbours=0", folder=tmp_path)
    assert said.startswith("_target_ = PlainCost: is no dataclass") and said.endswith("put @dataclass above it")


class Faulty(gymnasium.Env):
    """Whose step or reset is wrong in one way."""

    observation_space, action_space = gymnasium.spaces.Box(-9.0, 9.0, (2,)), gymnasium.spaces.Box(-1.0, 1.0, (1,))

    def __init__(self, way: str = "") -> None:
        self.way = way

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        return np.zeros(2) if self.way == "reset" else (np.zeros(2), {})

    def step(self, action: np.ndarray) -> Any:
        if self.way == "raise":
            raise RuntimeError("no power")
        reward: Any = {"none": None, "word": "much", "array": np.ones(1)}.get(self.way, 1.0)
        return (np.zeros(2), reward, True, False, {})[: 4 if self.way == "four" else 5]


@pytest.mark.parametrize(
    ("way", "problem"),
    [
        ("reset", "its reset() returns no (observation, info)"),
        ("four", "its step() returns no (observation, reward, terminated, truncated, info)"),
        ("none", "the reward is None, no finite number; its dynamics or its reward are broken"),
        ("word", "the reward is much, no finite number; its dynamics or its reward are broken"),
        ("array", "the reward is [1.], no finite number; its dynamics or its reward are broken"),
        ("raise", "fails by itself: RuntimeError: no power"),
    ],
)
def test_an_environment_that_fails_is_told_before_anything_is_learned(way: str, problem: str, tmp_path: Path) -> None:
    place = (f"sim.env_id={__name__}:Faulty", f"real.env_id={__name__}:Faulty", f"real.kwargs.way={way}")
    said = refused("iterate", "experiment=gymnasium", *place, "optimizer=cma_es", folder=tmp_path)
    assert said == f"real.env_id = {__name__}:Faulty (way={way}): {problem}"


def test_effects_are_refused_where_there_are_none_before_anything_is_learned(tmp_path: Path) -> None:
    place = ("sim.env_id=examples.cart:Cart", "real.env_id=examples.cart:Cart", "optimizer=cma_es")
    said = refused("iterate", "experiment=gymnasium", *place, "grounding=effects", folder=tmp_path)
    assert said == "grounding: this world has no effects to switch on; take another grounding"


def test_a_change_of_one_s_own_environment_makes_another_world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (Path(__file__).parents[2] / "examples/cart.py").read_text()
    (tmp_path / "own_cart.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    line = ("collect", "role=sim", "name=c", "world=gymnasium", "world.env_id=own_cart:Cart", "task=own_reward")
    line += ("policy=mlp", "episodes=3", "neighbours=0", "workers=1")
    done(*line, folder=tmp_path)
    assert "unchanged" in done(*line, folder=tmp_path).out
    (tmp_path / "own_cart.py").write_text(text + "\n")
    assert "was changed after it was loaded" in refused(*line, folder=tmp_path, code=1)
    importlib.reload(sys.modules["own_cart"])
    assert "changed: the data of world.env_id" in refused(*line, folder=tmp_path)
    assert own_module("gsl.worlds.cliff_walking:CliffWalking") is own_module("HalfCheetah-v5") is None


def test_too_few_episodes_are_refused_before_anything_is_collected(tmp_path: Path) -> None:
    place = ("sim.env_id=examples.cart:Cart", "real.env_id=examples.cart:Cart", "optimizer=cma_es")
    said = refused("iterate", "experiment=gymnasium", *place, "recipe.real_episodes=2", folder=tmp_path)
    assert said.startswith("budget.real_episodes: 2 episodes with neighbours; 3 are the least for a model")


def test_environments_that_charge_nothing_are_known() -> None:
    pytest.importorskip("mujoco")
    names = ("InvertedPendulum-v5", "InvertedDoublePendulum-v5", "HalfCheetah-v5", "Pendulum-v1", "examples.cart:Cart")
    assert [is_uncharged(GymnasiumWorld(env_id=name)) for name in names] == [False, False, False, True, False]


def test_noise_that_may_be_charged_for_is_told_where_a_real_value_is(tmp_path: Path) -> None:
    line = ("name=p", "world=gymnasium", "world.env_id=Pendulum-v1", "task=own_reward", "policy=mlp")
    few = ("optimizer.generations=1", "optimizer.candidates=4", "rollouts=1", "workers=1")
    done("optimize", *line, *few, "grounding=none", folder=tmp_path)
    measured = ("evaluate", *line, "episodes=1", "check=1", "confirmation=2", "workers=1")
    warning = "the reward may charge for the world's noise instead of the agent's action; real.control_cost="
    assert warning not in done(*measured, folder=tmp_path).err
    assert warning in done(*measured, "world.action_noise=0.5", "force=true", folder=tmp_path).err


def test_worlds_that_no_policy_fits_both_of_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"real: takes actions of -2 to 2, the simulator of -1 to 1;"):
        check_alike(CART.layout, replace(CART.layout, ranges=((-2.0, 2.0),)))
    with pytest.raises(ConfigError, match="real: has 4 states, the simulator 2"):
        check_alike(CART.layout, POLE.layout)
    with pytest.raises(ConfigError, match=r"real: acts every 0\.05 s, the simulator every 0\.02 s"):
        check_alike(POLE.layout, replace(POLE.layout, control_period=0.05))
    worlds = ("sim.env_id=examples.cart:Cart", "real.env_id=CartPole-v1")
    assert "has 4 states" in refused("iterate", "experiment=gymnasium", *worlds, folder=tmp_path)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("optimize world=gymnasium world.env_id=examples.cart:Cart task=own_reward grounding=none "
         "policy=mlp optimizer=policy_iteration", "policy: policy iteration improves an action_table"),
        ("optimize world=gymnasium world.env_id=examples.cart:Cart task=own_reward grounding=none "
         "policy=action_table", "policy: needs a world whose states and actions are discrete"),
        ("optimize world=gymnasium world.env_id=CartPole-v1 task=own_reward grounding=none policy=action_table",
         "policy: needs a world whose states and actions are discrete"),
        ("optimize policy=mlp grounding=none", "policy: acts on the state of a gymnasium environment"),
        ("optimize world=gymnasium world.env_id=CartPole-v1 task=own_reward grounding=ane policy=mlp",
         "grounding: its noise is for actions that are numbers"),
        ("collect world=gymnasium world.env_id=CartPole-v1 policy=mlp workers=1",
         "task: needs base.position, which this world does not observe"),
        ("collect world=cliff_walking task=own_reward policy=action_table action_noise=1.5",
         "action_noise = 1.5: is the chance of a random choice here"),
        ("collect world=gymnasium task=own_reward policy=mlp", "world.env_id: has no value"),
    ],
)  # fmt: skip
def test_what_does_not_go_together_is_refused(arguments: str, line: str, tmp_path: Path) -> None:
    assert refused(*arguments.split(), folder=tmp_path).startswith(line)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"rested": True}, "model.rested: is of a robot"),
        ({"variables": (0, 2)}, "model.variables = 2: the state has entries 0 to 1"),
        ({"horizon": 2}, "model.horizon: is for robots"),
        ({"members": 3}, "model.members: is for robots"),
        ({"multi_step": 3}, "model.multi_step: is for robots"),
    ],
)
def test_models_that_an_environment_cannot_have(changes: dict[str, Any], line: str, tmp_path: Path) -> None:
    parts = Parts(*(episodes(CART, 2, 0.5) for _ in range(3)))
    with pytest.raises(ConfigError) as caught:
        forward_of_states(tmp_path, parts, ModelConfig("mlp", **changes), 1)
    assert str(caught.value).startswith(line)


def test_joints_of_an_environment_cannot_be_grounded(tmp_path: Path) -> None:
    f, f_inv = models(tmp_path, CART, CART)
    grounding = ActionTransformation("f", "i", x=("elbow",))
    with pytest.raises(ConfigError, match="x: names joints of a robot"):
        grounding.load(lambda _: f, lambda _: f_inv)


def test_the_version_of_an_id_that_names_none_is_in_the_log(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", logger="gsl"), warnings.catch_warnings(action="error"):
        GymnasiumWorld(env_id="CartPole")
    assert "CartPole is CartPole-v1" in caplog.messages


def test_batches_that_leave_a_part_of_a_rollout_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"optimizer\.batch = 100: must divide the rollout of 2048"):
        Trpo(steps=10, batch=100)
    with pytest.raises(ConfigError, match=r"optimizer\.envs = 3: must divide"):
        Trpo(steps=10, envs=3)


WITHOUT_NOISE = ("~methods.ane_02", "~methods.ane_04", "~methods.ane_06")


def test_figure_12_is_one_command(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("sb3_contrib")
    few = ("trials=1", "noises=[0.3]", "workers=1", "iterate.budget.real_episodes=6", "iterate.budget.sim_episodes=8")
    few += (*OF_TRIALS, *BRIEF)
    said = done("reproduce", "fig12", "preset=toy", *few, "iterate.budget.episodes=3", *WITHOUT_NOISE, folder=tmp_path)
    folder = tmp_path / "runs/fig12/reproduce"
    points = json.loads((folder / "points.json").read_text())
    assert [point["method"] for point in points] == ["none", "gat", "sgat", "trained on real"]
    assert all(point["value"] > 1.0 for point in points)
    assert 0 == points[0]["real_steps"] < points[1]["real_steps"] == points[2]["real_steps"]
    for shared in ("collect_real", "collect_sim", "train_inverse"):
        assert len(list((tmp_path / "runs/fig12").rglob(shared))) == 1
    assert (folder / "figure.png").stat().st_size > 10_000
    assert "trained on real" in said.out
    settings = ("known=runs/fig12/points.json", "name=again", "preset=toy", *few, "iterate.budget.episodes=3")
    done("reproduce", "fig12", *settings, *WITHOUT_NOISE, folder=tmp_path)
    again = tmp_path / "runs/again/reproduce"
    assert (again / "table.md").read_bytes() == (folder / "table.md").read_bytes()
    assert not list((tmp_path / "runs/again").rglob("trial_01"))


def test_figure_13_is_one_command(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("sb3_contrib")
    few = ("trials=1", "workers=1", "iterate.budget.real_episodes=3", "iterate.budget.sim_episodes=3", "~methods.sgat")
    few += (*OF_TRIALS, *BRIEF)
    few += ("iterate.budget.episodes=1", "iterate.budget.rollouts=1")
    left = ("noises=[0.6]", "~methods.ane_02", "~methods.ane_06", "~worlds.noisy")
    done("reproduce", "fig13", "preset=toy", *few, *left, folder=tmp_path)
    folder = tmp_path / "runs/fig13/reproduce"
    points = json.loads((folder / "points.json").read_text())
    assert [point["method"] for point in points] == ["none", "gat", "trained on real"]
    assert all(
        point["real_steps"] > 0 and np.isfinite(point["promised"]) for point in points if point["method"] != "none"
    )
    table = (folder / "table.md").read_text()
    assert "±" not in table.splitlines()[2] and " -> " in table  # one trial has no standard error
    assert (folder / "figure.png").stat().st_size > 10_000


def test_rounds_go_on_from_what_the_real_world_chose(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("sb3_contrib")
    few = ("trials=1", "workers=1", "iterate.budget.real_episodes=3", "iterate.budget.sim_episodes=3", "~methods.sgat")
    few += (*OF_TRIALS, *BRIEF)
    few += ("iterate.budget.episodes=2", "iterate.budget.rollouts=1", "iterate.budget.confirmation=3")
    left = (
        "~methods.ane",
        *(f"~{kind}.{name}_heavy" for kind in ("worlds", "sims") for name in ("hopper", "walker2d")),
    )
    left += ("further.generations=2",)
    done("reproduce", "garat", "preset=toy", *few, *left, folder=tmp_path)
    runs = tmp_path / "runs/garat"
    points = [Point(**_known(row)) for row in json.loads((runs / "reproduce/points.json").read_text())]
    methods = ["none", "gat", "trained on real"]
    assert [(point.method, point.round) for point in points] == [*product(methods, (1, 2))]
    place = runs / "inverted_pendulum_heavy_0/gat/trial_01"
    first, second = _read(place / "evaluate"), _read(place / "iteration_02/evaluate")
    _, _, first_round, two, *_ = points
    assert first_round.value == first["returned"]["value"] and two.value == second["returned"]["value"]
    assert second["baseline"]["episodes"] == 3 and second["policies"] == 2
    collected = [runs / "inverted_pendulum_heavy_0/models/trial_01/collect_real", place / "iteration_02/collect_real"]
    steps = [_read(at)["steps"] for at in collected]
    assert (first_round.real_steps, two.real_steps) == (steps[0], sum(steps))
    assert 0 < first_round.choice_steps < two.choice_steps
    text = (place / "iteration_02/train_forward/config.yaml").read_text()
    assert str(collected[0].relative_to(tmp_path)) in text  # aggregate=true
    assert str((place / "evaluate").relative_to(tmp_path)) in (place / "iteration_02/optimize/config.yaml").read_text()
    searches = [str(at.parent.relative_to(runs)) for at in runs.rglob("optimize") if "none" in at.parts]
    assert sorted(searches) == ["inverted_pendulum_heavy_0/none/trial_01/iteration_02", "sim/none/trial_01"]
    table = (runs / "reproduce/table.md").read_text()
    assert "2 real episodes" in table and "Values are of 3 other episodes." in table and "| 0 | 2 |" in table


def _known(row: dict[str, Any]) -> dict[str, Any]:
    return {name: row[name] for name in Point._fields}


def _read(artifact: Path) -> dict[str, Any]:
    return json.loads((artifact / "metrics.json").read_text())


def test_rounds_are_refused_where_nothing_would_come_of_them(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("sb3_contrib")
    for asked, said in {
        ("fig12", "iterate.iterations=2"): "iterate.iterations = 2: several need choice=real",
        ("garat", "~methods.gat", "~methods.sgat"): "iterate.aggregate = true: is for a grounding that learns",
        ("garat", "iterate.budget.tolerated=0.5"): "iterate.budget.check = 1: needs two episodes",
    }.items():
        result = gsl("reproduce", *asked, folder=tmp_path)
        assert result.code == 2 and result.lines[-1].startswith(f"gsl reproduce {asked[0]}: {said}")
    assert not list(tmp_path.iterdir())


def test_figure_12_goes_on_with_a_search_instead(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("sb3_contrib")
    few = ("trials=1", "noises=[0.3]", "workers=1", "iterate.budget.real_episodes=6", "iterate.budget.sim_episodes=8")
    few += (*OF_TRIALS, BRIEF[0])
    search = ("optimizer@further=cma_es", "further.candidates=4", "further.generations=1", "iterate.budget.rollouts=2")
    settings = (*WITHOUT_NOISE, "~methods.gat", "iterate.policy.hidden=[]", "iterate.budget.episodes=3")
    said = done("reproduce", "fig12", "preset=toy", *few, *search, *settings, folder=tmp_path)
    points = json.loads((tmp_path / "runs/fig12/reproduce/points.json").read_text())
    assert [point["real_steps"] is None for point in points] == [False, False, True]
    assert "the reference learned from 8 episodes" in (tmp_path / "runs/fig12/reproduce/table.md").read_text()
    assert "trained on real" in said.out


def test_without_the_extra_a_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    policy = a_policy(CART)
    simulator = GroundedSimulator(Scenario(CART, OwnReward(), policy, "sim", NoGrounding()), policy.initial)
    with pytest.raises(ConfigError, match=r"TRPO needs gsl\[rl\]: pip install 'gsl\[rl\]'"):
        next(iter(Trpo(steps=10).learn(simulator, policy, policy.initial, 1, bold=True, advance=print)))


def test_remarks_on_a_model_are_neither_on_the_terminal_nor_in_a_file_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    mujoco = pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    before = mujoco.get_mju_user_warning()
    assert GymnasiumWorld("HalfCheetah-v5").layout.states == 17
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())
    assert mujoco.get_mju_user_warning() is before


def test_without_mujoco_a_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith(("mujoco", "gymnasium.envs.mujoco"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ConfigError, match=r"gsl\[mujoco\]"):
        GymnasiumWorld(env_id="InvertedPendulum-v5").make()


def test_what_is_wrong_in_one_of_two_worlds_is_told_by_its_name(tmp_path: Path) -> None:
    worlds = ("experiment=gymnasium", "sim.env_id=CartPole-v1")
    line = refused("iterate", *worlds, "real.env_id=MyOwn-v0", folder=tmp_path)
    assert line.startswith("real.env_id = MyOwn-v0: there is no such environment")
    assert line.endswith("one that a module of yours registers is module:id")
    alike = (*worlds, "real.env_id=CartPole-v1")
    assert refused("iterate", *alike, "real.masss=3", folder=tmp_path).endswith(
        "did you mean real.mass or real.kwargs?"
    )
    variables = refused("iterate", *alike, "forward_model.variables=[0,7]", folder=tmp_path)
    assert variables == "forward_model.variables = 7: the state has entries 0 to 3"  # before anything is collected


def test_help_is_of_the_world_that_is_typed(tmp_path: Path) -> None:
    output = done("iterate", "experiment=gymnasium", "--help", folder=tmp_path).out
    assert "env_id" in output and "gymnasium*" in output
    assert "env_id" not in done("iterate", "--help", "real.no_such=1", folder=tmp_path).out


@pytest.mark.parametrize(
    ("real", "grounded", "line"),
    [
        ([-50.0, -51.0, -52.0], -50.5, "significantly nearer to what it is worth on the real side"),
        ([-50.0, -51.0, -52.0], -45.5, "worth on the real side, and π0 is still significantly worth more in it"),
        ([-50.0, -51.0, -52.0], -56.5, "worth on the real side, and π0 is still significantly worth less in it"),
        ([-20.0, -21.0, -22.0], -50.5, "significantly farther"),
        ([-50.0, -20.0, -30.0], -35.0, "held-out real episodes do not show"),
        ([-50.0], -50.5, "is no measure"),
    ],
)
def test_a_check_says_whether_a_grounding_is_nearer(real: list[float], grounded: float, line: str) -> None:
    around = np.linspace(-1.0, 1.0, 5)
    values = {"real": np.array(real), "grounded": grounded + around, "ungrounded": around - 20.0}
    sentence = ValueReport(values, values).sentence
    assert line in sentence and ("still" in sentence) == ("still" in line)


def test_values_that_are_all_alike_are_not_taken_for_certain() -> None:
    seldom = np.repeat([1.0, 0.0], [5, 195])  # ten zeros are the rule there
    report = ValueReport(dict.fromkeys(("grounded", "ungrounded"), np.zeros(10)) | {"real": seldom}, {})
    assert "200 held-out real episodes do not show" in report.sentence
    assert "still" not in report.sentence
