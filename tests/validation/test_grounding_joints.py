"""Which joints to ground: those alone in which the grounding brings the simulator nearer to the robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gsl.core.history import History
from gsl.errors import ConfigError, InputError
from gsl.grounding.gat import ActionTransformation, LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.models.forward import ForwardModel
from gsl.models.inverse import Solver
from gsl.models.network import Network
from gsl.policies.walk_engine import WalkEngine
from gsl.rollout.rollout import Scenario, rollout
from gsl.tasks.walk import Walk
from gsl.validation.fewest_joints import fewest
from gsl.validation.replay import Place, places
from gsl.worlds.bullet import BulletWorld

SIM = BulletWorld(robot="nao", effects={}, floating=False, settle=0.1)
JOINTS, OFF = SIM.layout.joints, 0.05
BENT = ("LKneePitch", "RAnklePitch")


def pushed(push: float = OFF) -> LoadedTransformation:
    """Every joint is sent `push` [rad] beyond the agent's action."""
    size, n = History(0).size(len(JOINTS)), len(JOINTS)
    nets = [Network([(np.zeros((n, size)), np.full(n, value))]) for value in (push, 0.0)]
    f, simulator = (ForwardModel(net, History(0), JOINTS) for net in nets)
    return LoadedTransformation(f, Solver(simulator, np.eye(n), 1e-9))


def starts(*bent: str) -> list[Place]:
    """Replays of a robot some of whose joints go beyond their targets."""
    real = replace(SIM, effects={"zero_offset": [{"offset": OFF, "joints": joint} for joint in bent]})
    policy = WalkEngine()
    scenario = Scenario(real, Walk(duration=1.5), policy, "real", NoGrounding())
    env = scenario.make()
    episodes = [rollout(scenario, env, policy.initial, seed) for seed in (1, 2)]
    env.close()
    return places(episodes, SIM.layout, 12)


def test_only_the_joints_that_differ_are_grounded() -> None:
    env = SIM.make()
    assert fewest(env, pushed(), starts(*BENT), 1) == BENT
    env.close()


def test_where_grounding_helps_nowhere_nothing_is_grounded() -> None:
    env = SIM.make()
    assert fewest(env, pushed(), starts(), 1) == ()
    env.close()


def test_without_a_trajectory_there_is_nothing_to_choose_on() -> None:
    with pytest.raises(InputError, match=r"grounding\.x=all"):
        fewest(None, pushed(), [], 1)


def test_the_other_joints_are_sent_the_agents_actions() -> None:
    run = replace(pushed(), x=BENT).start(SIM.layout, np.random.default_rng(0))
    action = np.full(len(JOINTS), 0.1)
    sent = run.transform(np.zeros(SIM.layout.size), action)
    np.testing.assert_allclose(sent - action, [OFF if joint in BENT else 0.0 for joint in JOINTS], atol=1e-6)


def test_an_unknown_joint_is_refused() -> None:
    settings = ActionTransformation(forward_model="f", inverse_model="i", x=("LKneePich",))
    with pytest.raises(ConfigError, match="did you mean LKneePitch"):
        settings.load(lambda _: pushed().forward, lambda _: pushed().inverse)
