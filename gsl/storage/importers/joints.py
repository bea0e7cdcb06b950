"""The joints of a log: named by the mapping, or found by the columns of its signals, which have to agree on them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from gsl.core.likeness import find_alike
from gsl.core.override import spell, spell_key, spell_list, spell_setting
from gsl.errors import SHOWN as LETTERS
from gsl.errors import ConfigError, TrajectoryError, shorten
from gsl.storage.importers.mapping import Mapping as LogMapping
from gsl.storage.importers.signal import PER_JOINT
from gsl.storage.importers.table import Table

JOINT = "{joint}"
SHOWN = 12
CLOSE, NEAR = 0.75, 0.5  # likeness of two names: for one of many, and where each is the only choice


def joints_of(mapping: LogMapping, tables: Mapping[str, Table]) -> dict[str, str]:
    """Return the names of the joints in order, each with its name in the log; found by the positions' columns.

    Args:
        mapping: What names them, or in which columns they are.
        tables: By their role in the mapping.

    Raises:
        TrajectoryError: The mapping names none, and there are no such columns, or those of commands are of others.
    """
    if isinstance(mapping.joints, dict):
        return mapping.joints
    if mapping.joints is not None:
        return {joint: joint for joint in mapping.joints}
    form, table = mapping.signals["position"].column, tables[mapping.signals["position"].file]
    if not _has_joint(form):
        raise ConfigError("mapping.joints", "has no value; name them in order, or say {joint} in the positions' column")
    names = _list_joints("position", mapping, table)
    if not names:
        there = ", ".join(map(shorten, table.names[:SHOWN])) or "none"
        problem = f"is in no column; there is {there}; say in a mapping where things are (docs/howto/own-logs.md)"
        raise TrajectoryError(table.path, problem, column=str(form))
    for name, signal in mapping.signals.items():
        own = tables[signal.file]
        if name in PER_JOINT and not signal.optional and (others := _list_joints(name, mapping, own)):
            _check_pairs(name, mapping, (table, own), (names, others))
    return {name: name for name in names}


def list_left_out(mapping: LogMapping, joints: Mapping[str, str], tables: Mapping[str, Table]) -> Iterator[str]:
    """Tell of optional signals that some joints have and others lack, and of those of joints that are none."""
    for name, signal in mapping.signals.items():
        there = _list_joints(name, mapping, tables[signal.file]) if signal.optional and name in PER_JOINT else []
        lacking = [old for old in joints.values() if old not in there]
        others = [name for name in there if name not in joints.values()]
        if there and lacking and len(lacking) < len(joints):
            near = f"; {_fill(signal.column, others)} is of no joint" if others else ""
            yield f"{name}: left out, as there is no {_fill(signal.column, lacking)}{near}"
        elif others and mapping.joints is None:
            yield f"{name}: {_fill(signal.column, others)} is of no joint that has positions, and left out"


def _check_pairs(
    name: str, mapping: LogMapping, tables: tuple[Table, Table], names: tuple[Sequence[str], Sequence[str]]
) -> None:
    """Refuse a joint that has positions and no command, or the other way round."""
    signals = (mapping.signals["position"], mapping.signals[name])
    topics = [f"{signal.file} " * (signals[0].file != signals[1].file) for signal in signals]
    forms = [f"{topic}{signal.column}" for topic, signal in zip(topics, signals, strict=True)]
    alone = [_list_apart(own, other) for own, other in (names, names[::-1])]
    for side in (1, 0):  # a command without a position first
        if not alone[side]:
            continue
        joint, choices = alone[side][0], alone[1 - side]
        cutoff = NEAR if len(alone[side]) == len(choices) == 1 else CLOSE
        problem = f"goes with {_fill(forms[1 - side], [joint])}, which is missing"
        pair = "; rename it as its pair"
        for near in find_alike(joint, choices, cutoff=cutoff):
            problem += f"; did you mean {_fill(forms[1 - side], [near])}?"
            position, command = (joint, near) if side == 0 else (near, joint)
            key, column = spell_key(position), str(signals[1].column).replace(JOINT, command)
            pairs = f"{key}: {spell(column)}{', ...' * (len(names[0]) > 1)}"
            pair = " Rename it as its pair"
            if key and max(len(key), len(column)) <= LETTERS:
                pair = f" Pair all: {spell_setting(f'mapping.signals.{name}', f'{{column: {{{pairs}}}}}')}"
        problem += ", or ".join(filter(None, [pair, leave_out(_list_apart(names[0], alone[0]))]))
        raise TrajectoryError(tables[side].path, problem, column=_fill(forms[side], [joint]))


def _list_apart(own: Sequence[str], other: Sequence[str]) -> list[str]:
    """Return the names that the other side lacks, in order."""
    there = set(other)
    return [name for name in own if name not in there]


def leave_out(joints: Sequence[str]) -> str:
    """Return how to keep these joints alone; nothing if there are none, or one whose name nobody types."""
    if not joints or max(map(len, joints)) > LETTERS:
        return ""
    chosen = spell_list(joints[:SHOWN])
    chosen = f"{chosen[:-1]},...]" if len(joints) > SHOWN else chosen
    return f"leave it out with {spell_setting('mapping.joints', chosen)}"


def _list_joints(name: str, mapping: LogMapping, table: Table) -> list[str]:
    """Return the joints whose columns are of a signal's form; those that fit another one's more closely are not."""
    form = mapping.signals[name].column
    if not _has_joint(form):
        return []
    others = [
        str(signal.column)
        for other, signal in mapping.signals.items()
        if other != name and signal.file == mapping.signals[name].file and _has_joint(signal.column)
    ]
    closer = [other for other in others if len(other) > len(str(form))]
    return [
        joint
        for column in table.names
        if (joint := _joint(str(form), column)) and not any(_joint(other, column) for other in closer)
    ]


def _has_joint(form: object) -> bool:
    return isinstance(form, str) and form.count(JOINT) == 1


def _joint(form: str, column: str) -> str:
    """Return the joint that a column of this form is of; empty if it has another form."""
    before, after = form.split(JOINT)
    fits = column.startswith(before) and column.endswith(after) and len(column) > len(before) + len(after)
    return column[len(before) : len(column) - len(after)] if fits else ""


def _fill(form: object, joints: Sequence[str]) -> str:
    return ", ".join(shorten(str(form).replace(JOINT, joint)) for joint in joints[:SHOWN])
