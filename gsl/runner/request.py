"""A request: what has to be run on a real robot, as one JSON document that carries its own hash."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from gsl.core.budget import read_json
from gsl.core.layout import Layout
from gsl.core.trust import TARGET, check_code, class_of
from gsl.errors import ArtifactError
from gsl.runner.plausible import request_problem

NAME = "request.json"
SCHEMA_VERSION = 1
GROUND, HELD = "on the ground", "held in the air"


def hash_of(request: Mapping[str, Any]) -> str:
    """Return the hash of a request, whatever hash it carries; the order of its entries counts."""
    text = json.dumps({key: value for key, value in request.items() if key != "hash"})
    return hashlib.sha256(text.encode()).hexdigest()


def read_request(folder: Path, trust: Collection[str] = ()) -> dict[str, Any]:
    """Return the request of a folder; its policy is one of gsl's, or of a module that is trusted.

    Raises:
        ArtifactError: There is none, it is of another version, or it was changed.
        ConfigError: Its policy is code of somebody else.
    """
    request = read_stored(folder)
    if any("commands" not in episode for episode in request["episodes"]):
        policy = request.get("policy")
        check_code(policy, trust, "policy")
        class_of(policy.get(TARGET) if isinstance(policy, Mapping) else None, "policy")
    return request


def read_stored(folder: Path) -> dict[str, Any]:
    """Return the request of a folder to be compared with another; who acts on it needs `read_request`.

    Raises:
        ArtifactError: There is none, it is of another version, or it was changed.
    """
    path = folder / NAME
    try:
        request = read_json(path)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise ArtifactError(folder, f"is no request: it holds no {NAME}") from error
    except ValueError as error:
        raise ArtifactError(path, "is damaged: it is not JSON; take it anew from where it was made") from error
    version = request.get("schema_version") if isinstance(request, dict) else None
    if version != SCHEMA_VERSION:
        raise ArtifactError(path, f"schema_version {version!r} is unknown; {SCHEMA_VERSION} is known here")
    if request.get("hash") != hash_of(request):
        raise ArtifactError(path, "was changed after it was written; take it anew from where it was made")
    if problem := request_problem(request):
        raise ArtifactError(path, f"{problem}; take it anew from where it was made")
    return dict(request)


def layout_of(request: Mapping[str, Any], more: Mapping[str, int] | None = None) -> Layout:
    """Return what an observation holds, with further parts of the robot's own behind it."""
    return Layout(tuple(request["joints"]), {**request["observes"], **(more or {})}, request["control_period"])


def due(request: Mapping[str, Any], done: Collection[str], fallen: Collection[str]) -> Iterator[Mapping[str, Any]]:
    """Yield the episodes that are still to be run: after a fall of a policy no more of it where that is asked for.

    Args:
        request: Of the episodes.
        done: Names of those that were run.
        fallen: Names of those that ended in a fall.
    """
    down: set[str] = set()
    for episode in request["episodes"]:
        if request["until_fall"] and episode["policy"] in down:
            continue
        if episode["name"] in fallen:
            down.add(episode["policy"])
        if episode["name"] not in done:
            yield episode
