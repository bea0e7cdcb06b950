"""The identity of a piece of work: the key that says whether it has to be done again, and what changed when it has."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gsl.storage import documents, manifest
from gsl.storage.hashing import file_hash, sources_hash
from gsl.storage.manifest import Manifest

SHOWN_CHANGES = 3
SHOWN_CHARACTERS = 40


@dataclass(frozen=True)
class Identity:
    """What determines the result of a stage.

    Attributes:
        kind: What the stage makes.
        settings: Its settings by dotted name, without those that say where a parent lies.
        parents: Hash of each parent's contents by role.
        sources: Hash of gsl's sources, and of the stage's package.
    """

    kind: str
    settings: Mapping[str, Any]
    parents: Mapping[str, str]
    sources: str

    @property
    def key(self) -> str:
        """Hash of all of it."""
        return hashlib.sha256(json.dumps(vars(self), sort_keys=True).encode()).hexdigest()

    @property
    def seeds(self) -> dict[str, int]:
        """The seeds among the settings by dotted name."""
        named = {name: value for name, value in self.settings.items() if name.rpartition(".")[2].endswith("seed")}
        return {name: value for name, value in named.items() if isinstance(value, int)}


MADE = ("forward_model", "inverse_model", "diagnosis", "servo", "model")
"""Settings that name a part of a grounding; a chain puts what it makes itself in their place."""
WITHOUT_EFFECT = ("workers", "requests", "trust")  # settings of components on which no result depends


def identify(
    kind: str,
    config: Mapping[str, Any],
    parents: Mapping[str, Path],
    package: Path | None = None,
    made: Sequence[str] = (),
) -> Identity:
    """Return the identity of a stage; parents enter by role and contents, so that folders can move.

    A setting says where a parent lies when its dotted name is the parent's role, or when its text is the parent's path.
    One below a name of `made` says where a part lies that the stage makes itself.
    The sources are gsl's, and those of the `package` that the stage comes from if that is another one.
    """
    places = {os.path.abspath(path) for path in parents.values()}
    settings = {
        name: value
        for name, value in flat(without(documents.plain(config), lambda name, _: name in WITHOUT_EFFECT)).items()
        if not (
            isinstance(value, str) and (name in parents or os.path.abspath(value) in places or _list_made(name, made))
        )
    }
    hashes = {role: content_hash(path) for role, path in parents.items()}
    return Identity(kind, settings, hashes, sources_hash(package))


def _list_made(name: str, below: Sequence[str]) -> bool:
    return name.rpartition(".")[2] in MADE and any(name.startswith(f"{part}.") for part in below)


def without(part: Any, idle: Callable[[str, Any], bool]) -> Any:
    """Return components as plain data without their idle settings; plain mappings, as an environment's, keep theirs.

    Args:
        part: Components, nested, each a mapping with a `_target_`.
        idle: Says of a component's setting, by name and value, whether it is left out.
    """
    if isinstance(part, dict):
        component = "_target_" in part
        return {key: without(value, idle) for key, value in part.items() if not (component and idle(key, value))}
    return [without(entry, idle) for entry in part] if isinstance(part, list) else part


def content_hash(path: Path) -> str:
    """Return the hash of a parent's contents: an intact artifact's folder or a plain file.

    Raises:
        ArtifactError: It is neither, or a file of the artifact was changed after it was written.
    """
    if path.is_file():
        return file_hash(path)
    stored = manifest.read(path)
    manifest.check_intact(path, stored)
    return stored.contents


def flat(value: Any, prefix: str = "") -> dict[str, Any]:
    """Return nested settings by dotted name, entries of lists by their number."""
    if not isinstance(value, (dict, list)) or not value:
        return {prefix: value}
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    leaves: dict[str, Any] = {}
    for name, entry in entries:
        leaves |= flat(entry, f"{prefix}.{name}" if prefix else str(name))
    return leaves


def changes(old: Manifest, old_config: Any, new: Identity, new_config: Any) -> str:
    """Return in words what sets the work `new` apart from the artifact `old`."""
    if old.kind != new.kind:
        return f"it holds {old.kind}, not {new.kind}"
    hidden = flat(documents.plain(new_config)).keys() - new.settings.keys()
    before = {name: value for name, value in flat(documents.plain(old_config)).items() if name not in hidden}
    words = _list_changes(before, new.settings)
    hashes = {parent.role: parent.hash for parent in old.parents}
    roles = sorted(hashes.keys() | new.parents.keys())
    others = [f"the data of {role}" for role in roles if hashes.get(role) != new.parents.get(role)]
    words += others[:SHOWN_CHANGES]
    if len(others) > SHOWN_CHANGES:
        words[-1] += f" and {len(others) - SHOWN_CHANGES} more"
    if old.sources != new.sources or not words:
        words.append("gsl itself")
    return "changed: " + ", ".join(words)


def _list_changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    names = [name for name in [*new, *sorted(old.keys() - new.keys())] if _show(old, name) != _show(new, name)]
    words = [f"{name} {_short(_show(old, name))} -> {_short(_show(new, name))}" for name in names[:SHOWN_CHANGES]]
    return [*words, f"{len(names) - SHOWN_CHANGES} more settings"] if len(names) > SHOWN_CHANGES else words


def _show(settings: Mapping[str, Any], name: str) -> str:
    return str(settings[name]).replace("\n", " ") if name in settings else "(none)"


def _short(words: str) -> str:
    return words if len(words) <= SHOWN_CHARACTERS else words[: SHOWN_CHARACTERS - 1] + "…"
