"""Writing checkpoints: the arrays of a fitted model as safetensors, whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.checkpoint import METADATA_KEY, SCHEMA_VERSION, check_finite
from gsl.storage import documents
from gsl.storage.whole import replacing


def write_checkpoint(path: Path, arrays: Mapping[str, np.ndarray], metadata: Mapping[str, Any]) -> None:
    """Write arrays and metadata, whole or not at all; the same model gives the same bytes.

    Args:
        path: File.
        arrays: Weights and scales by name.
        metadata: What is needed to use them, with the `kind` of the model.

    Raises:
        ArtifactError: A number is not finite, as after a fit that diverged.
        GslError: The folder is full or cannot be written.
    """
    from safetensors.numpy import save

    assert isinstance(metadata.get("kind"), str), "a checkpoint says what kind of model it holds"
    check_finite(path, arrays)
    header = documents.text({**metadata, "schema_version": SCHEMA_VERSION})
    ordered = {name: np.asarray(arrays[name], order="C") for name in sorted(arrays)}
    with replacing(path) as temporary:
        temporary.write_bytes(save(ordered, metadata={METADATA_KEY: header}))
