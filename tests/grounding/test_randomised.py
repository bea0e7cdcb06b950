"""Domain randomisation: every episode is in another world, the same one for the same seed."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenarios import QUIET, walk

from gsl.effects.effect import list_documented
from gsl.errors import ConfigError, Refused
from gsl.grounding.none import NoGrounding
from gsl.grounding.randomised import Draw, RandomisedEffects, randomise
from gsl.robots.catalogue import robot
from gsl.validation.check_grounding import check_grounding
from gsl.validation.gate import Gate
from gsl.worlds.bullet import BulletWorld

WORLD = BulletWorld(robot="nao", effects={"coulomb_friction": {"torque": 0.1}}, floating=False, settle=0.0)
SETTINGS = RandomisedEffects()


def last_positions(env: object, seed: int) -> np.ndarray:
    env.reset(seed=seed)  # type: ignore[attr-defined]
    target = np.full(15, 0.2)
    for _ in range(10):
        seen, *_ = env.step(target)  # type: ignore[attr-defined]
    return seen[:15]


def test_an_episode_is_a_function_of_its_seed_whatever_came_before() -> None:
    made = pickle.loads(pickle.dumps(randomise(WORLD, SETTINGS, 0.5)))
    env, other = made.make(), made.make()
    first, second = last_positions(env, 1), last_positions(env, 2)
    assert np.abs(first - second).max() > 1e-4
    np.testing.assert_array_equal(last_positions(other, 2), second)
    env.close()
    other.close()


def test_a_draw_stays_within_its_share_of_the_documented_ranges_and_reaches_its_ends() -> None:
    width, rng = 0.4, np.random.default_rng(0)
    own = replace(robot("nao"), ranges={"command_latency": {"delay": (0.0, 0.2)}})
    drawn = [Draw(SETTINGS.effects, width, own)(rng) for _ in range(400)]
    assert max(draw["command_latency"]["delay"] for draw in drawn) > 0.07  # of .08
    for name in SETTINGS.effects:
        for key, option in list_documented(name, own).items():
            if option.neutral is None:
                continue
            values = np.array([draw[name][key] for draw in drawn])
            low, high = (option.neutral + width * (end - option.neutral) for end in (option.lower, option.upper))
            assert low <= values.min() < low + 0.02 * (high - low), name
            assert high - 0.02 * (high - low) < values.max() <= high, name


def test_what_the_world_has_already_stays() -> None:
    effects = randomise(WORLD, RandomisedEffects(("command_latency",)), 0.5).world.effects
    assert effects == WORLD.effects


@pytest.mark.parametrize("name", ["uneven_grund", "ground_compliance"])
def test_effects_that_cannot_be_drawn_are_refused(name: str) -> None:
    with pytest.raises(ConfigError, match=r"effects"):
        RandomisedEffects((name,))


def test_a_world_without_effects_is_refused() -> None:
    with pytest.raises(ConfigError, match="only Bullet worlds"):
        randomise(NoGrounding(), SETTINGS, 0.5)


def test_a_width_in_which_pi0_falls_is_refused_even_if_it_is_the_least(tmp_path: Path) -> None:
    scenario = walk(duration=2.0)
    scenario = replace(scenario, world=replace(scenario.world, effects={"torque_limit": {"factor": 0.05}}))
    gate = Gate(scenario.policy.initial, tmp_path, QUIET, False, 1)
    for width, least in ((1.0, 100), ("auto", 8)):
        drawn = replace(scenario, grounding=RandomisedEffects(("gravity_tilt",), width=width))
        with pytest.raises(Refused, match=rf"π0 falls in 4 of 4 episodes that draw from {least} % of the documented"):
            check_grounding(drawn, gate)
    _, about = check_grounding(drawn, replace(gate, accept=True))
    assert about == {"width": 0.08, "grounding_acceptable": False}
    assert not json.loads((tmp_path / "grounding.json").read_text())["acceptable"]


def test_a_width_of_ones_own_is_the_only_one_tried() -> None:
    assert replace(SETTINGS, width=0.3).widths == (0.3,)
    assert SETTINGS.widths[0] == 1.0
    assert list(SETTINGS.widths) == sorted(SETTINGS.widths, reverse=True)
