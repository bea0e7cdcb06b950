"""What a diagnosis says in sentences: the verdict, where the gap lies, how far it shrinks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gsl.report.diagnosis_words import (
    NONE,
    Document,
    between,
    entries,
    finite,
    level,
    list_words,
    name,
    part,
    probability,
    read_word,
    regime,
    scope,
    share,
)

GROUPS = 3  # that the headline names
NEARER = 0.5  # share of the gap, below which a calibration has to take it to be advised
NEARLY = 0.95  # share of the gap that the nearest effects explain, from which on only a rest has no name
CLEAR = 2.0  # noise floors from which on a calibration is no detail
VERDICTS = ("no_gap", "causes", "inseparable", "unknown", "wiring")


def verdict(document: Document) -> str:
    """Return one of the verdicts; what is not one is `unknown`."""
    word = document.get("verdict")
    return word if word in VERDICTS else "unknown"


def headline(document: Document) -> str:
    """Return the verdict in a line."""
    sentences = {"no_gap": _no_gap, "causes": _causes, "inseparable": _inseparable, "wiring": _wiring}
    return sentences.get(verdict(document), _unknown)(document)


def _wiring(document: Document) -> str:
    findings = entries(document, "wiring")
    kinds = dict.fromkeys(read_word(finding, "kind") for finding in findings)
    return f"Wiring, before any physics: {list_words(list(kinds))}"


def _no_gap(document: Document) -> str:
    calibrated = " and a calibration of each joint" if needs_calibration(document) else ""
    return f"No gap beyond the noise{calibrated}"


def needs_calibration(document: Document) -> bool:
    """Whether the simulator as it is is clearly off the robot, and much nearer with its calibration."""
    before, after = (finite(part(document, "shrinkage").get(key)) or 0.0 for key in ("before", "after"))
    return before > CLEAR and after < NEARER * before


def _causes(document: Document) -> str:
    names = [cause_name(cause) for cause in entries(document, "causes")]
    if not names:
        return "There is a gap, and its cause was found"
    if document.get("sure", True):
        return f"{'Cause' if len(names) == 1 else f'{len(names)} causes'} found: {list_words(names)}"
    how = "possible" if document.get("doubt") == "possibly" else "probable"
    return f"{f'{how.capitalize()} cause' if len(names) == 1 else f'{len(names)} {how} causes'}: {list_words(names)}"


def _inseparable(document: Document) -> str:
    groups = [alternatives(group) for group in entries(document, "inseparable")]
    sentence = "There is a gap, but this log cannot tell its possible causes apart"
    return f"{sentence}: {list_words(groups, most=GROUPS)}" if groups else sentence


def summary(document: Document) -> str:
    """Return what the summary says besides the headline and the list of causes; nothing where it is no more."""
    return "" if verdict(document) in ("inseparable", "unknown") else str(document.get("summary") or "")


def list_open_groups(document: Document) -> list[str]:
    """Return the groups of effects that cannot be told apart and that stand in no headline above a list of causes."""
    groups = entries(document, "inseparable")[GROUPS if entries(document, "causes") else 0 :]
    return [f"{alternatives(group)}: this log cannot tell which" for group in groups]


def _unknown(document: Document) -> str:
    if document.get("verdict") != "unknown":
        return "No verdict"
    gone = finite(part(document, "shrinkage").get("nearest_fraction")) or 0.0
    return f"There is a gap, and no effect that we know explains {'all of it' if gone >= NEARLY else 'it'}"


def cause_name(cause: Document) -> str:
    """Return an effect, where it acts, and what else was chosen of it (the side of a joint's limit, say)."""
    where = cause.get("scope")
    acts = scope(cause.get("joints") if where is None else where)
    if exempt := entries(cause, "exempt"):
        acts = f"all joints but {list_words(list(map(str, exempt)))}"
    chosen = [
        f"{name(key)} {choice}"
        for key, choice in part(cause, "fixed").items()
        if isinstance(choice, str) and choice != where
    ]
    words = " of ".join(filter(None, [name(cause.get("effect") or NONE), acts]))
    return f"{words} ({', '.join(chosen)})" if chosen else words


def nearest(document: Document) -> str:
    """Return the effects that come nearest where none explains the gap; nothing if there are none."""
    return list_words([cause_name(cause) for cause in entries(document, "suspects")])


def alternatives(group: Sequence[str]) -> str:
    """Return effects of which one log cannot say which it is."""
    return list_words([name(effect) for effect in group], "or")


def sureness(cause: Document) -> str:
    """Return how sure a cause is and how much of what a calibration leaves comes back without it."""
    gain = part(cause, "gain")
    words = []
    if finite(cause.get("probability")) is not None:
        words.append(f"{probability(cause['probability'])} sure")
    if finite(gain.get("value")) is not None:
        bounds = between(gain, share)
        back = f"{share(gain['value'])} of what a calibration leaves comes back without it"
        words.append(back + (f" ({bounds})" if bounds else ""))
    return ", ".join(words)


class Place(NamedTuple):
    """A joint that stands out of the noise.

    Attributes:
        joint: Its name.
        cell: As a whole, also where only a regime of it stands out.
        when: Its worst regime in words, with its multiple of the noise; nothing if there is none.
    """

    joint: str
    cell: Document
    when: str


def places(document: Document) -> list[Place]:
    """Return the joints that stand out of the noise, as a whole or in some regime, worst first."""
    cells = sorted(entries(document, "where"), key=lambda cell: -(finite(cell.get("share")) or 0.0))
    places = []
    for joint in dict.fromkeys(read_word(cell, "joint") for cell in cells):
        own = [cell for cell in cells if read_word(cell, "joint") == joint]
        whole = next((cell for cell in own if cell.get("regime") == "all"), own[0])
        named = [cell for cell in own if cell.get("named")]
        worst = next((cell for cell in named if cell is not whole), None)
        when = f"{regime(read_word(worst, 'regime'))}, {level(worst.get('rms'))}" if worst else ""
        places += [Place(joint, whole, when)] if named else []
    return sorted(places, key=lambda place: -(finite(place.cell.get("share")) or 0.0))


def where_sentence(document: Document) -> str:
    """Return where the gap lies."""
    named = places(document)
    if not named:
        return "No joint stands out of the noise."
    of = len({read_word(cell, "joint") for cell in entries(document, "where")})
    whole = [place for place in named if place.cell.get("named")]
    parts = [f"{place.joint} when {place.when}" for place in named if place not in whole]
    within = " The others are not significantly beyond the noise." if of > len(named) else ""
    only = f" Significantly beyond the noise only at times: {list_words(parts)}." if parts else ""
    if not whole:
        return f"No joint stands out as a whole.{only}{within}"
    first, *others = (f"{place.joint} {share(place.cell.get('share'))}" for place in whole)
    when = f" (most when {whole[0].when})" if whole[0].when else ""
    count = f"In {len(whole)} of {of} joints: " if of > 1 else ""
    return f"{count}{list_words([f'{first} of the excess{when}', *others])}.{only}{within}"


def shrinkage_sentence(document: Document) -> str:
    """Return how far the gap shrinks on records that no fit has seen."""
    figures = part(document, "shrinkage")
    before, after, gone = (finite(figures.get(key)) for key in ("before", "after", "fraction"))
    if before is None:
        return "Not measured."
    if verdict(document) == "no_gap" or after is None:
        return f"The simulator is at {level(before)} the noise floor, measured on held-out records."
    sentence = f"From {level(before)} to {level(after)} the noise floor on held-out records"
    bounds = between(figures, share)
    return sentence + (
        f": {share(gone)} of the excess is gone{f' ({bounds})' if bounds else ''}." if gone is not None else "."
    )


def comparison_sentence(document: Document) -> str:
    """Return what calibration alone and a law of each servo do; nothing if neither was measured."""
    figures, sentences = part(document, "shrinkage"), []
    if finite(figures.get("calibration")) is not None:
        sentences.append(f"Calibration alone leaves {level(figures['calibration'])}.")
    if finite(figures.get("ceiling_fraction")) is not None:
        sentences.append(f"With a learned law of each servo on top, {share(figures['ceiling_fraction'])} are gone.")
    return " ".join(sentences)
