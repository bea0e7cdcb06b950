"""A setting is one validated parameter that says its meaning, unit, source and documented range, once for all readers.

    @component
    class Backlash:
        width: Annotated[float, setting("full width of the play", unit="rad", ge=0, lower=0.0, upper=0.1)]

Validation, help text, random draws and search ranges all read it from there.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, dataclass_transform, get_args, get_origin, get_type_hints

from pydantic import ConfigDict, Field, ValidationInfo, field_validator
from pydantic.dataclasses import dataclass as validated_dataclass
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

REQUIRED: Any = "???"
"""Default of a setting that has none; yaml files write it the same way."""

FIELDS = "__pydantic_fields__"


def setting(
    meaning: str,
    *,
    unit: str = "",
    source: str = "",
    lower: float | None = None,
    upper: float | None = None,
    **bounds: Any,
) -> FieldInfo:
    """Describe a field inside `Annotated`; the default stays on the field itself.

    Args:
        meaning: A few words a user understands, without a full stop.
        unit: SI unit such as `rad` or `N·m`; empty for a pure number.
        source: Where the documented range comes from.
        lower: Lower end of the documented range (random draws, searches); values beyond it are still accepted.
        upper: Upper end of the documented range.
        **bounds: What is impossible and refused: pydantic's `ge`, `gt`, `le`, `lt`, `min_length`, `pattern`, ...
    """
    extra: dict[str, Any] = {"unit": unit, "source": source, "lower": lower, "upper": upper}
    field: FieldInfo = Field(description=meaning, json_schema_extra=extra, **bounds)
    return field


MOST = 2**63 - 1  # of a whole number, which libraries in C keep in 64 bits


@dataclass_transform(frozen_default=True, field_specifiers=(Field,))
def component(cls: type) -> Any:
    """Make a class a frozen dataclass that checks its fields and refuses unknown ones.

    Fields may have any type; one that is a `Protocol` has to be `runtime_checkable`.
    """
    config = ConfigDict(extra="forbid", arbitrary_types_allowed=True, allow_inf_nan=False)
    cls._check_number = field_validator("*", mode="before")(_check_number)  # type: ignore[attr-defined]
    return validated_dataclass(frozen=True, config=config)(cls)


def _check_number(cls: Any, value: Any, about: ValidationInfo) -> Any:
    """Refuse true and false where a number is due, other words where they are due, and counts that no library takes."""
    kind = cls.__pydantic_fields__[about.field_name].annotation
    if isinstance(value, bool) and kind in (int, float):
        raise PydanticCustomError("truth_value", "Input should be a number")
    if kind is bool and isinstance(value, str) and value.lower() not in ("true", "false"):
        raise PydanticCustomError("bool_parsing", "Input should be true or false")
    if kind is int and isinstance(value, int) and value > MOST:
        raise PydanticCustomError("less_than_equal", "Input is too large", {"le": MOST})
    return value


@dataclass(frozen=True)
class Setting:
    """What is known of one parameter of a class or function.

    Attributes:
        name: The field's name.
        default: Its default, `REQUIRED` if it has none.
        meaning: A few words, empty where none were given.
        unit: SI unit, empty for a pure number.
        source: Where the documented range comes from.
        lower: Lower end of the documented range, or else the least possible value, or None.
        upper: Upper end, likewise.
        most: Greatest possible value, or None.
        named: Whether it may be a mapping whose names nobody declares, such as the arguments of an environment.
        text: Whether a single value of it is a text, whatever it looks like: a folder may be called 20.
    """

    name: str
    default: Any = REQUIRED
    meaning: str = ""
    unit: str = ""
    source: str = ""
    lower: float | None = None
    upper: float | None = None
    most: float | None = None
    named: bool = False
    text: bool = False

    @property
    def neutral(self) -> float | None:
        """The value of a strength that does nothing: the default, or 0 or 1 where there is none; None of a shape."""
        if self.lower is None or self.upper is None:
            return None
        possible = (0.0, 1.0) if self.default is REQUIRED or self.default is None else (self.default,)
        return next((value for value in possible if value in (0.0, 1.0) and self.lower <= value <= self.upper), None)


def settings_of(target: Callable[..., Any]) -> Mapping[str, Setting]:
    """Return the settings of a component in order; of any other class or function, the names and defaults."""
    fields: Mapping[str, FieldInfo] = getattr(target, FIELDS, {})
    parameters = inspect.signature(target).parameters.values()
    named = [
        parameter for parameter in parameters if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
    ]
    return {parameter.name: _describe(parameter, _field(target, parameter.name, fields)) for parameter in named}


def parts_of(target: Callable[..., Any]) -> Mapping[str, type]:
    """Return the fields of a component that are components themselves, by name."""
    fields: Mapping[str, FieldInfo] = getattr(target, FIELDS, {})
    kinds = {name: field.annotation for name, field in fields.items()}
    return {name: kind for name, kind in kinds.items() if isinstance(kind, type) and hasattr(kind, FIELDS)}


def _field(target: Callable[..., Any], name: str, fields: Mapping[str, FieldInfo]) -> FieldInfo | None:
    if name in fields:
        return fields[name]
    try:
        hint = get_type_hints(target, include_extras=True).get(name) if isinstance(target, type) else None
    except NameError:  # a class that imports its types for the type checker only
        hint = None
    return next((part for part in getattr(hint, "__metadata__", ()) if isinstance(part, FieldInfo)), None)


def _describe(parameter: inspect.Parameter, field: FieldInfo | None) -> Setting:
    default = REQUIRED if parameter.default is parameter.empty else parameter.default
    if field is None:
        return Setting(parameter.name, default)
    if field.default_factory is not None:
        default = field.get_default(call_default_factory=True, validated_data={})
    kinds = (field.annotation, *get_args(field.annotation))
    extra: Mapping[str, Any] = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    return Setting(
        parameter.name,
        default,
        field.description or "",
        str(extra.get("unit", "")),
        str(extra.get("source", "")),
        _first(extra.get("lower"), _bound(field, "ge"), _bound(field, "gt")),
        _first(extra.get("upper"), _bound(field, "le"), _bound(field, "lt")),
        _bound(field, "le"),
        any(map(_maps_names, kinds)),
        str in kinds and not {int, float, bool, Any} & {*kinds},
    )


def _maps_names(kind: Any) -> bool:
    """Whether it is a mapping by names, and not one of components, each of which says its class."""
    return get_origin(kind) in (Mapping, dict) and not getattr(get_args(kind)[1], "_is_protocol", False)


def _bound(field: FieldInfo, name: str) -> float | None:
    return _first(*(getattr(constraint, name, None) for constraint in field.metadata))


def _first(*values: float | None) -> float | None:
    return next((value for value in values if value is not None), None)
