"""Effects whose values lie far from their documented ranges: often a slip."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gsl.core.body import Robot
from gsl.core.setting import Setting
from gsl.core.slides import power, unit_of_slide
from gsl.effects.effect import build, name_of, narrow_settings

FAR = 3.0  # widths of a documented range; no value of a world that comes with gsl lies 2 from it


def list_unusual(effects: Mapping[str, Any], robot: Robot) -> Iterator[str]:
    """Yield a line on each value that lies far from its documented range, of joints that slide in metres."""
    for effect in build(effects):
        name, where = name_of(effect), getattr(effect, "joints", ())
        joints = [robot.joint(joint) for joint in robot.list_joints(where)] if where else []
        sizes = [joint.size for joint in joints] if all(joint.slides for joint in joints) else []
        for key, about in narrow_settings(type(effect), robot.ranges.get(name, {})).items():
            value = getattr(effect, key)
            if about.lower is None or about.upper is None or not isinstance(value, int | float):
                continue
            lower, upper, unit = _in_metres(about, sizes)
            if max(lower - value, value - upper) > FAR * (upper - lower):
                usual = f"{lower:g} to {upper:g} {unit}".rstrip()
                yield f"effects.{name}.{key} = {value:g}: far from its documented range, {usual}"


def _in_metres(about: Setting, sizes: list[float]) -> tuple[float, float, str]:
    """Return a range and its unit for slides of some sizes, what counts as a radian of them [m]; as it is for none."""
    assert about.lower is not None and about.upper is not None
    if not sizes:
        return about.lower, about.upper, about.unit
    ends = [end * size ** -power(about.unit) for end in (about.lower, about.upper) for size in sizes]
    return min(ends), max(ends), unit_of_slide(about.unit)
