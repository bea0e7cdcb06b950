"""The audit of a log: its signals, then its wiring against a simulator; physics is never named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gsl.core.body import lump
from gsl.core.plant import Plant
from gsl.core.slides import levers
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.angles import with_log_in_angles
from gsl.diagnosis.log.files import on_ground
from gsl.diagnosis.log.log import cut_log, spread
from gsl.diagnosis.wiring.fault import Fault
from gsl.diagnosis.wiring.options import by_relation, permutations
from gsl.diagnosis.wiring.outcome import Wiring
from gsl.diagnosis.wiring.physics import Fit
from gsl.diagnosis.wiring.search import WINDOWS, Search
from gsl.diagnosis.wiring.speeds import find_speeds
from gsl.diagnosis.wiring.words import Channels, describe, remedy
from gsl.errors import GslError
from gsl.storage.signals.check import check_signals, mend_signals
from gsl.storage.signals.finding import Finding

CLEAN, WIRING, UNCLEAR = "clean", "wiring", "unclear"
SPOILED = ("copy", "frozen", "stale")  # signals of a joint that no replay can be compared with
SCALES = ("scale", "rate", "permuted")  # faults after which a speed is another
ENOUGH, FEWEST = 90.0, 4  # of a log that is replayed [s], and its episodes
BESIDE = ("velocity",)  # signals that no replay reads


@dataclass(frozen=True)
class Audit:
    """What an audit found.

    Attributes:
        channels: Of the log.
        signals: What is wrong with the signals, seen without a simulator.
        wiring: What a search against the simulator found, None if there was none to make.
        seen: Faults that are seen without a replay, where the robot is on the ground.
        remarks: What else is to be said.
    """

    channels: Channels
    signals: tuple[Finding, ...]
    wiring: Wiring | None
    seen: tuple[Fault, ...]
    remarks: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """`wiring` if something is wrong, `unclear` if physics would look the same, else `clean`."""
        stands = self.wiring.stands if self.wiring else ()
        if self.signals or stands or self.seen:
            return WIRING
        return UNCLEAR if self.wiring and (self.wiring.late or self.wiring.doubted) else CLEAN

    @property
    def spoils(self) -> bool:
        """Whether a diagnosis would take for physics what is none."""
        replayed = [finding for finding in self.signals if finding.kind not in BESIDE and not _of_velocity(finding)]
        return bool(replayed or self.seen or (self.wiring and self.wiring.stands))

    @property
    def doubts(self) -> tuple[str, ...]:
        """What a diagnosis of the log has to say beside its own: what spoils no replay, and what looks like physics."""
        return (*(f"Wiring: {finding.sentence}." for finding in self.signals), *self.remarks)

    @property
    def summary(self) -> str:
        """The result in a sentence."""
        if self.verdict == WIRING:
            first = self.document()["findings"][0]["sentence"]
            more = len(self.document()["findings"]) - 1
            return f"Wiring, before any physics: {first}{f' And {more} more.' * bool(more)}"
        if self.verdict == UNCLEAR:
            return self.remarks[0]
        return "Names, signs, units, zeros, rows and rate of the log fit the simulator."

    def document(self) -> dict[str, Any]:
        """Return the audit as a document."""
        return {
            "verdict": self.verdict,
            "findings": [
                *map(_signal, self.signals),
                *(_fault(self, fault, None, None, ()) for fault in self.seen),
                *self._stands(),
            ],
            "remarks": list(self.remarks),
            "before": _floors(self.wiring.before) if self.wiring else None,
            "after": _floors(self.wiring.after) if self.wiring else None,
        }

    def _stands(self) -> list[dict[str, Any]]:
        stands = self.wiring.stands if self.wiring else ()
        return [_fault(self, stand.fault, stand.before, stand.after, stand.rivals) for stand in stands]


def audit(batch: Batch, plant: Plant, step: float, tick: Callable[[], None]) -> Audit:
    """Audit a log.

    Args:
        batch: Of the plant's robot.
        plant: The simulator.
        step: Its physics period [s].
        tick: Called after every replay.
    """
    batch, plant = with_log_in_angles(batch, replace(plant, robot=lump(plant.robot)))
    robot = plant.robot
    batch = _in_order(batch, robot.controlled)
    ways = tuple(levers(robot)[: len(robot.controlled)].tolist())
    channels = Channels(batch.joints, batch.control_period, ways)
    signals = check_signals(batch.episodes, batch.joints, {name: robot.joint(name).lever for name in robot.slides})
    mended = replace(batch, episodes=tuple(mend_signals(batch.episodes)))
    spoiled = {
        joint
        for finding in signals
        if finding.kind in SPOILED and not _of_velocity(finding)
        for joint in finding.joints
    }
    excluded = frozenset(k for k, joint in enumerate(batch.joints) if joint in spoiled)
    wiring, seen, remarks = None, list[Fault](), list[str]()
    if on_ground(batch):
        seen = _find_seen(mended, plant)
        remarks.append("On the ground nothing is replayed: what only a replay shows was not looked for.")
    elif len(excluded) == len(batch.joints):
        remarks.append("No joint is left to compare with the simulator.")
    else:
        try:
            floor = cut_log(mended, robot, blocks=True, settings=WINDOWS).noise.sd
            wiring = Search(take_part(mended), plant, step, floor, excluded, tick).run()
        except GslError as error:
            remarks.append(f"Nothing was replayed: {error}.")
    faults = [*seen, *(stand.fault for stand in (wiring.stands if wiring else ()))]
    scaled = {batch.joints[k] for fault in faults if fault.kind in SCALES for k in fault.joints}
    speeds = find_speeds(mended.episodes, batch.joints, plant)
    signals += [finding for finding in speeds if finding.joints[0] not in scaled]
    if wiring and wiring.doubted:
        like = describe(wiring.doubted, channels)
        remarks.insert(0, f"Too little to tell wiring from physics: {like} Larger and other motions would tell.")
    if wiring and wiring.late:
        rows = f"{wiring.late} row{'s' * (wiring.late > 1)}"
        delay = f"{1e3 * wiring.late * batch.control_period:.4g} ms"
        alike = f"columns that are {rows} apart look like this, and so does a latency of {delay}"
        remarks.insert(0, f"Commands act {rows} later: {alike}.")
    return Audit(channels, tuple(signals), wiring, tuple(seen), tuple(remarks))


def _of_velocity(finding: Finding) -> bool:
    """Whether velocities alone are wrong: positions are compared, and a replay settles before."""
    return bool(finding.columns) and all(column.startswith("velocity.") for column in finding.columns)


def take_part(batch: Batch) -> Batch:
    """Return episodes spread over a log, so few that a replay takes no time: wiring is the same in all of them."""
    most, rows = round(ENOUGH / batch.control_period), [len(episode) for episode in batch.episodes]
    count = max(FEWEST, int(len(rows) * most / max(sum(rows), 1)))
    chosen = [batch.episodes[k] for k in spread(np.arange(len(rows)), count)]
    made_by = {key: value for key, value in batch.metadata.items() if key == "world"}  # whose step a replay asks for
    return replace(batch, episodes=tuple(_begin(episode, most // 2) for episode in chosen), metadata=made_by)


def _begin(episode: Trajectory, rows: int) -> Trajectory:
    """Return the first rows of an episode."""
    if len(episode) <= rows:
        return episode
    states = slice(rows + 1)
    sensors = {key: values[states] for key, values in episode.sensors.items()}
    return Trajectory(
        episode.time[states], episode.action[:rows], episode.position[states], episode.velocity[states], sensors=sensors
    )


def _in_order(batch: Batch, joints: Sequence[str]) -> Batch:
    return batch if batch.joints == tuple(joints) else batch.only(joints)


def _find_seen(batch: Batch, plant: Plant) -> list[Fault]:
    """Return exchanged joints, signs and units that are seen in how positions follow commands."""
    for fault in permutations(batch):
        return [fault]
    faults = {}
    for option in by_relation(batch, plant):
        named = option.kind == "sign" or "unit" in option.value
        if named and option.kind not in faults and (seen := option.fault(range(len(batch.joints)))):
            faults[option.kind] = seen
    return list(faults.values())


def _floors(fit: Fit) -> float:
    return float(np.sqrt((fit.rms**2).mean()))


def _signal(finding: Finding) -> dict[str, Any]:
    return {
        "kind": finding.kind,
        "joints": list(finding.joints),
        "columns": list(finding.columns),
        "side": "",
        "value": {},
        "episode": finding.episode,
        "row": finding.row,
        "times": finding.times,
        "sentence": f"{finding.where}: {finding.problem}.",
        "remedy": f"{finding.remedy[0].upper()}{finding.remedy[1:]}.",
        "before": None,
        "after": None,
        "or": [],
    }


def _in_metres(key: str, value: Any, levers: Sequence[float]) -> Any:
    return (np.array(value) * levers).tolist() if key == "offset" else value


def _fault(
    about: Audit, fault: Fault, before: Fit | None, after: Fit | None, rivals: Sequence[Fault]
) -> dict[str, Any]:
    own = list(fault.joints)
    names = [about.channels.joints[k] for k in own]
    columns = [f"{side}.{name}" for side in ("action", "position") if fault.side in (side, "both") for name in names]
    return {
        "kind": fault.kind,
        "joints": names,
        "columns": columns,
        "side": fault.side,
        "value": {key: _in_metres(key, value, about.channels.levers) for key, value in fault.value.items()},
        "episode": None,
        "row": None,
        "times": 1,
        "sentence": describe(fault, about.channels),
        "remedy": remedy(fault, about.channels),
        "before": None if before is None else float(np.sqrt((before.rms[own] ** 2).mean())),
        "after": None if after is None else float(np.sqrt((after.rms[own] ** 2).mean())),
        "or": [describe(rival, about.channels) for rival in rivals],
    }
