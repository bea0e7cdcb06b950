"""What a stranger can do: an artifact that he has changed and whose hashes are right."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gsl.storage import manifest
from gsl.storage.hashing import file_hash
from gsl.storage.manifest import HASH, hash_entries


def seal(artifact: Path, *, more: Sequence[str] = (), **entries: Any) -> None:
    """Write a manifest as a stranger would: all hashes are right, those of `more` files included."""
    stored = json.loads((artifact / manifest.NAME).read_text())
    files = {
        name: {"sha256": file_hash(artifact / name), "bytes": (artifact / name).stat().st_size}
        for name in (*stored["files"], *more)
    }
    stored = {key: value for key, value in stored.items() if key != HASH} | {"files": files} | entries
    (artifact / manifest.NAME).write_text(json.dumps({**stored, HASH: hash_entries(stored)}))
