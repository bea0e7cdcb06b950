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
    sentences: list[Part] = [str(caveat) for caveat in entries(document, "caveats")]
    unseen = entries(document, "invisible")
    if unseen:
        sentences.append(f"This log cannot show: {list_words([name(effect) for effect in unseen], most=99)}.")
    return section("Caveats", bullets(sentences))


def calibration(document: Document) -> Markup | None:
    """Return every joint's own small deviations."""
    slides = document.get("slides") or []
    rows = [
        (
            read_word(row, "joint"),
            _scale(row.get("kp"), 1.0, decimals=3),
            _scale(row.get("kd"), 1.0, decimals=3),
            _scale(row.get("coulomb"), 1.0, decimals=4),
            _scale(row.get("viscous"), 1.0, decimals=4),
            _scale(row.get("zero"), 1000.0 if read_word(row, "joint") in slides else 180.0 / math.pi, decimals=2),
            _scale(row.get("inertia"), 1000.0, decimals=2),
        )
        for row in entries(document, "calibration")
    ]
    columns = (
        *("joint", "kp, factor", "kd, factor"),
        f"Coulomb friction, added [N·m]{', [N]' * bool(slides)}",
        f"viscous friction, added [N·m·s/rad]{', [N·s/m]' * bool(slides)}",
        f"zero of the log [°]{', [mm]' * bool(slides)}",
        f"inertia, added [g·m²]{', [g]' * bool(slides)}",
    )
    note = (
        "What each joint differs by besides, refitted for every explanation, so that none hides in it. Where robot and "
        "simulator are of one make it is small; a gain far from 1 says that the joint or its model is wrong."
    )
    return section("Calibration", table(columns, rows) if rows else None, note=note)


def noise_floor(document: Document) -> Markup | None:
    """Return the noise of each joint's log."""
    floor, slides = part(document, "floor"), document.get("slides") or []
    rows = [
        (
            str(joint),
            _scale(sd, 1000.0, decimals=2),
            NONE if joint in slides else _scale(sd, 180.0 / math.pi, decimals=3),
        )
        for joint, sd in part(floor, "sd").items()
    ]
    thousandths = f"sd [mrad]{', [mm]' * bool(slides)}"
    pairs = floor.get("pairs")
    if floor.get("source") == "repeats":
        note = f"Measured: {pairs or 'some'} repeats of the same commands, and how far their logs differ."
    else:
        note = "Estimated from the roughness of the log: no motion was repeated. Repeats would make it sure."
    return section("Noise floor", table(("joint", thousandths, "sd [°]"), rows) if rows else None, note=note)


def _scale(value: object, factor: float, *, decimals: int) -> str:
    number = finite(value)
    return NONE if number is None else f"{round(factor * number, decimals) + 0.0:.{decimals}f}".replace("-", "−")


def self_test(document: Document) -> Markup | None:
    """Return how the diagnosis did on simulated logs whose cause it was not told."""
    test = part(document, "self_test")
    rows = [
        (name(case.get("truth") or NONE), _answer(case), read_word(case, "count"))
        for case in sorted(entries(test, "confusions"), key=lambda case: read_word(case, "truth"))
    ]
    gain = finite(test.get("null_gain"))
    null, least = "", finite(document.get("least_gain"))
    if gain is not None:
        saved = f"{short(gain)} in cost at most" if gain > 0.0 else "nothing"
        null = f" Where nothing was wrong, chance saved {saved}"
        more = f"; an effect has to save {short(least)}, or to free much of the calibration's cost."
        null += more if least is not None else "."
    return section(
        "Self-test",
        table(("true cause", "answer", "cases"), rows) if rows else None,
        element("p", f"{test.get('cases') or len(rows)} simulated logs of the same commands and noise.{null}")
        if test
        else None,
    )


def _answer(case: Document) -> Markup:
    answer = name(case.get("answer") or NONE)
    return element("span", answer) if case.get("answer") == case.get("truth") else element("strong", f"{answer} ✗")


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


def _describe_verification(check: Document) -> str:
    if not check:
        return ""
    windows, apart = check.get("windows"), short(check.get("chain_rms_mrad"), 2)
    return f"{windows or 'some'} windows: {apart} mrad from the chain model, {level(check.get('rms'))} the noise floor"


def _budget(data: Document) -> str:
    seconds = finite(data.get("seconds"))
    counts = _count(data, (("records", "records"),))
    return ", ".join(filter(None, [counts, f"{seconds:.0f} s of motion" if seconds is not None else ""]))


def _count(data: Document, keys: Sequence[tuple[str, str]]) -> str:
    return ", ".join(f"{data[key]} {words}" for key, words in keys if data.get(key) is not None)


def _describe_make(document: Document) -> Iterable[tuple[str, Part]]:
    command = document.get("command")
    yield "command", element("code", str(command)) if command else None
    yield "the answer in Bullet", _describe_verification(part(document, "verified"))
    world = document.get("world_file")
    yield "corrected simulator", element("code", str(world)) if world else None
