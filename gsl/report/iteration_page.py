"""The page of an iteration: did the policy get better on the real side, and what did grounding do?"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from gsl.core.impedance import QUANTITIES
from gsl.core.words import in_unit
from gsl.report.footfalls import Walk
from gsl.report.grounding_errors import finding, grounding_errors_figure
from gsl.report.iteration import Rounds
from gsl.report.joint_trace import Traces
from gsl.report.parts import Part, bullets, element, prose, section, table
from gsl.report.run_page import Change, budget, curves, footfalls, joints, parameters, write_page
from gsl.report.svg import WIDTH, svg

_PLAYED = " Policies walked once more for this picture; the figures are of other walks."
_GROUPS = {"pi0": "of π0", "off_pi0": "off π0"}


class Seen(NamedTuple):
    """What there is to see of the first iteration.

    Attributes:
        traces: By joint; none where there are no joints.
        walks: Whose feet are known.
        caption: What the traces are of.
    """

    traces: Mapping[str, Traces] = {}
    walks: Sequence[Walk] = ()
    caption: str = ""


def write_iteration_page(
    folder: Path, rounds: Rounds, seen: Seen, change: Change, check: Mapping[str, Any] | None, remarks: Sequence[str]
) -> None:
    """Write the page.

    Args:
        folder: Where to write.
        rounds: The iterations.
        seen: What there is to see.
        change: Of the policy.
        check: What grounding.json says of the first iteration, if it has one.
        remarks: Further sentences, as below the table.
    """
    sections = [
        section(
            in_unit("Iterations", rounds.unit),
            table(rounds.columns, rounds.rows),
            bullets([prose(line) for line in (*rounds.broken_promises, *remarks)]),
        ),
        curves(rounds.searches(), rounds.unit),
        grounding(check, rounds.diagnosis),
        joints(seen.traces, seen.caption),
        footfalls(seen.walks, _PLAYED),
        parameters(change),
        budget(rounds.budget),
    ]
    write_page(folder, rounds.answer, sections)


def grounding(check: Mapping[str, Any] | None, diagnosis: Sequence[str]) -> Markup | None:
    """Return the section that says what the grounding changes: what was diagnosed, and how far simulators are off."""
    said: list[Part] = [element("p", prose(line)) for line in diagnosis]
    errors = _errors(check or {})
    if errors:
        drawn = svg(grounding_errors_figure(errors, title="", width=WIDTH), "joint errors with and without grounding")
        said += [element("p", prose(f"{finding(errors)}.")), drawn]
    if rows := _loads(check or {}):
        said += [
            element("p", "Loads on single joints in the air:"),
            table(("joints", "", "simulator", "grounded", "real"), rows),
        ]
    said += [element("p", prose(f"The check says: {line}.")) for line in (check or {}).get("problems") or []]
    note = "The simulator starts in held-out real states and plays real actions for ten ticks." if errors else ""
    return section("What grounding changes", *said, note=note)


def _loads(check: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Return how groups of joints answer loads in both simulators and on the real side, as far as it was measured."""
    return [
        (
            group,
            title,
            *("" if (value := values.get(name)) is None else f"{value:.3g}" for name in ("sim", "grounded", "real")),
        )
        for group, quantities in ((check.get("compliance") or {}).get("groups") or {}).items()
        for quantity, title in QUANTITIES.items()
        if (values := quantities.get(quantity))
    ]


def _errors(check: Mapping[str, Any]) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    """Return the errors after ten ticks by group, simulator and joint [deg], as far as the check has measured them."""
    groups: dict[str, dict[str, Mapping[str, float]]] = {}
    for group, simulators in (check.get("errors") or {}).items():
        for name, spans in simulators.items():
            (last,) = [span for key, span in spans.items() if key != "one_tick"][:1] or [{}]
            if by_joint := last.get("by_joint_deg"):
                groups.setdefault(_GROUPS.get(group, group), {})[name] = by_joint
    return groups


def read_check(path: Path) -> Mapping[str, Any] | None:
    """Return what grounding.json says, None where there is none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
