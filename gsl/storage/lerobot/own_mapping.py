"""The mapping that a data set gives by itself: its joints by name, and the scale that their angles are on."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.budget import TEXT_BYTES, parse_json, read_text
from gsl.core.likeness import find_alike
from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError, TrajectoryError, shorten
from gsl.storage.importers.joints import leave_out
from gsl.storage.importers.mapping import Mapping as LogMapping
from gsl.storage.importers.signal import Signal, Time
from gsl.storage.lerobot.arms import JAW_CLOSED, JAW_STROKE, OLD, OLD_ZEROS, OURS, bare, family, is_gripper, motor
from gsl.storage.lerobot.dataset import ACTION, INFO, STATE, VELOCITY, DataSet
from gsl.storage.lerobot.encoder_steps import STEP, find_range, is_telling, on_degrees
from gsl.storage.lerobot.episode_table import TIME, EpisodeTable

BEYOND = 100.5  # a percentage is clipped to 100
ROWS = 200_000  # whose angles are looked at: an arm that was never moved in two hours of frames will not say more
SHOWN = 6
Scales = dict[str, tuple[str, float, float, float, float]]  # by joint: unit, factor, zero, sign, offset


def own_mapping(data: DataSet, mapping: LogMapping, memory: float) -> tuple[LogMapping, list[str]]:
    """Return a mapping for a data set, and notes on what it takes for granted.

    Args:
        data: What the data set says of itself.
        mapping: Whose other settings stay.
        memory: That reading may take [bytes].

    Raises:
        InputError: Joints have no names, or nothing says which scale their angles are on.
    """
    robot = mapping.robot if mapping.robot != "unknown" else data.robot
    arm = family(robot)
    entries, notes = _entries(data, mapping, arm)
    scales, why = _scales(data, mapping, arm, entries, memory)
    columns = [[_column(data, key, entry) for entry in entries.values()] for key in (ACTION, STATE)]
    signals = {name: _signal(entries, own, scales) for name, own in zip(("action", "position"), columns, strict=True)}
    speeds = {joint: f"{VELOCITY}.{bare(entry)}.vel" for joint, entry in entries.items()}
    if data.angles and {*speeds.values()} <= {f"{VELOCITY}.{name}" for name in data.names.get(VELOCITY, ())}:
        units = {joint: "m/s" if scales[joint][0] == "m" else "deg/s" for joint in entries}
        signals["velocity"] = Signal(column=dict(speeds), unit=units)
    joints = list(entries)
    own = dataclasses.replace(mapping, signals=signals, joints=joints, robot=arm or robot, time=Time(TIME, "s"))
    return own, [why, *notes]


def _column(data: DataSet, key: str, entry: str) -> str:
    return f"{key}.{entry}" if key in data.names else f"{key}[{entry}]"


def _signal(entries: Mapping[str, str], columns: Sequence[str], scales: Scales) -> Signal:
    unit, factor, zero, sign, offset = (
        {joint: scales[joint][part] for joint in entries} for part in range(5)
    )  # one dictionary each
    column: dict[str, str | int] = dict(zip(entries, columns, strict=True))
    return Signal(column=column, unit=unit, factor=factor, zero=zero, sign=sign, offset=offset)  # type: ignore[arg-type]


def _entries(data: DataSet, mapping: LogMapping, arm: str | None) -> tuple[dict[str, str], list[str]]:
    """Return the name or number of an entry by joint, and notes."""
    joints = mapping.joints
    if STATE not in data.names or ACTION not in data.names:
        width = data.widths[STATE]
        if isinstance(joints, list) and len(joints) == width == data.widths[ACTION]:
            return {joint: str(index) for index, joint in enumerate(joints)}, []
        problem = f"the data set names no joints: say its {width} in order, mapping.joints=[...], and mapping.angles"
        raise ConfigError("mapping.joints", problem)
    there = [name for name in data.names[STATE] if name in data.names[ACTION]]
    there = [name for name in there if name.endswith(".pos")] or there
    if not there:
        shown = [", ".join(map(shorten, data.names[key][:SHOWN])) for key in (STATE, ACTION)]
        problem = f"{STATE} has {shown[0]}, {ACTION} has {shown[1]}: none is in both; say where things are in a mapping"
        raise TrajectoryError(data.folder, problem)
    by_joint = {bare(name): name for name in there}
    notes = []
    if joints is None and arm in ("so100", "so101") and set(by_joint) == set(OURS.values()):
        joints = dict(OURS)
        theirs = ",".join(OURS.values())
        notes += [f"joints are called as in the world so101, {', '.join(OURS)}; mapping.joints=[{theirs}] keeps theirs"]
    if mapping.joints is None:
        _check_pairs(data, there)
    wanted = joints if isinstance(joints, dict) else {joint: joint for joint in (joints or by_joint)}
    for ours, theirs in wanted.items():
        if bare(str(theirs)) not in by_joint:
            problem = f"is no joint of the data set{did_you_mean(str(theirs), list(by_joint), listed=True)}"
            raise ConfigError(f"mapping.joints.{ours}", problem, given=str(theirs))
    chosen = {ours: by_joint[bare(str(theirs))] for ours, theirs in wanted.items()}
    left = [name for name in dict.fromkeys([*data.names[STATE], *data.names[ACTION]]) if name not in chosen.values()]
    if left:
        names = ", ".join(map(shorten, left[:SHOWN]))
        notes.append(f"left out, as no joint's position: {names}{' ...' * (len(left) > SHOWN)}")
    return chosen, notes


def _check_pairs(data: DataSet, there: Sequence[str]) -> None:
    """Refuse a joint that only one of the lists has: a renamed one; a state may have more than positions.

    Raises:
        TrajectoryError: A command has no state, or a position, which `.pos` tells, no command.
    """
    both = set(there)
    own = {key: [name for name in data.names[key] if name not in both] for key in (ACTION, STATE)}
    if any(name.endswith(".pos") for name in there):
        own = {key: [name for name in names if name.endswith(".pos")] for key, names in own.items()}
    elif not own[ACTION]:
        return
    for key, other in ((ACTION, STATE), (STATE, ACTION)):
        if own[key]:
            joint, choices = own[key][0], own[other]
            only = len(choices) == 1 == len(own[key])
            near = choices[:1] if only else find_alike(joint, choices, cutoff=0.75)
            ways = [f"did you mean {other}.{shorten(name)}? Name both alike in {INFO}" for name in near]
            ways += filter(None, [leave_out([bare(name) for name in there])])
            problem = f"goes with {other}.{shorten(joint)}, which is missing; {', or '.join(ways) or f'mend {INFO}'}"
            raise TrajectoryError(data.folder, problem, column=f"{key}.{joint}")


def _scales(
    data: DataSet, mapping: LogMapping, arm: str | None, entries: Mapping[str, str], memory: float
) -> tuple[Scales, str]:
    """Return unit, factor, zero, sign and offset by joint, and which scale that is and why."""
    old = any(OLD in entry for entry in entries.values())
    grippers = {joint for joint, entry in entries.items() if is_gripper(entry) and (arm or mapping.angles == "percent")}
    grippers -= set(entries) if data.angles else set()
    body = [joint for joint in entries if joint not in grippers]
    values = _read_angles(data, entries, memory)
    ranges = _read_calibration(mapping.calibration, entries, arm) if mapping.calibration else {}
    if mapping.angles is not None:
        kind: str = mapping.angles
        why = f"angles are in {mapping.angles}, as mapping.angles says"
        _check_words(mapping.angles, {joint: values[joint] for joint in body})
    elif data.angles:
        kind, why = data.angles, f"angles are in {data.angles}, as the data set says"
    elif old:
        kind, why = "deg", f"angles are in degrees: names begin with {OLD}"
    else:
        kind, why = _recognise({joint: values[joint] for joint in body}, arm, calibrated=bool(ranges))
    for joint in [*(body if kind == "percent" else ()), *grippers]:
        steps = ranges.get(joint) or find_range(values[joint], 0.0 if joint in grippers else -100.0)
        ranges |= {joint: steps} if steps else {}
    if kind == "percent":
        _check_percent(data, body, values, ranges)
        ranges_text = ", ".join(f"{joint} {ranges[joint]}" for joint in body)
        why += f"; calibrated ranges, in ticks: {ranges_text}"
    scales: Scales = {}
    for joint, entry in entries.items():
        so = arm in ("so100", "so101")
        zero, sign = OLD_ZEROS.get(motor(entry), (0.0, 1.0)) if old and so and kind == "deg" else (0.0, 1.0)
        if data.angles and bare(entry) in data.slides:
            scales[joint] = ("m", 1.0, 0.0, 1.0, 0.0)
        elif joint in grippers:
            scales[joint] = _gripper(data, joint, ranges.get(joint), so)
        elif kind == "percent":
            scales[joint] = ("deg", ranges[joint] * STEP / 200.0, 0.0, 1.0, 0.0)
        else:
            scales[joint] = (kind, 1.0, zero, sign, 0.0)
    return scales, why


def _gripper(data: DataSet, joint: str, ticks: int | None, so: bool) -> tuple[str, float, float, float, float]:
    """Return the scale of a percentage from closed to open."""
    closed = JAW_CLOSED if so else 0.0
    if ticks:
        return "deg", ticks * STEP / 100.0, 0.0, 1.0, closed
    if not so:
        problem = "is a percentage of a range that is not known: say mapping.calibration=FILE, or leave it out"
        raise TrajectoryError(data.folder, problem, column=joint)
    return "rad", JAW_STROKE / 100.0, 0.0, 1.0, closed


def _read_angles(data: DataSet, entries: Mapping[str, str], memory: float) -> dict[str, np.ndarray]:
    """Return measured angles as they are in the files, by joint, of as many episodes as there have to be."""
    columns = [_column(data, STATE, entry) for entry in entries.values()]
    parts: dict[str, list[np.ndarray]] = {joint: [] for joint in entries}
    rows = 0
    for entry in data.episodes:
        table = EpisodeTable(entry, memory)
        values = table.columns([column.partition("[")[0] for column in columns])
        for index, (joint, column) in enumerate(zip(entries, columns, strict=True)):
            own = values[column.partition("[")[0]]
            parts[joint].append(own if own.ndim == 1 else own[:, index])
        rows += entry.rows
        if rows > ROWS:
            break
    return {joint: np.concatenate(own) for joint, own in parts.items()}


def _recognise(values: Mapping[str, np.ndarray], arm: str | None, *, calibrated: bool) -> tuple[str, str]:
    """Return deg or percent, and why.

    Raises:
        ConfigError: Nothing tells.
    """
    reach = {joint: float(np.nanmax(np.abs(own))) for joint, own in values.items()}
    far = max(reach, key=lambda joint: reach[joint])
    if arm and reach[far] > BEYOND:
        return "deg", f"angles are in degrees: {far} reaches {reach[far]:.0f}, and a percentage ends at 100"
    combs = [comb for own in values.values() if (comb := on_degrees(own)) is not None]
    if combs and all(combs):
        return "deg", "angles are in degrees: their steps are those of an encoder of 4096 ticks in degrees"
    if calibrated:
        return "percent", "angles are percentages of the calibrated range, as nothing speaks for degrees"
    if _find_telling(values):
        return "percent", "angles are percentages of the calibrated range: their steps are a range over 200"
    problem = (
        "nothing in the data set says whether its angles are degrees or percentages of each joint's range, "
        "-100 to 100; say mapping.angles=deg, or mapping.calibration=FILE (the arm's own, from LeRobot)"
    )
    raise ConfigError("mapping.angles", problem)


def _find_telling(values: Mapping[str, np.ndarray]) -> dict[str, int]:
    """Return the ranges by joint that no other scale explains [ticks]."""
    ranges = {joint: find_range(own, -100.0) for joint, own in values.items() if not on_degrees(own)}
    return {joint: ticks for joint, ticks in ranges.items() if ticks and is_telling(ticks)}


def _check_words(angles: str, values: Mapping[str, np.ndarray]) -> None:
    """Refuse a scale that the user has said and the encoders' steps contradict.

    Raises:
        ConfigError: They are those of a percentage.
    """
    for joint, ticks in _find_telling(values).items() if angles != "percent" else ():
        problem = f"but {joint} has the steps of a percentage, of {ticks} ticks; leave mapping.angles out"
        raise ConfigError("mapping.angles", problem, given=angles)


def _check_percent(
    data: DataSet, body: Sequence[str], values: Mapping[str, np.ndarray], ranges: Mapping[str, int]
) -> None:
    for joint in body:
        reach = float(np.nanmax(np.abs(values[joint])))
        if reach > BEYOND:
            problem = f"reaches {reach:.4g}, and a percentage ends at 100: are these degrees (mapping.angles=deg)?"
            raise TrajectoryError(data.folder, problem, column=joint)
        if joint not in ranges:
            problem = (
                "is a percentage of its range, and moves too little to tell which; say mapping.calibration=FILE "
                "(LeRobot keeps one for each arm), or leave the joint out of mapping.joints"
            )
            if on_degrees(values[joint]):
                problem = "has the steps of degrees; leave mapping.angles out"
            raise TrajectoryError(data.folder, problem, column=joint)


def _read_calibration(file: str, entries: Mapping[str, str], arm: str | None) -> dict[str, int]:
    """Return the calibrated range of each joint [ticks] from a file of LeRobot.

    Raises:
        ConfigError: It is none, lacks a joint, or turns one round.
    """
    where = "mapping.calibration"
    try:
        calibration: Any = parse_json(read_text(Path(file), TEXT_BYTES))
    except ValueError as error:
        raise ConfigError(where, f"is no JSON: {error}", given=file) from error
    motors = {}
    for joint, entry in entries.items():
        about = calibration.get(motor(entry), calibration.get(bare(entry))) if isinstance(calibration, dict) else None
        if not isinstance(about, dict) or not all(type(about.get(key)) is int for key in ("range_min", "range_max")):
            there = ", ".join(map(str, calibration))[:80] if isinstance(calibration, dict) else "no joints"
            raise ConfigError(where, f"has no range_min and range_max of {motor(entry)}; it has {there}", given=file)
        if about.get("drive_mode") and arm != "koch":  # Dynamixel buses do not apply it
            raise ConfigError(where, f"has a drive_mode for {motor(entry)}, which is not read", given=file)
        motors[joint] = about["range_max"] - about["range_min"]
        if not 0 < motors[joint] <= 1_000_000:
            raise ConfigError(where, f"has an empty range of {motor(entry)}", given=file)
    return motors
