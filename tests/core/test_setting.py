"""A setting is declared once and read by validation, help and searches."""

from typing import Annotated, Literal

import pytest

from gsl.core.setting import REQUIRED, component, setting, settings_of
from gsl.core.validation import did_you_mean, make
from gsl.errors import ConfigError


@component
class Play:
    width: Annotated[float, setting("full width", unit="rad", source="data sheet", ge=0, upper=0.1)]
    count: Annotated[int, setting("how many", gt=0, le=9)] = 3
    side: Literal["upper", "lower"] = "upper"
    joints: tuple[str, ...] = ("all",)


def test_everything_declared_can_be_read_back() -> None:
    settings = settings_of(Play)
    width, count = settings["width"], settings["count"]
    assert (width.default, width.meaning, width.unit, width.source) == (REQUIRED, "full width", "rad", "data sheet")
    assert (width.lower, width.upper) == (0, 0.1)
    assert (count.default, count.lower, count.upper) == (3, 0, 9)
    assert list(settings) == ["width", "count", "side", "joints"]


def test_any_function_has_settings_too() -> None:
    def world(period: float, steps: int = 4) -> None: ...

    assert {name: option.default for name, option in settings_of(world).items()} == {"period": REQUIRED, "steps": 4}


def test_values_beyond_the_documented_range_are_accepted() -> None:
    assert Play(width=0.5).width == 0.5


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"width": -1}, "effects.play.width = -1: must be at least 0 (rad)"),
        ({"width": "wide"}, "effects.play.width = wide: must be a number (rad)"),
        ({"width": float("nan")}, "effects.play.width = nan: must be a finite number (rad)"),
        ({"widht": 1}, "effects.play.widht: no such setting; did you mean width?"),
        ({}, "effects.play.width: has no value (rad)"),
        ({"width": 1, "count": "four"}, "effects.play.count = four: must be a whole number"),
        ({"width": 1, "count": 0}, "effects.play.count = 0: must be above 0"),
        ({"width": 1, "side": "left"}, "effects.play.side = left: must be one of 'upper' or 'lower'"),
        ({"width": 1, "joints": 3}, "effects.play.joints = 3: must be a list"),
    ],
)
def test_a_wrong_value_is_one_line_with_path_value_and_rule(values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError) as error:
        make(Play, values, where="effects.play")
    assert str(error.value) == message


def test_an_error_can_be_seen_from_further_out() -> None:
    with pytest.raises(ConfigError) as error:
        make(Play, {"width": -1}, where="effects.play")
    assert str(error.value.under("world")).startswith("world.effects.play.width = -1")


def test_a_near_word_is_suggested_and_otherwise_all_are_listed() -> None:
    assert did_you_mean("wold", ["world", "task"]) == "; did you mean world?"
    assert did_you_mean("x", ["world", "task"]) == "; there is task, world"
    assert did_you_mean("wold", ["world", "task"], listed=True) == "; did you mean world? There is task, world"
    assert did_you_mean("x", []) == ""
