"""Measure the audit: robots with wiring faults of known kind and joint, and robots that have physics alone."""

from __future__ import annotations

import pickle
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from gsl.core.body import lump
from gsl.core.console import Console
from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.core.statistics import wilson
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.log.records import slope
from gsl.diagnosis.wiring.audit import audit
from gsl.policies.excitation import Excitation
from gsl.rollout.parallel import Workers, in_parallel
from gsl.storage import documents
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.velocity_motors import check_servos
from gsl_benchmarks.blind.dials import draw, visible
from gsl_benchmarks.blind.jitter import NOISE, jitter
from gsl_benchmarks.blind.make import START
from gsl_benchmarks.blind.programmes import Programme, draw_programmes
from gsl_benchmarks.blind.same import play_same
from gsl_benchmarks.blind.wiring import KINDS, wire

CLEAN, PHYSICS = "clean", "physics"
SHARES = (0.1, 1.0)  # of its documented range that an effect has


class _Slot(NamedTuple):
    """A case: its number, the kind of its fault or `clean` or `physics`, and whether physics comes beside a fault."""

    number: int
    kind: str
    beside: bool


@component
class BlindWiring:
    """Draws cases, audits each, and counts: right kind, right joints, false alarms."""

    kind: ClassVar[str] = "blind_wiring"

    sim: Annotated[BulletWorld, setting("the simulator that all robots are nominally alike to")]
    excitation: Annotated[Excitation, setting("what the robots play")]
    faults: Annotated[int, setting("cases with a wiring fault, every second one with an effect beside it", ge=1)] = 39
    others: Annotated[int, setting("cases without: a third clean, the rest with an effect", ge=1)] = 39
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1

    def __post_init__(self) -> None:
        """Refuse a simulator that logs cannot be replayed in."""
        check_servos(self.sim.motors)

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here."""
        return {}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write cases.json and the table."""
        kinds = tuple(KINDS)
        slots = [_Slot(k, kinds[k % len(kinds)], k // len(kinds) % 2 == 1) for k in range(self.faults)]
        slots += [_Slot(self.faults + k, CLEAN if k % 3 == 0 else PHYSICS, k % 3 != 0) for k in range(self.others)]
        programme = draw_programmes(self.excitation, 1, self.sim.period, np.random.default_rng(self.seed))[0]
        shared = (self.sim.plant, self.sim.step, self.sim.period, programme, self.seed)
        with console.progress(len(slots), "making and auditing cases") as progress:
            cases = in_parallel(_case, shared, slots, self.workers, progress)
        documents.write_json(folder / "cases.json", {"cases": cases})
        (folder / "table.md").write_text(_table(cases), encoding="utf-8")
        return {"headline": _headline(cases), **_figures(cases)}


def _case(frozen: bytes, slot: _Slot) -> dict[str, Any]:
    """Make a case, audit it, and return truth and answer."""
    plant, step, period, programme, seed = pickle.loads(frozen)  # noqa: S301  our own bytes, from the parent process
    rng = np.random.default_rng([seed, slot.number])
    effects = draw_effect(plant, rng) if slot.beside else {}
    robot, noise, start_rng = (
        jitter(plant, rng),
        float(rng.uniform(*NOISE)),
        np.random.default_rng(rng.integers(2**32)),
    )

    def play(commands: Sequence[np.ndarray]) -> Batch:
        return record(robot, effects, programme, commands, period, noise, start_rng)

    if slot.kind in KINDS:
        case = wire(slot.kind, programme.commands, play, plant, rng)
        log, against, kind, joints = case.log, case.plant, case.kind, case.joints
    else:
        log, against, kind, joints = play(programme.commands), plant, "", ()
    begin = time.process_time()
    result = audit(log, against, step, lambda: None)
    answer = result.document()
    return {
        "kind": slot.kind,
        "truth": kind,
        "joints": list(joints),
        "effects": effects,
        "verdict": result.verdict,
        "found": [{"kind": finding["kind"], "joints": sorted(finding["joints"])} for finding in answer["findings"]],
        "sentences": [finding["sentence"] for finding in answer["findings"]],
        "cpu": time.process_time() - begin,
    }


def draw_effect(plant: Plant, rng: np.random.Generator) -> dict[str, Any]:
    """Draw a visible effect of the library and its strength, as a world's `effects:`."""
    dial = draw(str(rng.choice(visible())), plant.robot, rng)
    return {dial.effect: dial.entry(float(rng.uniform(*SHARES)))}


def record(
    robot: Plant, effects: Mapping[str, Any], programme: Programme, commands: Sequence[np.ndarray], period: float,
    noise: float, rng: np.random.Generator,
) -> Batch:  # fmt: skip
    """Return what a robot logs that plays commands, shape (T, n_joints) each.

    Args:
        robot: One of the make.
        effects: As a world's `effects:`.
        programme: Whose commands these are, or were before a fault.
        commands: Of each episode.
        period: Control period [s].
        noise: Standard deviation of the encoders [rad].
        rng: Of starts and noise.
    """
    body = lump(robot.robot)
    n = len(body.controlled)
    targets = [command[:, body.drive] for command in commands]
    starts = [path[0] + START * rng.standard_normal(len(path[0])) for path in targets]
    episodes = []
    for asked, measured in zip(commands, play_same(robot, effects, None, targets, starts, period), strict=True):
        position = measured[:, :n] + noise * rng.standard_normal((len(measured), n))
        times = period * np.arange(len(position))
        episodes.append(Trajectory(times, asked, position, slope(position, period)))
    about = {"robot": body.name, "role": "real", "source": "gsl blind"}
    return Batch(
        tuple(episodes), body.controlled, period, {**about, "episodes": [{"policy": name} for name in programme.names]}
    )


def _right_kind(case: Mapping[str, Any]) -> bool:
    return bool(case["found"]) and case["truth"] in {finding["kind"] for finding in case["found"]}


def _right(case: Mapping[str, Any]) -> bool:
    """Whether the kind is right, and its joints are exactly those that have the fault."""
    joints = {joint for finding in case["found"] if finding["kind"] == case["truth"] for joint in finding["joints"]}
    return _right_kind(case) and joints == set(case["joints"])


def _figures(cases: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    faults, others = [case for case in cases if case["truth"]], [case for case in cases if not case["truth"]]
    return {
        "faults": len(faults),
        "right_kind": sum(map(_right_kind, faults)),
        "right_kind_and_joints": sum(map(_right, faults)),
        "missed": sum(case["verdict"] != "wiring" for case in faults),
        "others": len(others),
        "false_alarms": sum(case["verdict"] == "wiring" for case in others),
        "cpu": float(np.median([case["cpu"] for case in cases])),
    }


def _headline(cases: Sequence[Mapping[str, Any]]) -> str:
    sums = _figures(cases)
    right, false = sums["right_kind_and_joints"], sums["false_alarms"]
    return f"kind and joints right in {right} of {sums['faults']}, {false} false alarms in {sums['others']}"


def _table(cases: Sequence[Mapping[str, Any]]) -> str:
    lines = ["| fault | cases | right kind | right kind and joints | missed |", "| --- | --- | --- | --- | --- |"]
    for kind in [*KINDS, "all"]:
        own = [case for case in cases if case["truth"] and kind in (case["kind"], "all")]
        missed = sum(case["verdict"] != "wiring" for case in own)
        lines.append(f"| {kind} | {len(own)} | {sum(map(_right_kind, own))} | {sum(map(_right, own))} | {missed} |")
    lines += ["", "| no fault | cases | false alarms |", "| --- | --- | --- |"]
    for kind in (CLEAN, PHYSICS):
        own = [case for case in cases if case["kind"] == kind]
        lines.append(f"| {kind} | {len(own)} | {sum(case['verdict'] == 'wiring' for case in own)} |")
    sums = _figures(cases)
    bounds = wilson(sums["right_kind_and_joints"], sums["faults"])
    share = f"{sums['right_kind_and_joints'] / sums['faults']:.2f} ({bounds.lower:.2f} to {bounds.upper:.2f})"
    lines += ["", f"Kind and joints right: {share}, Wilson, 95 %. Median CPU of an audit: {sums['cpu']:.1f} s."]
    return "\n".join([_headline(cases), "", *lines, ""])
