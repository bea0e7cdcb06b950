"""`gsl rerun`: a run once more, from what its folder says of it, into a new place; and whether the same came out."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from gsl.commandline.own_word import find_own_modules, find_trust
from gsl.commandline.rebuild import rebuild
from gsl.core.described import describe
from gsl.errors import ArtifactError, ConfigError
from gsl.report.console import Console
from gsl.storage import manifest
from gsl.storage.artifact import CONFIG, Artifact, build
from gsl.storage.hashing import CIRCUMSTANCES, SHORT
from gsl.storage.references import resolve_main
from gsl.worlds.external import ExternalRobot, asking

AGAIN = "_rerun"
"""What is added to the name of a run."""


def rerun(reference: str, settings: Sequence[str], console: Console) -> int:
    """Build an artifact again and compare; return 1 if another payload comes out.

    Args:
        reference: A path, or the name of a run.
        settings: `out=` where it is built, beside the run by default, and `trust=` the modules of others whose classes
            its settings may name.
        console: Where both are set against each other.

    Raises:
        ArtifactError: There is no such artifact, what it was made from is no longer the same, or the place is taken.
        ConfigError: Its settings do not fit this version of gsl.
    """
    words = dict(word.partition("=")[::2] for word in settings)
    if unknown := sorted(words.keys() - {"out", "trust"}):
        raise ConfigError(unknown[0], "is no setting of gsl rerun, which takes out= and trust=")
    folder = resolve_main(reference)
    old = Artifact(folder, manifest.read(folder))
    manifest.check_intact(folder, old.manifest, only=(CONFIG,))  # other settings would be another run
    damaged = manifest.find_damage(folder, old.manifest)
    place = Path(words["out"]) if words.get("out") else _beside(folder)
    if place.exists():
        raise ArtifactError(place, "exists; take it away or choose another out=")
    trust = find_trust(settings)
    find_own_modules(trust)
    stage, config = _ask_beside(*rebuild(old, trust), folder)
    command = f"gsl rerun {folder.as_posix()}"
    with console.at_work(command):
        new = build(stage, config=config, out=place, command=command, force=False, console=console)
    rows = list(_compare(old, new))
    other = [name for name, _, same in rows if not same]
    document = {"folder": place, "differs": other, "compared": [name for name, _, _ in rows]}
    console.table(
        f"{folder.as_posix()} and {place.as_posix()}",
        ["what", "sha256", ""],
        [(name, sha[:SHORT], "the same" if same else "differs") for name, sha, same in rows],
    )
    if not other and damaged:
        said = f"{manifest.damage(folder, damaged)}; {place.as_posix()} holds what was made"
        return console.error(said, 1, command="gsl rerun")
    if not other:
        console.result(document, text=place.as_posix())
        return 0
    if console.json:
        console.result({**document, "exit_code": 1})
        return 1
    message = f"{place.as_posix()}: another payload than {folder.as_posix()}: {', '.join(other)}{_why(old, new)}"
    return console.error(message, 1, command="gsl rerun")


def _ask_beside(stage: Any, config: dict[str, Any], folder: Path) -> tuple[Any, dict[str, Any]]:
    """Return both with the requests of a real robot where gsl writes them, whatever the settings say."""
    for name in [field.name for field in fields(stage) if isinstance(getattr(stage, field.name), ExternalRobot)]:
        world = asking(getattr(stage, name), folder)
        stage, config = replace(stage, **{name: world}), {**config, name: describe(world)}
    return stage, config


def _beside(folder: Path) -> Path:
    run = folder.absolute().parent
    return Path(os.path.relpath(run.with_name(run.name + AGAIN) / folder.name))


def _compare(old: Artifact, new: Artifact) -> Iterator[tuple[str, str, bool]]:
    """Yield the name and new hash of each file of the payload and each artifact beside it, and if it is the same."""
    before, after = (
        {name: file.sha256 for name, file in artifact.manifest.files.items() if Path(name).name not in CIRCUMSTANCES}
        | {link.path: link.hash for link in artifact.manifest.links}
        for artifact in (old, new)
    )
    for name in sorted(before.keys() | after.keys()):
        yield name, after.get(name, "none"), before.get(name) == after.get(name)


def _why(old: Artifact, new: Artifact) -> str:
    """Return what of the software has changed since."""
    now, before = new.manifest.versions, old.manifest.versions
    changed = [f"{name} {was} -> {now.get(name)}" for name, was in before.items() if now.get(name) != was]
    if old.manifest.sources != new.manifest.sources:
        changed.append("gsl's sources")
    return f" (since then: {', '.join(changed)})" if changed else ""
