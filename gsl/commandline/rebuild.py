"""The stage of an artifact once more, from what its folder says of it; a run that was moved still finds its parents."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gsl.core.described import restore
from gsl.core.interfaces import SIM
from gsl.errors import ArtifactError
from gsl.grounding.preparation import without_margins
from gsl.rollout.rollout import Scenario
from gsl.storage.artifact import CONFIG, Artifact
from gsl.storage.identity import content_hash
from gsl.storage.lineage import COPY, REPEAT, absence


def rebuild(artifact: Artifact, trust: Sequence[str]) -> tuple[Any, dict[str, Any]]:
    """Return the stage that made an artifact, and its settings with the parents where they lie now.

    Args:
        artifact: What it made.
        trust: Modules that are not gsl's and whose classes its settings may name.

    Raises:
        ArtifactError: A parent is gone or no longer what the artifact was made from, or the settings name no stage.
        ConfigError: Its settings do not fit this version of gsl.
    """
    config = artifact.config
    for parent in artifact.manifest.parents:
        source = Path(os.path.relpath(artifact.folder / parent.path))
        if not source.exists():
            raise ArtifactError(source, f"{absence(artifact.folder)}; {COPY}")
        if content_hash(source) != parent.hash:
            raise ArtifactError(source, f"is no longer what {artifact.folder.as_posix()} was made from; {REPEAT}")
        _move(config, parent.role.split("."), source)
    stage = restore(config, trust=trust)
    if not (hasattr(stage, "parents") and hasattr(stage, "run")):
        raise ArtifactError(
            artifact.folder / CONFIG, "names no stage; it is not as gsl wrote it, build the artifact again"
        )
    return stage, config


def rebuild_search(searched: Artifact, trust: Sequence[str]) -> tuple[Scenario, Scenario]:
    """Return the plain simulator of a search with its grounding, and what both became; errors as those of `rebuild`."""
    search, _ = rebuild(searched, trust)
    plain = Scenario(search.world, search.task, search.policy, SIM, without_margins(search.grounding))
    return plain, plain.prepare(searched.metrics)


def _move(settings: Any, role: list[str], source: Path) -> None:
    """Let a setting that says where a parent lies say where it lies now; a name, as of a robot or a class, stays."""
    *above, name = role
    if name == "_target_":
        return
    for part in above:
        settings = _entry(settings, part)
    before = _entry(settings, name)
    if isinstance(before, str) and ("/" in before or Path(before).suffix):
        settings[int(name) if isinstance(settings, list) else name] = source.as_posix()


def _entry(settings: Any, name: str) -> Any:
    if isinstance(settings, Mapping):
        return settings.get(name)
    if isinstance(settings, list) and name.isdigit() and int(name) < len(settings):
        return settings[int(name)]
    return None
