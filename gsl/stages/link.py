"""A link of a chain: one stage that a whole iteration builds as an artifact of its own, or finds as it left it."""

from __future__ import annotations

from pathlib import Path

from gsl.core.console import Console
from gsl.core.described import described
from gsl.errors import ArtifactError
from gsl.report.headline import headline
from gsl.storage import manifest
from gsl.storage.artifact import Artifact, Stage, build

COMMAND = "gsl iterate"


def built(stage: Stage, out: Path, console: Console) -> Artifact:
    """Build one link; what an earlier chain built otherwise in its place is replaced, what anyone else built is not."""
    command, ours = f"{COMMAND} ({stage.kind})", _ours(out)
    made = build(stage, config=described(stage), out=out, command=command, force=ours, console=console)
    if ours and not made.unchanged:
        console.status(f"{out.as_posix()}: in the place of what a chain with other settings had built")
    console.status(f"{out.as_posix()}: {headline(made)}{' (unchanged)' if made.unchanged else ''}")
    return made


def _ours(out: Path) -> bool:
    try:
        return manifest.read(out).command.startswith(COMMAND)
    except ArtifactError:
        return False
