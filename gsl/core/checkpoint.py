"""Reading checkpoints: the arrays of a fitted model as safetensors, which load without executing anything."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.budget import NETWORK_BYTES, check_file, parse_json
from gsl.errors import ArtifactError

SCHEMA_VERSION = 1
METADATA_KEY = "gsl"


def read_checkpoint(path: Path, *, kind: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Read the arrays and the metadata of a checkpoint.

    Raises:
        ArtifactError: It is missing, truncated, foreign, of another version or kind, or a number is not finite.
    """
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise ArtifactError(path, "there is no such checkpoint")
    check_file(path, NETWORK_BYTES)
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = _metadata(path, file.metadata(), kind)
            arrays = {name: file.get_tensor(name) for name in sorted(file.keys())}
    except (SafetensorError, OSError, TypeError, ValueError, AttributeError) as error:  # types that numpy lacks
        raise ArtifactError(path, "is not a checkpoint, or truncated or damaged; train the model again") from error
    check_finite(path, arrays)
    return arrays, metadata


def _metadata(path: Path, header: Mapping[str, str] | None, kind: str) -> dict[str, Any]:
    if header is None or METADATA_KEY not in header:
        raise ArtifactError(path, "is not a checkpoint of gsl: it has no metadata under the key `gsl`")
    try:
        metadata: dict[str, Any] = parse_json(header[METADATA_KEY])
    except ValueError as error:
        raise ArtifactError(path, "is damaged: its metadata are not JSON; train the model again") from error
    version = metadata.pop("schema_version", None) if isinstance(metadata, dict) else None
    if version != SCHEMA_VERSION:
        raise ArtifactError(path, f"schema_version {version!r} is unknown; this gsl reads {SCHEMA_VERSION}")
    if metadata.get("kind") != kind:
        raise ArtifactError(path, f"holds {metadata.get('kind')}, but {kind} is needed")
    return metadata


def check_finite(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Refuse arrays that hold a number that is not finite."""
    for name, values in arrays.items():
        if not np.isfinite(values).all():
            raise ArtifactError(path, f"{name} holds a number that is not finite; train the model again")
