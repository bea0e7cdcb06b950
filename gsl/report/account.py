"""The account of an artifact: its results as tables for a person, read from its files."""

from __future__ import annotations

import itertools
import math
import shlex
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from gsl.core.budget import DOCUMENT_BYTES, read_json, read_text
from gsl.core.configuration import list_worlds
from gsl.core.unit import Unit
from gsl.core.words import in_unit
from gsl.errors import InputError
from gsl.models.free_run import TICKS
from gsl.report.audit import audit_table
from gsl.report.diagnosis_text import summary_lines
from gsl.report.evaluation_cells import cells, columns, name_policy, outcomes_beside
from gsl.report.headline import show_in_unit, unit_of
from gsl.report.markdown import read_table
from gsl.report.tables import Table
from gsl.robots import catalogue
from gsl.storage.artifact import METRICS, Artifact
from gsl.storage.diagnosis_report import report_of
from gsl.storage.hashing import CIRCUMSTANCES, PAGE


def account(artifact: Artifact) -> list[Table]:
    """Return the results of an artifact; where no table tells them, its metrics by name."""
    tell = _TELLERS.get(artifact.manifest.kind, _of_others)
    try:
        result = tell(artifact.folder, artifact.metrics, unit_of(artifact))
        return [result] if isinstance(result, Table) else result
    except (InputError, OSError, ValueError, TypeError, AttributeError, LookupError, ArithmeticError, StopIteration):
        return [_plain(artifact)]


def _collect(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    row = {"episodes": metrics["episodes"], "steps": f"{metrics['steps']:,}"}
    if unit.falls:
        row["falls"] = metrics["falls"]
    if metrics["value"] is not None:
        value = f"value of π0{' with noise' * bool(metrics.get('action_noise'))}"
        row[in_unit(value, unit.name)] = unit.bare(metrics["value"])
    return Table("trajectories", tuple(row), [tuple(map(str, row.values()))])


def _import(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    row = {
        "episodes": metrics["episodes"],
        "files": metrics["files"],
        "joints": len(metrics["joints"]),
        "seconds": f"{metrics['seconds']:.1f}",
        "control period [s]": f"{metrics['control_period']:g}",
    }
    caption = "; ".join([metrics["time"], f"velocities {metrics['velocity']}", *metrics["warnings"]])
    log = shlex.quote(str(folder))
    robot = metrics.get("robot")
    world = robot if robot in catalogue.names() and robot in list_worlds() else ""
    following = f"what to type next{'' if world else ', with a simulator of the robot as sim'}:\n"
    following += "\n".join(f"  gsl {command} real={log} sim={world or '...'}" for command in ("audit", "diagnose"))
    return Table("imported trajectories", tuple(row), [tuple(map(str, row.values()))], f"{caption}\n{following}")


def _of_states(metrics: Mapping[str, Any], what: str) -> Table | None:
    """Return how a model of states does on held-out steps; none for one of joints."""
    heldout = metrics["heldout"]
    if "space" not in metrics or not {"r2", "action_r2"} & heldout.keys():
        return None
    each = [(f"state.{name}", value) for name, value in heldout.get("r2_by_variable", {}).items()]
    rows = [*each, ("all", heldout["r2"])] if "r2" in heldout else [("actions", heldout["action_r2"])]
    shown = [(name, f"{100.0 * value:.1f} %") for name, value in rows]
    return Table(f"{what} ({metrics['family']}) on held-out trajectories", ("of", "variance explained"), shown)


def _train_forward(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    if table := _of_states(metrics, "forward model"):
        return table
    names = {
        "one_step_deg": "one tick [°]",
        "one_step_no_change_deg": "no change, one tick [°]",
        "r2": "R²",
        "free_run_deg": f"{TICKS} ticks [°]",
        "free_run_no_change_deg": f"no change, {TICKS} ticks [°]",
    }
    rows = [
        (
            {"pi0": "of π0", "off_pi0": "off π0"}[group],
            str(measured["trajectories"]),
            *(_number(measured.get(name)) for name in names),
            _worst(measured.get("free_run_by_joint_deg") or measured["one_step_by_joint_deg"]),
        )
        for group, measured in metrics["heldout"].items()
    ]
    title = f"forward model ({metrics['family']}) on held-out real trajectories"
    return Table(title, ("policy", "trajectories", *names.values(), "worst joint"), rows)


def _train_inverse(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    if table := _of_states(metrics, "inverse model"):
        return table
    measured = metrics["heldout"]
    title = f"inverse model ({metrics['method']}, {metrics['family']}) on held-out simulated trajectories"
    row = (_number(measured["recovered_action_deg"]), _worst(measured["recovered_action_by_joint_deg"]))
    return Table(title, ("action error [°]", "worst joint"), [row])


def _train_servo(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    below = f"what it has learned: {folder.as_posix()}/servo.png"
    return Table("distance from held-out motions [noise floors]", *servo_table(metrics), below)


def servo_table(metrics: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return titles and rows of what a learned servo leaves [noise floors], by group of joints."""
    groups: Mapping[str, Mapping[str, Any]] = {"all": metrics, **metrics["groups"]}
    rows: list[tuple[str, ...]] = [
        (
            name,
            f"{figures['floors_before']:.2f}",
            f"{figures['floors_after']:.2f}",
            "yes" if figures["learned"] else "no",
        )
        for name, figures in groups.items()
    ]
    return ("joints", "simulator", "with the learned servo", "learned"), rows


def _optimize(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    document = read_json(folder / "policies.json")
    rows = [
        (str(policy["generation"]), str(policy["name"]), unit.bare(policy["value_sim"]))
        for policy in document["policies"]
        if policy["generation"]
    ]
    titles = ("generation", "policy", in_unit("in simulation", unit.name))
    problems = _problems(folder)
    return Table("best of each generation", titles, rows, f"the grounding: {problems}" if problems else None)


def _problems(folder: Path) -> str:
    report = folder / "grounding.json"
    return "; ".join(read_json(report)["problems"]) if report.is_file() else ""


def _evaluate(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    document = read_json(folder / "evaluation.json")
    return Table("policies in the real world", *evaluation_table(document, unit), describe_choice(metrics, unit))


def evaluation_table(document: Mapping[str, Any], unit: Unit) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return titles and rows of what evaluation.json holds."""
    phases = {"policies": "", "check": ", checked", "confirmation": ", fresh"}
    named = [
        (row, f"{name_policy(row['name'])}{purpose}") for phase, purpose in phases.items() for row in document[phase]
    ]
    outcomes = outcomes_beside([row for row, _ in named], unit)
    rows = [tuple(cells(row | {"interval": _bounds(row["interval"])}, name, unit, outcomes)) for row, name in named]
    return tuple(columns(outcomes, unit)), rows


def _bounds(interval: list[float | None]) -> list[float]:
    return [math.inf if bound is None else bound for bound in interval]


def describe_choice(metrics: Mapping[str, Any], unit: Unit) -> str:
    """Return in a line what an evaluation chose, what that is worth beside π0, and what it cost."""
    spent = f"{metrics['real_episodes']} real episodes"
    if not metrics["policies"]:
        measured = metrics["baseline"]
        value = f"{unit.format(measured['value'])} (95 % {unit.interval(measured['interval'])})"
        return f"{name_policy(metrics['best'])} alone was measured: {value}, {unit.describe_ends(measured)}; {spent}"
    if not metrics["best_generation"]:
        faster = "stable policy was faster" if unit.falls else "policy was better"
        better = "faster policy passed its check" if metrics["failed_check"] else faster
        return f"no {better}: {name_policy(metrics['best'])} is returned; {spent}"
    gain, after, before = metrics["gain"], metrics["returned"], metrics["baseline"]
    bounds = unit.interval(gain["interval"], sign=True)
    values = f"{unit.format(after['value'])}, {unit.describe_ends(after)}; π0 {unit.format(before['value'])}"
    worth = f"on fresh episodes {values}; gain {unit.format(gain['value'], sign=True)}, 95 % interval {bounds}"
    below = ": worse than π0" if gain["interval"][1] < 0.0 else ": no better than π0"
    doubt = "" if gain["interval"][0] > 0.0 else ", which is not significant" if gain["value"] > 0.0 else below
    return f"{metrics['best']} is returned: {worth}{doubt}; {spent}"


def _iterate(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    titles, rows = _markdown(folder / "table.md")
    spent, learned, flight = metrics["real_episodes"], metrics["learned_from"], metrics.get("excitation")
    why = "to diagnose" if metrics.get("diagnosis") else "to learn the servo from"
    air = f"{flight['episodes']} motions in the air ({flight['real_seconds']:.0f} s) {why}, " if flight else ""
    measured = spent - learned - (flight["episodes"] if flight else 0)
    beside = metrics.get("ungrounded")
    more = f"; {beside['real_episodes']} more to measure the search without grounding" if beside else ""
    plots = ", ".join(sorted(path.name for path in folder.glob("*.png")))
    below = [
        *(metrics[key]["told"] for key in ("diagnosis", "servo") if metrics.get(key)),
        metrics["verdict"],
        *(f"warning: {line}" for line in metrics.get("broken_promises", [])),
        f"real data: {air}{learned} episodes to learn from, {measured} to measure, {spent} in all{more}",
        f"plots: {folder.as_posix()}/ ({plots})",
        f"page: {(folder / PAGE).as_posix()}",
    ]
    return Table(in_unit("grounded simulation learning", unit.name), titles, rows, "\n".join(below))


def _of_others(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    """Return the first table that a stage of another package has written, and where the rest is."""
    page = min(folder.glob("*.md"))
    others = ", ".join(sorted(path.name for path in folder.iterdir() if path.name not in (*CIRCUMSTANCES, METRICS)))
    below = "\n".join(filter(None, (metrics.get("answer"), f"{folder.as_posix()}/: {others}")))
    return Table(str(metrics.get("headline", "what came out")), *_markdown(page), below)


def _survey(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    return Table(in_unit("worlds", unit.name), *_markdown(folder / "table.md"))


def _markdown(path: Path) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the titles and rows of the first table of a file."""
    below_title = itertools.dropwhile(lambda line: line[:1] != "|", read_text(path, DOCUMENT_BYTES).splitlines())
    return read_table(list(itertools.takewhile(lambda line: line.startswith("|"), below_title)))


def _plain(artifact: Artifact) -> Table:
    shown = show_in_unit(dict(flat(artifact.metrics)), unit_of(artifact))
    return Table("metrics", ("metric", "value"), [(name, plain(value)) for name, value in shown.items()])


def flat(values: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield one row a value, with its dotted name."""
    if isinstance(values, dict) and values:
        for key, value in values.items():
            yield from flat(value, f"{path}.{key}".lstrip("."))
    else:
        yield path, values


def plain(value: Any) -> str:
    """Return a value as a person writes it."""
    if isinstance(value, list):
        return f"[{', '.join(map(plain, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {plain(entry)}' for key, entry in value.items())}}}"
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "none"}[value]
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _worst(by_joint: Mapping[str, float]) -> str:
    joint = max(by_joint, key=lambda name: by_joint[name])
    return f"{joint} {by_joint[joint]:.2f}°"


def _diagnose(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> list[Table]:
    return summary_lines(report_of(folder))


def _audit(folder: Path, metrics: Mapping[str, Any], unit: Unit) -> Table:
    return audit_table(read_json(folder / "audit.json"))


_TELLERS: Mapping[str, Callable[[Path, Mapping[str, Any], Unit], Table | list[Table]]] = {
    "audit": _audit,
    "collect": _collect,
    "import": _import,
    "diagnose": _diagnose,
    "train_forward": _train_forward,
    "train_inverse": _train_inverse,
    "train_servo": _train_servo,
    "optimize": _optimize,
    "evaluate": _evaluate,
    "iterate": _iterate,
    "survey": _survey,
}
