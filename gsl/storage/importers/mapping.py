"""A mapping says where in a foreign log each signal of the trajectory contract is, in which unit and on which clock."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import field
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BeforeValidator

from gsl.core.likeness import find_alike
from gsl.core.other_commands import OTHER_COMMANDS
from gsl.core.setting import component, setting
from gsl.core.validation import did_you_mean, make
from gsl.effects.effect import build
from gsl.errors import ConfigError
from gsl.storage.importers.signal import AXES, BY_NAME, COMMANDS, KNOWN, NEEDED, Signal, Time
from gsl.storage.importers.units import factor, is_length
from gsl.storage.trajectory_contract import INTEGERS, SHORTEST, UNITS, suggestion

T = TypeVar("T")
TAKEN = (*INTEGERS, "time", "reward", "fell", "terminated", "state", "next_state")


def _time(value: Any) -> Time:
    if isinstance(value, Time):
        return value
    return _make(Time, {"column": value} if isinstance(value, str) else value, "time")


def _joints(value: Any) -> Any:
    """Return names of joints as texts, where some are whole numbers."""

    def text(entry: Any) -> Any:
        return str(entry) if isinstance(entry, int) and not isinstance(entry, bool) else entry

    if isinstance(value, dict):
        return {text(name): text(entry) for name, entry in value.items()}
    return [text(entry) for entry in value] if isinstance(value, list) else value


def _signals(value: Any) -> dict[str, Signal]:
    return {str(name): _signal(signal, f"signals.{name}") for name, signal in _dictionary(value, "signals").items()}


def _signal(value: Any, where: str) -> Signal:
    if isinstance(value, Signal):
        return value
    alone = isinstance(value, str | int | list) and not isinstance(value, bool)
    return _make(Signal, {"column": value} if alone else value, where)


def _make(kind: Callable[..., T], value: Any, where: str) -> T:
    try:
        return make(kind, _dictionary(value, ""))
    except ConfigError as error:
        raise error.under(where) from error


def _dictionary(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ConfigError(where, "must be settings such as {column: ..., unit: ...}", given=str(value))
    return value


@component
class Mapping:
    """What `gsl import` needs to know of a kind of log."""

    signals: Annotated[
        dict[str, Signal], setting("where each signal is: a column, or {column, unit, ...}"), BeforeValidator(_signals)
    ]
    joints: Annotated[
        list[str] | dict[str, str] | None,
        setting("names in order, or {name: name or number in the log}; found if null"),
        BeforeValidator(_joints),
    ] = None
    robot: Annotated[str, setting("whose log it is")] = "unknown"
    source: Annotated[str | None, setting("where the logs lie, if source= does not say")] = None
    files: Annotated[
        str | dict[str, str] | None, setting("pattern of the files; {role: name} if an episode is a folder of several")
    ] = None
    episode: Annotated[str, setting("file, or the column whose value tells episodes apart", min_length=1)] = "file"
    records: Annotated[str, setting("JSON: path of the list of rows; HDF5: a group, or data/demo_* for many")] = ""
    time: Annotated[Time, setting("the stamps: {column, unit}, or {period}"), BeforeValidator(_time)] = Time()  # noqa: RUF009  it is frozen
    period: Annotated[
        float | None, setting("resample to it; null keeps the rows as they are", unit="s", ge=SHORTEST)
    ] = None
    command_offset: Annotated[float, setting("what the commands' clock is ahead of the sensors'", unit="s")] = 0.0
    synchronised: Annotated[bool, setting("whether commands and sensors share a clock, or the offset is known")] = True
    longest_gap: Annotated[float, setting("periods without a row, above which an episode is cut in two", gt=1)] = 10.0
    duplicates: Annotated[Literal["refuse", "drop"], setting("what to do with a stamp that comes twice")] = "refuse"
    blanks: Annotated[Literal["refuse", "skip"], setting("whether an empty cell is a mistake, or no news")] = "refuse"
    unwrap: Annotated[bool, setting("join angles that jump by a turn, or by the range of their encoder")] = False
    glitches: Annotated[
        Literal["keep", "mend"], setting("what to do with positions that jump for one sample: mend interpolates")
    ] = "keep"
    angles: Annotated[
        Literal["deg", "rad", "percent"] | None,
        setting("LeRobot: what angles are in, percent being -100 to 100 of a joint's range; seen in the data if null"),
    ] = None
    calibration: Annotated[str | None, setting("LeRobot: the arm's calibration file, which has the joints' ranges")] = (
        None
    )
    name: Annotated[str, setting("name of an episode's motion, such as {motion}; that of its file if none")] = ""
    path: Annotated[str, setting("pattern of an episode's path, such as {date}/{motion}, whose parts are fields")] = ""
    about: Annotated[dict[str, Any], setting("what else is known of an episode: values, or {field} of its file")] = (
        field(default_factory=dict)
    )
    conditions: Annotated[
        dict[str, dict[Any, dict[str, Any]]],
        setting("effects that are known of an episode: {kp: {100: {servo_gain: {kp: 0.25}}}}, by what `about` says"),
    ] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what does not fit together."""
        names = list(self.joints) if self.joints is not None else None
        if names is not None and (not names or len(set(names)) != len(names) or not all(names)):
            raise ConfigError("joints", "must be different names", given=", ".join(names) or "[]")
        for name in NEEDED:
            if name not in self.signals and not (name == "action" and set(OTHER_COMMANDS) & set(self.signals)):
                raise ConfigError(f"signals.{name}", _lacking(name, self.signals))
        for pattern in self.files.values() if isinstance(self.files, dict) else filter(None, [self.files]):
            if not pattern or pattern.startswith("/") or ".." in pattern.split("/"):
                raise ConfigError("files", "must be names or patterns of files below the source", given=pattern or "''")
        if self.files == {}:
            raise ConfigError("files", "names no file of an episode; leave it out, or say which there are")
        for label, values in self.conditions.items():
            if label not in self.about:
                labels = ", ".join(self.about) or "nothing"
                raise ConfigError(f"conditions.{label}", f"`about` says nothing of it; it says {labels}")
            for value, effects in values.items():
                _check_effects(f"conditions.{label}.{value}", effects)
        for name, signal in self.signals.items():
            self._check_file(f"signals.{name}.file", signal.file)
            _check_unit(name, signal)
            _check_keys(f"signals.{name}", name, signal, names)

    @property
    def turning(self) -> list[str]:
        """Joints of which it says one by one that their positions are in radians, however far they turn."""
        unit = self.signals["position"].unit
        return [joint for joint, name in unit.items() if name == "rad"] if isinstance(unit, dict) else []

    def list_sliding(self, joints: Sequence[str]) -> list[str]:
        """Return the joints whose positions it has in a unit of length."""
        unit = self.signals["position"].unit
        return [joint for joint in joints if is_length(unit.get(joint, "") if isinstance(unit, dict) else unit)]

    def check_joints(self, joints: Sequence[str]) -> None:
        """Refuse what is said of joints that a log does not have.

        Raises:
            ConfigError: A signal differs by a joint that is none of `joints`.
        """
        for name, signal in self.signals.items():
            _check_keys(f"mapping.signals.{name}", name, signal, joints)

    def _check_file(self, where: str, file: str) -> None:
        if isinstance(self.files, dict):
            if file not in self.files:
                raise ConfigError(where, f"must be one of {', '.join(self.files)}", given=file or "(none)")
        elif file and not file.startswith("/"):
            problem = f"goes with no file: say files={{{file}: its name}}, or leave `file` out where there is one file"
            raise ConfigError(where, problem, given=file)


def _check_effects(where: str, effects: dict[str, Any]) -> None:
    try:
        build(effects)
    except ConfigError as error:
        raise error.under(where) from error


def _check_unit(name: str, signal: Signal) -> None:
    where = f"signals.{name}"
    if name.partition(".")[0] in TAKEN:
        raise ConfigError(where, "is a name of the contract that no log fills; call it otherwise")
    if name not in KNOWN and not signal.unit:
        near = f"no such signal{suggestion(name, KNOWN)}; " if suggestion(name, KNOWN) else ""
        raise ConfigError(where, f"{near}a signal of your own needs a unit; the contract has {', '.join(KNOWN)}")
    units = signal.unit if isinstance(signal.unit, dict) else {"": signal.unit}
    for joint, unit in units.items():
        try:
            factor(unit, UNITS[name]) if unit and name in UNITS else None
        except ValueError as error:
            problem = _of_other_kind(unit) if name in COMMANDS else ""
            raise ConfigError(f"{where}.unit{'.' * bool(joint)}{joint}", problem or str(error), given=unit) from error


def _lacking(name: str, signals: Iterable[str]) -> str:
    """Return what to say of a signal that is missing: which other one may be meant."""
    near = find_alike(name, [other for other in signals if other not in KNOWN])
    return f"has no value; is it {near[0]}?" if near else "has no value; say in which column it is"


def _of_other_kind(unit: str) -> str:
    """Return what to say of a command that is no position, nothing if it is of no kind that a servo takes."""
    for wanted, kind, name in (("rad/s", "speed", "velocity_command"), ("N·m", "torque", "torque_command")):
        try:
            factor(unit, wanted)
        except ValueError:
            continue
        return f"is a command of {kind}; it is signals: {{{name}: ...}}, beside an action or without any"
    return ""


def _check_keys(where: str, name: str, signal: Signal, joints: Sequence[str] | None) -> None:
    """Refuse what is said of an axis or a joint that is none; nothing where the joints are not known yet."""
    names, what = (AXES[name], "axis") if name in AXES else (joints, "joint")
    if names is None:
        return
    for key in BY_NAME:
        value = getattr(signal, key)
        for entry in value if isinstance(value, dict) else ():
            if entry not in names:
                raise ConfigError(f"{where}.{key}.{entry}", f"is no {what}{did_you_mean(entry, names)}")
