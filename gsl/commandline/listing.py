"""The listing of artifacts and the account of one, for `gsl runs` and `gsl show`."""

from __future__ import annotations

import dataclasses
from typing import Any

from gsl.console import Console
from gsl.storage.artifact import Artifact
from gsl.storage.manifest import read
from gsl.storage.references import find_all, resolve


def list_runs(console: Console) -> None:
    """List the complete artifacts below runs/."""
    found = find_all()
    rows = [
        (one.folder.as_posix(), one.manifest.kind, one.manifest.created, f"{one.manifest.duration:.1f} s")
        for one in found
    ]
    if rows:
        console.table("artifacts", ["folder", "kind", "made", "took"], rows)
    documents = [
        {"folder": one.folder, "kind": one.manifest.kind, "created": one.manifest.created, "key": one.manifest.key}
        for one in found
    ]
    console.result({"artifacts": documents}, text="" if rows else "no artifacts below runs/")


def show_artifact(reference: str, console: Console) -> None:
    """Show the manifest, settings and metrics of one artifact.

    Raises:
        ArtifactError: There is no such artifact.
    """
    folder = resolve(reference)
    artifact = Artifact(folder, read(folder))
    made = dataclasses.asdict(artifact.manifest)
    console.result({"folder": folder, "manifest": made, "config": artifact.config, "metrics": artifact.metrics})
    parents = {parent.role: parent.path for parent in artifact.manifest.parents}
    about = {
        "command": artifact.manifest.command,
        "made": artifact.manifest.created,
        "git": artifact.manifest.git,
        **parents,
    }
    console.table(f"{folder}: {artifact.manifest.kind}", ["", "value"], _rows(about))
    console.table("settings", ["setting", "value"], _rows(artifact.config))
    console.table("metrics", ["metric", "value"], _rows(artifact.metrics))
    files = [(name, f"{file.bytes:,}") for name, file in artifact.manifest.files.items()]
    console.table("files", ["file", "bytes"], files)


def _rows(values: Any, path: str = "") -> list[tuple[str, str]]:
    """Return one row a value, with its dotted name."""
    if isinstance(values, dict) and values:
        return [row for key, value in values.items() for row in _rows(value, f"{path}.{key}".lstrip("."))]
    return [(path, f"{values:.6g}" if isinstance(values, float) else str(values))]
