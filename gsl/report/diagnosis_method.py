"""What a diagnosis rests on: data, noise floor, calibration, its own test, and what it cannot see."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from markupsafe import Markup

from gsl.report.diagnosis_words import NONE, Document, entries, finite, level, list_words, name, part, read_word, short
from gsl.report.parts import Part, bullets, element, facts, section, table

_ENGINES = {"chain": "chain model, robot in the air", "bullet": "Bullet, with the ground"}


def caveats(document: Document) -> Markup | None:
    """Return what to be careful with."""
    told: list[Part] = [str(caveat) for caveat in entries(document, "caveats")]
    unseen = entries(document, "invisible")
    if unseen:
        told.append(f"This log cannot show: {list_words([name(effect) for effect in unseen], most=99)}.")
    return section("Caveats", bullets(told))


def calibration(document: Document) -> Markup | None:
    """Return every joint's own small deviations."""
    rows = [
        (
            read_word(one, "joint"),
            _scale(one.get("kp"), 1.0, decimals=3),
            _scale(one.get("kd"), 1.0, decimals=3),
            _scale(one.get("coulomb"), 1.0, decimals=4),
            _scale(one.get("viscous"), 1.0, decimals=4),
            _scale(one.get("zero"), 180.0 / math.pi, decimals=2),
            _scale(one.get("inertia"), 1000.0, decimals=2),
        )
        for one in entries(document, "calibration")
    ]
    columns = (
        *("joint", "kp, factor", "kd, factor", "Coulomb friction, added [N·m]", "viscous friction, added [N·m·s/rad]"),
        "zero of the log [°]",
        "inertia, added [g·m²]",
    )
    note = (
        "What each joint differs by besides, refitted for every explanation, so that none hides in it. Where robot and "
        "simulator are of one make it is small; a gain far from 1 says that the joint or its model is wrong."
    )
    return section("Calibration", table(columns, rows) if rows else None, note=note)


def noise_floor(document: Document) -> Markup | None:
    """Return the noise of each joint's log."""
    found = part(document, "floor")
    rows = [
        (str(joint), _scale(sd, 1000.0, decimals=2), _scale(sd, 180.0 / math.pi, decimals=3))
        for joint, sd in part(found, "sd").items()
    ]
    pairs = found.get("pairs")
    if found.get("source") == "repeats":
        note = f"Measured: {pairs or 'some'} repeats of the same commands, and how far their logs differ."
    else:
        note = "Estimated from the roughness of the log: no motion was repeated. Repeats would make it sure."
    return section("Noise floor", table(("joint", "sd [mrad]", "sd [°]"), rows) if rows else None, note=note)


def _scale(value: object, factor: float, *, decimals: int) -> str:
    number = finite(value)
    return NONE if number is None else f"{round(factor * number, decimals) + 0.0:.{decimals}f}".replace("-", "−")


def self_test(document: Document) -> Markup | None:
    """Return how the diagnosis did on simulated logs whose cause it was not told."""
    found = part(document, "self_test")
    rows = [
        (name(one.get("truth") or NONE), _answer(one), read_word(one, "count"))
        for one in sorted(entries(found, "confusions"), key=lambda one: read_word(one, "truth"))
    ]
    gain = finite(found.get("null_gain"))
    null = (
        f" Where nothing was wrong, chance saved {short(gain)} in cost at most; an effect has to save 1.3 times that."
        if gain is not None
        else ""
    )
    return section(
        "Self-test",
        table(("true cause", "answer", "cases"), rows) if rows else None,
        element("p", f"{found.get('cases') or len(rows)} simulated logs of the same commands and noise.{null}")
        if found
        else None,
    )


def _answer(one: Document) -> Markup:
    told = name(one.get("answer") or NONE)
    return element("span", told) if one.get("answer") == one.get("truth") else element("strong", f"{told} ✗")


def method(document: Document) -> Markup | None:
    """Return the data, the split and the command."""
    data = part(document, "data")
    note = (
        "Recorded commands are replayed in the simulator in short windows: it starts where the robot was, some ticks "
        "are not scored, the next ones are. Whatever was fitted was fitted on the training records only."
    )
    return section("How this was measured", facts([*_data(data), *_describe_make(document)]), note=note)


def _data(data: Document) -> Iterable[tuple[str, Part]]:
    yield "robot", str(data.get("robot") or "")
    yield "simulator", str(data.get("sim") or "")
    yield "real data", _budget(data)
    yield "split", _count(data, (("train", "records to fit"), ("held_out", "held out"), ("windows", "windows")))
    yield "recorded in", str(data.get("source") or "")
    yield "reference", str(data.get("reference") or "")
    engine = str(data.get("engine") or "")
    yield "replayed by", _ENGINES.get(engine, engine)


def _describe_verified(found: Document) -> str:
    if not found:
        return ""
    windows, apart = found.get("windows"), short(found.get("chain_rms_mrad"), 2)
    return f"{windows or 'some'} windows: {apart} mrad from the chain model, {level(found.get('rms'))} the noise floor"


def _budget(data: Document) -> str:
    seconds = finite(data.get("seconds"))
    told = _count(data, (("records", "records"),))
    return ", ".join(filter(None, [told, f"{seconds:.0f} s of motion" if seconds is not None else ""]))


def _count(data: Document, keys: Sequence[tuple[str, str]]) -> str:
    return ", ".join(f"{data[key]} {words}" for key, words in keys if data.get(key) is not None)


def _describe_make(document: Document) -> Iterable[tuple[str, Part]]:
    command = document.get("command")
    yield "command", element("code", str(command)) if command else None
    yield "the answer in Bullet", _describe_verified(part(document, "verified"))
    world = document.get("world_file")
    yield "corrected simulator", element("code", str(world)) if world else None
