"""Where the gap lies: joint by regime as a map, its growth with the horizon, left against right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from gsl.report.charts import Curve, line_chart
from gsl.report.diagnosis_verdict import Place, places
from gsl.report.diagnosis_words import (
    REGIMES,
    Document,
    between,
    entries,
    finite,
    level,
    part,
    probability,
    read_word,
    regime,
    share,
)
from gsl.report.parts import element, join, section, table

DARKEST = 0.7  # opacity of the cell with the greatest share; words stay readable on it
DRAWN = 4  # joints with a colour of their own


def where(document: Document) -> Markup | None:
    """Return the map and the list of its named cells."""
    cells = {(read_word(cell, "joint"), read_word(cell, "regime")): cell for cell in entries(document, "where")}
    if not cells:
        return None
    named = [_name_place(place) for place in places(document)]
    columns = ("joint", "share of the excess", "95 % interval", "gap / noise", "most when")
    note = (
        "Share of the excess, the part of the gap that noise does not explain, by joint and by what the joint did; a "
        "moment may count in several columns. Framed: significantly more than noise. Grey: within the noise. "
        "Gap / noise is over the whole log, held-out records and others."
    )
    return section(
        "Where the gap lies",
        table(columns, named) if named else element("p", "Every cell is within the noise."),
        _map(cells),
        note=note,
    )


def _name_place(place: Place) -> Sequence[str]:
    cell = place.cell
    return place.joint, share(cell.get("share")), between(cell, share), level(cell.get("rms")), place.when


def _map(cells: Mapping[tuple[str, str], Document]) -> Markup:
    order = list(REGIMES)
    regimes = sorted(
        dict.fromkeys(kind for _, kind in cells), key=lambda kind: order.index(kind) if kind in order else len(order)
    )
    joints = sorted(dict.fromkeys(joint for joint, _ in cells), key=lambda joint: -_worst(cells, joint))
    top = max((_share(cell) for cell in cells.values() if cell.get("named")), default=0.0)
    rows = [[joint, *(_cell(cells.get((joint, kind)), top) for kind in regimes)] for joint in joints]
    return table(["share of the excess [%]", *(regime(kind) for kind in regimes)], rows, kind="map")


def _worst(cells: Mapping[tuple[str, str], Document], joint: str) -> float:
    whole = cells.get((joint, "all"))
    return _share(whole) if whole else max(_share(cell) for (name, _), cell in cells.items() if name == joint)


def _share(cell: Document) -> float:
    return finite(cell.get("share")) or 0.0


def _cell(cell: Document | None, top: float) -> Markup:
    if cell is None:
        return element("td", "·", kind="noise")
    number = f"{100.0 * max(0.0, _share(cell)):.0f}"
    if not cell.get("named"):
        return element("td", "·" if number == "0" else number, kind="noise")
    opacity = DARKEST * max(0.0, _share(cell)) / top if top > 0.0 else 0.0
    return element("td", number, kind="named", style=f"--share:{opacity:.2f}")


def growth(document: Document) -> Markup | None:
    """Return how the gap grows with the time since a replay began."""
    horizon = part(document, "horizon")
    time = [finite(at) for at in horizon.get("time") or []]
    by_joint = {joint: [finite(level) for level in rms or []] for joint, rms in part(horizon, "rms").items()}
    order = sorted(by_joint, key=lambda joint: -_last(by_joint[joint]))
    curves = [Curve(joint, f"joint{index}", time, by_joint[joint]) for index, joint in enumerate(order[:DRAWN])]
    rest = [Curve("other joints", "quiet", time, by_joint[joint]) for joint in order[DRAWN:]]
    drawn = line_chart(
        [*rest, *reversed(curves)], x="time since the replay began [s]", y="gap / noise", zero=True, mark=1.0
    )
    note = (
        "The simulator starts where the robot was and plays the same commands. A gap that is there at once hints at a "
        "sensor's zero, one that rises and levels off at gains, friction or delay, one that goes on rising at "
        "something that drifts. Gap / noise is over the whole log; the dashed line is the noise."
    )
    return section("How the gap grows", drawn, note=note)


def _last(values: Sequence[Any]) -> float:
    return next((number for value in reversed(values) if (number := finite(value)) is not None), 0.0)


def sides(document: Document) -> Markup | None:
    """Return the joints of the left side against those of the right."""
    rows = [
        (
            read_word(pair, "pair"),
            level(pair.get("left")),
            level(pair.get("right")),
            probability(pair.get("p")),
            _side(pair),
        )
        for pair in sorted(entries(document, "sides"), key=_milder)
    ]
    columns = ("pair", "left", "right", "chance alone", "so")
    note = (
        "Gap / noise of either side, over the moments of the whole log in which both are commanded to move as far, and "
        "how often chance alone makes any pair differ so much. A difference is no fault "
        "yet: the two sides may have moved differently. A fault of one side shows among the causes."
    )
    return section("Left against right", table(columns, rows) if rows else None, note=note)


def _milder(pair: Document) -> float:
    return -max(finite(pair.get("left")) or 0.0, finite(pair.get("right")) or 0.0)


def _side(pair: Document) -> Markup:
    left, right, p = (finite(pair.get(key)) for key in ("left", "right", "p"))
    if left is None or right is None or p is None or p >= 0.05:
        return join("alike")
    if max(left, right) < 1.0:
        return join("both within the noise")
    return element("strong", "worse on the left" if left > right else "worse on the right")
