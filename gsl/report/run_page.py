"""The page of a run: its question, its answer in a sentence, what there is to see, and how it came about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from gsl.core.unit import Unit
from gsl.report.footfalls import Walk, footfall_figure
from gsl.report.joint_trace import Traces, joint_trace_figure
from gsl.report.learning_curve import Search, learning_curve_figure
from gsl.report.page import page
from gsl.report.parts import Part, bullets, choice, command, element, facts, fold, join, prose, section, table
from gsl.report.svg import WIDTH, svg
from gsl.storage.hashing import PAGE, SHORT
from gsl.storage.origin import Origin, origin

MARKS = {"good": "✓", "doubt": "?"}
LONG = 12  # rows of a table that are shown at once
_NOTHING = Markup("")
PARAMETERS = 40  # of a policy that are listed, the most changed first
DRAWN = 6  # joints, or entries of a state: a picture costs 70 ms


class Answer(NamedTuple):
    """What comes first on a page.

    Attributes:
        question: What the run was to find out.
        sentence: The answer, with its interval.
        sure: Whether the answer is significant at 95 %.
        more: Further sentences.
    """

    question: str
    sentence: str
    sure: bool
    more: Sequence[str] = ()


def describe_gain(
    name: str,
    after: Mapping[str, Any],
    before: Mapping[str, Any],
    gain: Mapping[str, Any],
    unit: Unit,
    over: str = "π0",
) -> tuple[str, bool]:
    """Return what a policy gains in a sentence, and whether that is significant.

    Args:
        name: Of the policy.
        after: Its value and interval on the real side.
        before: Those of π0.
        gain: Its value and interval.
        unit: Of the task.
        over: What the gain is over.
    """
    low = gain["interval"][0]
    sure = low is not None and low > 0.0
    reached = describe_value(unit, after["value"], after["interval"])
    more = f"{unit.format(gain['value'], sign=True)}{_bound(unit, gain['interval'], sign=True)}"
    significant = f"the gain over {over}, {more}, is {'' if sure else 'not '}significant"
    start = unit.bare(before["value"])
    return f"{name} reaches {reached} on the real side, π0 {start}: {significant}.", sure


def describe_value(unit: Unit, value: float, interval: list[float | None]) -> str:
    """Return a value with its unit and its 95 % interval, if that has ends."""
    return f"{unit.format(value)}{_bound(unit, interval)}"


def _bound(unit: Unit, interval: list[float | None], *, sign: bool = False) -> str:
    shown = unit.interval(interval, sign=sign)
    return "" if shown == "-" else f" (95 % {shown})"


class Change(NamedTuple):
    """A policy's parameters before and after, with their names and the size of a bold step, of equal length."""

    names: Sequence[str]
    before: Sequence[float]
    after: Sequence[float]
    scale: Sequence[float]


def write_page(folder: Path, answer: Answer, sections: Sequence[Part]) -> None:
    """Write the page of a run: the sections, what was warned of, and how it came about."""
    how = origin()
    kind = "good" if answer.sure else "doubt"
    summary = [prose(line) for line in answer.more]
    text = page(
        "base.html",
        [warnings(how, join(*summary, *sections)), *sections, *describe_origin(how)],
        title=answer.sentence,
        kind=kind,
        mark=MARKS[kind],
        kicker=answer.question,
        headline=prose(answer.sentence),
        summary=summary,
    )
    (folder / PAGE).write_text(text, encoding="utf-8")


def warnings(how: Origin | None, shown: Markup = _NOTHING) -> Markup | None:
    """Return the section with what a terminal was warned of and the page does not show yet; none where that is all."""
    lines = [line.rstrip(".") for line in (how.warnings if how else ())]
    new = [line for line in lines if prose(line)[1:] not in shown]
    return section("Warnings", bullets([prose(f"{line[:1].upper()}{line[1:]}.") for line in new]))


def describe_origin(how: Origin | None) -> list[Part]:
    """Return the sections with lineage, settings and command; none where no stage is at work."""
    if how is None:
        return []
    rows = [(f"made from {parent.role}", parent.path, parent.hash[:SHORT]) for parent in how.parents]
    rows += [(f"built {link.role}", link.path, link.hash[:SHORT]) for link in how.links]
    typed = not how.command.endswith(")") or how.command.startswith("gsl.")
    part = f"A part of {how.command.partition(' (')[0]}; gsl rerun and the folder of this page repeat it alone."
    again = command(how.command) if typed else element("p", part)
    settings = fold("all settings", element("pre", element("code", how.settings)))
    return [
        section(
            "Lineage",
            fold_long(table(("role", "where", "contents"), rows), len(rows)) if rows else None,
            note="Where it lies, as seen from this page. gsl lineage and gsl verify follow it to the first log.",
        ),
        section("How to repeat it", again, settings),
    ]


def fold_long(shown: Markup, rows: int) -> Markup:
    """Return a table of so many rows, folded up where they are many."""
    return shown if rows <= LONG else fold(f"all {rows}", shown)


def curves(searches: Sequence[Search], unit: str) -> Markup | None:
    """Return the section with the learning curves."""
    drawn = [
        svg(learning_curve_figure([search], unit=unit, width=WIDTH, among=searches), f"learning curve, {search.label}")
        for search in searches
    ]
    note = (
        "The best of each generation in simulation, and the same policies on the real side with 95 % intervals. "
        "A cross marks a fall; hollow: it fell in a later test. The diamond was measured again on fresh episodes. "
        "The best of a generation that is missing was not tried on the real side."
    )
    return section("Learning curves", element("div", *drawn, kind="panels"), note=note)


def rank_joints(*policies: Mapping[str, Traces]) -> list[str]:
    """Return the joints by how far they move, the farthest first, whichever policy moves them."""
    ranges: dict[str, float] = {}
    for traces in policies:
        for joint, trace in traces.items():
            ranges[joint] = max(ranges.get(joint, 0.0), float(np.ptp(trace.real)))
    return sorted(ranges, key=lambda joint: -ranges[joint])


def joints(traces: Mapping[str, Traces], note: str, title: str = "Joint by joint") -> Markup | None:
    """Return the section with the traces of the first joints of several; the reader chooses one."""
    pictures = {
        joint: svg(joint_trace_figure(traces[joint], joint, title="", width=WIDTH), f"traces of {joint}")
        for joint in list(traces)[:DRAWN]
    }
    some = f" Shown are {DRAWN} of {len(traces)} joints, those that move most." if len(traces) > DRAWN else ""
    return section(title, choice("joint", pictures), note=note + some)


def footfalls(walks: Sequence[Walk], note: str = "") -> Markup | None:
    """Return the section with the footfall pattern of walks; `note` says where they come from."""
    drawn = svg(footfall_figure(walks, width=WIDTH), "footfall pattern") if walks else None
    return section("Footfalls", drawn, note=f"A bar is the time in which a foot bears load.{note}")


def parameters(change: Change) -> Markup | None:
    """Return the section with a policy's parameters before and after."""
    names, before, after, scale = change
    changes = [(b - a) / s if s else 0.0 for a, b, s in zip(before, after, scale, strict=True)]
    order = list(range(len(names)))
    if len(names) > PARAMETERS:
        order = sorted(sorted(order, key=lambda k: -abs(changes[k]))[:PARAMETERS])
    numbers = [(f"{before[k]:.4g}", f"{after[k]:.4g}", f"{changes[k]:+.2f}") for k in order]
    rows = [(names[k], *(cell.replace("-", "−") for cell in row)) for k, row in zip(order, numbers, strict=True)]
    some = f" The {PARAMETERS} most changed of {len(names):,}." if len(names) > PARAMETERS else ""
    note = f"A change is in steps of the search, which are equally bold in each parameter.{some}"
    shown = table(("parameter", "π0", "returned", "change"), rows)
    return section("The policy before and after", shown, note=note)


def budget(pairs: Sequence[tuple[str, str]]) -> Markup | None:
    """Return the section that says what real data were spent."""
    return section("Real data", facts(pairs))
