"""What to do after a diagnosis: a sentence and, where there is one, a command line each."""

from __future__ import annotations

import shlex
from pathlib import PurePosixPath
from typing import NamedTuple

from gsl.report.diagnosis_verdict import needs_calibration, verdict
from gsl.report.diagnosis_words import Document, entries, level, list_words, name, part, read_word

NOTHING = "no effect"  # as a document has it, beside an effect that the log cannot show


class Step(NamedTuple):
    """Something to do.

    Attributes:
        why: What it is and what it is good for.
        command: To type, if there is one; several are lines.
        more: What only the page has room for.
    """

    why: str
    command: str = ""
    more: str = ""


def steps(document: Document) -> list[Step]:
    """Return what to do, most important first: the document's `commands` if it has some."""
    commands = entries(document, "commands")
    if commands:
        return [Step(str(entry.get("why") or ""), str(entry.get("command") or "")) for entry in commands]
    if verdict(document) == "wiring":
        return [*_mending(document), Step("Import again, and let gsl audit look once more.")]
    first = {"no_gap": _as_it_is, "causes": _advise_correction, "inseparable": _either, "unknown": _advise_learning}[
        verdict(document)
    ]
    experiment = _experiment(document)
    if verdict(document) == "inseparable":
        return [*experiment, first(document)]
    return [first(document), *(experiment or (_surer(document) if verdict(document) == "causes" else []))]


def _mending(document: Document) -> list[Step]:
    remedies = dict.fromkeys(read_word(finding, "remedy") for finding in entries(document, "wiring"))
    return [Step(remedy) for remedy in remedies if remedy]


def _as_it_is(document: Document) -> Step:
    if needs_calibration(document):
        before, after = (level(part(document, "shrinkage")[key]) for key in ("before", "after"))
        advice = f"Train in the calibrated simulator{_place(document)}{_yours(document)}: "
        far = f"as it is, it is {before} the noise floor from the robot, calibrated {after}."
        return Step(advice + far, _training(document))
    advice = "Train in the simulator as it is: as far as this log shows, it is the robot."
    return Step(advice) if _own(document) else Step(advice, "gsl optimize grounding=none")


def _advise_correction(document: Document) -> Step:
    advice = f"Train in the simulator with the effects switched on{_place(document)}{_yours(document)}"
    far = [read_word(gap, "part") for gap in entries(document, "unexplained")]
    mind = f", not where it is still far from the robot: {', '.join(far)}" if far else ""
    return Step(f"{advice}{mind}.", _training(document))


def _surer(document: Document) -> list[Step]:
    """What would make unsure causes surer, where no experiment of ours does."""
    return [
        Step(f"To be surer of {name(cause['effect'])}, which is confused with {cause['confused']}.")
        for cause in entries(document, "causes")
        if cause.get("confused")
    ]


def _either(document: Document) -> Step:
    advice = "Until then train with one of them on: whichever it is, it predicts as well"
    return Step(f"{advice}{_place(document)}{_yours(document)}.", _training(document))


def _yours(document: Document) -> str:
    """What no command can name of a robot that is not the default one."""
    return ", with a task and a policy of yours" if _own(document) else ""


def _place(document: Document) -> str:
    world = document.get("world_file")
    if not world:
        return ""
    return f" ({world})" if _folder(document) != "." else f" ({world}, in the folder of this report)"


def _folder(document: Document) -> str:
    """The folder of configuration in which the corrected world lies, nothing if it is not one."""
    path = PurePosixPath(str(document.get("world_file") or ""))
    return str(path.parent.parent) if path.parent.name == "world" and path.suffix == ".yaml" else ""


def _training(document: Document) -> str:
    folder, world = _folder(document), PurePosixPath(str(document.get("world_file"))).stem
    chosen = f"--config-dir {shlex.quote(folder)} {shlex.quote(f'world={world}')}"
    return f"gsl optimize {chosen} grounding=none name=diagnosed" if folder and not _own(document) else ""


def _advise_learning(document: Document) -> Step:
    servo = bool(entries(document, "forms"))  # a law of each servo explains it, so a servo can be learned
    learn = f"Let a {'servo' if servo else 'grounding'} learn what no effect explains"
    grounding = "effects_servo" if servo else "gat"
    if _own(document):
        return Step(f"{learn}: `gsl iterate grounding={grounding}` with your worlds, task and policy.")
    return Step(f"{learn}, and check it.", f"gsl iterate grounding={grounding}")


def _own(document: Document) -> Document:
    """Return what commands have to name of a robot that is not the default one."""
    return part(document, "own")


def _experiment(document: Document) -> list[Step]:
    wanted = part(document, "next_experiment")
    if not wanted:
        return []
    groups = wanted.get("separates") or []
    pairs = [list_words([name(effect) for effect in group], "from") for group in groups if NOTHING not in group]
    unseen = [name(effect) for group in groups if NOTHING in group for effect in group if effect != NOTHING]
    aim = (
        f" to tell {list_words(pairs)}"
        if pairs
        else f" to see {list_words(unseen)}, which this log cannot show"
        if unseen
        else ""
    )
    play = f"Play {wanted.get('excitation') or 'the next experiment'} on the robot{aim}"
    file, more = wanted.get("file"), str(wanted.get("why") or "")
    if not file:
        return [Step(f"{play}.", more=more)]
    lines = (
        f"gsl collect {_robot(document)}task=excite {shlex.quote(f'policy.file={file}')} name=next",
        _again(document),
    )
    return [Step(f"{play}, and diagnose again.", "\n".join(lines), more)]


def _robot(document: Document) -> str:
    """The real robot as the world of a command, which asks for it (docs/howto/real-robot.md)."""
    own = _own(document)
    if not own:
        return ""
    about = (
        f"world.robot={own['robot']}",
        "world.floating=false",
        f"world.period={own['period']:g}",
        "world.sensors=[]",
    )
    return f"world=robot {' '.join(map(shlex.quote, about))} "


def _again(document: Document) -> str:
    """The same diagnosis of what the next experiment records."""
    try:
        words = shlex.split(str(document.get("command") or ""))
    except ValueError:
        words = []
    kept = [word for word in words[2:] if not word.startswith(("real=", "name=", "out=", "force="))]
    own, folder = _own(document), _folder(document)
    sim = ["--config-dir", folder, f"sim={own['world']}"] if own and folder else []
    return shlex.join(["gsl", "diagnose", *sim, "real=next/collect_real", *kept, "name=next"])
