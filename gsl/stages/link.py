"""A link of a chain: one stage that a whole iteration builds as an artifact of its own, or finds as it left it."""

from __future__ import annotations

from pathlib import Path

from gsl.core.console import Console
from gsl.core.described import describe
from gsl.errors import ArtifactError
from gsl.report.headline import headline
from gsl.storage import manifest
from gsl.storage.artifact import Artifact, Stage, build

COMMAND = "gsl iterate"


def build_link(stage: Stage, out: Path, console: Console) -> Artifact:
    """Build one link; what a chain built otherwise in its place, or is damaged, is replaced, nobody else's work is."""
    command, before = f"{COMMAND} ({stage.kind})", _before(out)
    console.begin(stage.kind)
    made = build(stage, config=describe(stage), out=out, command=command, force=bool(before), console=console)
    console.finish(worked=not made.unchanged)
    if before and not made.unchanged:
        console.status(f"{out.as_posix()}: in the place of {before}")
    console.status(f"{out.as_posix()}: {headline(made)}{' (unchanged)' if made.unchanged else ''}")
    return made


def _before(out: Path) -> str:
    """Return what may be replaced, in words; nothing where there is none."""
    try:
        there = manifest.read(out)
    except ArtifactError:
        return "a damaged artifact" if manifest.resembles(out) else ""
    if not there.command.startswith(COMMAND):
        return ""
    return "a damaged artifact" if manifest.find_damage(out, there) else "what a chain with other settings had built"
