"""The listing of artifacts and the account of one, for `gsl runs` and `gsl show`."""

from __future__ import annotations

import dataclasses
import os
import sys
import webbrowser
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gsl.commandline.choose_runs import Choice, Run, choose, find_deeper
from gsl.commandline.words import split_words
from gsl.core.validation import make
from gsl.core.words import size
from gsl.errors import ArtifactError, InputError
from gsl.report.account import account, flat, plain
from gsl.report.console import Console
from gsl.report.headline import headline, title_in_unit
from gsl.storage.artifact import Artifact
from gsl.storage.hashing import PAGE, SHORT
from gsl.storage.identity import content_hash
from gsl.storage.lineage import REFRESH, out_of_date
from gsl.storage.manifest import (
    Manifest,
    Parent,
    check_files,
    check_intact,
    damage,
    describe_damage,
    find_damage,
    read,
    strange_files,
)
from gsl.storage.references import RUNS, find_all, find_damaged, resolve_main


def list_runs(words: Sequence[str], console: Console) -> None:
    """List the complete artifacts below runs/, those that fit the settings.

    Args:
        words: Settings, as they were typed (`choose_runs.Choice`).
        console: Where they are listed.

    Raises:
        ConfigError: A setting is wrong.
    """
    choice = make(Choice, split_words(words, "runs"))
    for folder in find_damaged():
        console.status(f"{folder.as_posix()}: its manifest cannot be read; gsl verify says why")
    artifacts = find_all()
    chosen, metric = choose(artifacts, choice, datetime.now(UTC))
    titles = {title_in_unit(metric, run.unit) for run in chosen} if metric else set()
    title = titles.pop() if len(titles) == 1 else metric
    columns = ["reference", "kind", "made", "took", *([title] if title else []), "result"]
    rows = [(*_facts(run), *_value(run, metric, title), headline(run.artifact)) for run in chosen]
    heading = f"artifacts below {RUNS}/" + (f": {len(chosen)} of {len(artifacts)}" if words else "")
    deeper = find_deeper(metric, [Run(artifact) for artifact in artifacts]) if metric else []
    if rows:
        console.table(heading, columns, rows, f"other artifacts have {', '.join(deeper[:3])}" if deeper else None)
    empty = f"none of the {len(artifacts)} artifacts below {RUNS}/ fits" if artifacts else "no artifacts below runs/"
    console.result({"artifacts": [_document(run, metric) for run in chosen]}, text="" if rows else empty)


def _value(run: Run, metric: str | None, title: str | None) -> list[str]:
    """Return the cell of a metric, with its unit where not all rows have the same one."""
    if not metric:
        return []
    value, unit = plain(run.figures[metric]), run.unit.name
    return [value if title_in_unit(metric, run.unit) == title else f"{value} {unit}"]


def _facts(run: Run) -> tuple[str, str, str, str]:
    made = run.artifact.manifest
    return run.name, made.kind, _local(made.created), _span(made)


def _document(run: Run, metric: str | None) -> dict[str, Any]:
    made = run.artifact.manifest
    document = {
        "folder": run.artifact.folder,
        "kind": made.kind,
        "created": made.created,
        "duration": made.duration,
        "key": made.key,
        "headline": headline(run.artifact),
    }
    return {**document, "metric": {metric: run.metrics[metric]}} if metric else document


def show_artifact(reference: str, console: Console) -> int:
    """Show how an artifact came about, its results, settings and files; return 1 if it is not as it was made.

    Raises:
        ArtifactError: There is no such artifact.
    """
    folder = resolve_main(reference)
    artifact = Artifact(folder, read(folder))
    made = dataclasses.asdict(artifact.manifest)
    damaged = find_damage(folder, artifact.manifest)
    if damaged is None:
        console.result({"folder": folder, "manifest": made, "config": artifact.config, "metrics": artifact.metrics})
    title = f"{folder.as_posix()}: {artifact.manifest.kind}"
    console.table(title, ["", ""], list(_origin(artifact.manifest)), headline(artifact) or None)
    if artifact.manifest.parents:
        parents = [_parent(folder, parent) for parent in artifact.manifest.parents]
        console.table("made from", ["role", "what", "contents", "now"], parents)
    with suppress(*[ArtifactError] * bool(damaged)):
        for line in account(artifact):
            console.table(*line)
        rows = [_setting(name, value) for name, value in artifact.config.items() if not name.startswith("_")]
        console.table("settings", ["setting", "value"], rows)
    files = [(name, size(file.bytes), file.sha256[:SHORT]) for name, file in artifact.manifest.files.items()]
    state = f"{damaged} {describe_damage(folder, damaged)}" if damaged else "all files are as they were made"
    if strange := next(strange_files(folder, artifact.manifest), None):
        state += f"; {strange} is no file of it"
    console.table("files", ["file", "size", "sha256"], files, state)
    if stale := out_of_date(folder):
        console.status(f"warning: {stale}; {REFRESH}")
    if damaged is None:
        return 0
    return console.error(str(damage(folder, damaged)), 1, command="gsl show")


def open_artifact(reference: str, console: Console) -> None:
    """Open the page of an artifact in a browser, and say where it is; a run of several stages may have one page above.

    Raises:
        ArtifactError: There is no such artifact, it has no page, or that was changed since it was written.
    """
    above = list((RUNS / reference).glob(f"[!.]*/{PAGE}"))
    folder = above[0].parent if len(above) == 1 else resolve_main(reference)
    page, stored = folder / PAGE, read(folder)
    if not (page.is_file() or PAGE in stored.files):
        raise ArtifactError(folder, f"has no page: {stored.kind} writes none; gsl show says what is in it")
    check_files(folder, stored, (PAGE,))
    check_intact(folder, stored)
    shown = has_display() and webbrowser.open(page.absolute().as_uri())
    console.result({"page": page, "opened": shown}, text=page.as_posix())


def has_display() -> bool:
    """Whether a browser can show something here: a text browser in the terminal would take the terminal."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _origin(manifest: Manifest) -> Iterator[tuple[str, str]]:
    git = manifest.git or {}
    dirty = " with changes" if git.get("dirty") else ""
    commit = f", commit {str(git['commit'])[:SHORT]}{dirty}" if git.get("commit") else ""
    yield "command", manifest.command
    yield "made", f"{_local(manifest.created)}, in {_span(manifest)}"
    yield "by", f"gsl {manifest.versions.get('gsl')}{commit}, Python {manifest.versions.get('python')}"
    if manifest.seeds:
        yield "seeds", ", ".join(f"{name} {seed}" for name, seed in manifest.seeds.items())
    yield "key", manifest.key[:SHORT]
    yield "contents", manifest.contents[:SHORT]


def _parent(folder: Path, parent: Parent) -> tuple[str, str, str, str]:
    place = Path(os.path.relpath(folder / parent.path))
    return parent.role, place.as_posix(), parent.hash[:SHORT], _state(place, parent.hash)


def _state(place: Path, expected: str) -> str:
    try:
        same = "the same" if content_hash(place) == expected else "built anew since"
        return f"{same}, but {stale}" if (stale := out_of_date(place)) else same
    except InputError:
        return "damaged" if place.exists() else "not here"


def _setting(name: str, value: Any) -> tuple[str, str]:
    """Return one row a setting; a component is told by its class and its settings."""
    if not isinstance(value, Mapping):
        return name, plain(value)
    kind = str(value.get("_target_", "")).rpartition(".")[2]
    inside = {key: entry for key, entry in value.items() if key != "_target_"}
    inner = [f"{key}={plain(entry)}" for key, entry in flat(inside) if key]
    return name, " ".join([kind, *inner]).strip()


def _local(created: str) -> str:
    """Return a moment in coordinated universal time as one of this place."""
    return datetime.fromisoformat(created).astimezone().strftime("%Y-%m-%d %H:%M:%S")


def _span(manifest: Manifest) -> str:
    seconds = manifest.duration
    if seconds < 100.0:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} min" if seconds < 6000.0 else f"{seconds / 3600:.1f} h"
