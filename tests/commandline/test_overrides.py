"""Short forms on the command line become hydra's own."""

import pytest

from gsl.commandline.overrides import effect_path, key_of, rewrite
from gsl.errors import ConfigError

CHOSEN = ("preset", "task", "world", "world@sim", "world@real")


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("episodes=50", "episodes=50"),
        ("world=nao_worn", "world=nao_worn"),
        ("sim=nao_ideal", "world@sim=nao_ideal"),
        ("real=nao_worn,nao_weak", "world@real=nao_worn,nao_weak"),
        ("sim.control_period=0.01", "sim.control_period=0.01"),
        ("world@sim=nao_ideal", "world@sim=nao_ideal"),
        ("world.effects.backlash.width=0.02", "++world.effects.backlash.width=0.02"),
        ("real.effects.backlash={width: 0.02}", "++real.effects.backlash={width: 0.02}"),
        ("sim.effects.backlash.joints=[LKneePitch]", "++sim.effects.backlash.joints=[LKneePitch]"),
        ("+world.effects.backlash.width=1", "+world.effects.backlash.width=1"),
        ("~world.effects.backlash", "~world.effects.backlash"),
        ("experiment=arm", "+experiment=arm"),
        ("+experiment=arm", "+experiment=arm"),
        ("force=true", "++force=true"),
        ("out=runs/a=b", "++out=runs/a=b"),
        ("task=walk", "task=walk"),
    ],
)
def test_an_argument_becomes_what_hydra_wants(typed: str, expected: str) -> None:
    assert rewrite([typed], CHOSEN) == [expected]


@pytest.mark.parametrize("typed", ["methods=none,ane", "methods=[none, ane]", "methods='[none,ane]'"])
def test_a_list_of_methods_leaves_those_and_adds_what_is_new(typed: str) -> None:
    chosen = ("grounding@methods.none", "grounding@methods.gat", "world@worlds.nao_worn", "world@sim")
    once = rewrite([typed], chosen)
    assert once == ["~methods.gat", "+grounding@methods.ane=ane"]
    assert rewrite(once, chosen) == once
    assert rewrite(["worlds=nao_worn"], chosen) == []
    assert rewrite(["methods={none: 1}"], chosen) == ["methods={none: 1}"]


def test_an_experiment_of_the_defaults_list_is_an_ordinary_choice() -> None:
    assert rewrite(["experiment=arm"], [*CHOSEN, "experiment"]) == ["experiment=arm"]


def test_a_role_the_command_does_not_have_is_left_for_hydra_to_refuse() -> None:
    assert rewrite(["sim=nao_ideal"], ["world"]) == ["sim=nao_ideal"]


def test_an_argument_without_a_value_is_refused() -> None:
    with pytest.raises(ConfigError, match="episodes: has no value; write key=value"):
        rewrite(["episodes"], CHOSEN)


def test_rewriting_twice_changes_nothing_more() -> None:
    once = rewrite(["sim=a", "sim.effects.x.y=1", "experiment=arm", "force=true", "n=1"], CHOSEN)
    assert rewrite(once, CHOSEN) == once


@pytest.mark.parametrize(
    ("key", "path"),
    [
        ("world.effects.backlash.width", "world.effects.backlash"),
        ("effects.backlash", "effects.backlash"),
        ("world.effects", ""),
        ("side_effects.backlash", ""),
        ("methods.effects.inner", ""),
        ("methods.effects.effects.backlash.width", "methods.effects.effects.backlash"),
    ],
)
def test_the_path_of_an_effect_is_found_in_a_key(key: str, path: str) -> None:
    assert effect_path(key) == path


def test_the_key_is_what_stands_before_the_first_equals_sign() -> None:
    assert [key_of(override) for override in ("a=b=c", "++a.b=1", "~a")] == ["a", "a.b", "a"]
