"""A file of records, one JSON object a line, that only grows: each ends with a hash of itself and of all before it.

A damaged line, and what follows it, is cut off: what is left is what was written, to the bit.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gsl.core.budget import ARTIFACT_BYTES, open_file
from gsl.storage.whole import flush

CHAIN = "chain"
"""Key of the hash in a record."""


class Records:
    """The records of a file, in order.

    Args:
        path: The file; it need not exist yet.
        say: Is told in a line what was cut off.
    """

    def __init__(self, path: Path, say: Callable[[str], None]) -> None:
        self._path, self._chain = path, ""
        self.records: list[dict[str, Any]] = []
        stored, good = b"", 0
        if path.exists():
            with open_file(path, ARTIFACT_BYTES) as file:
                stored = file.read()
        for line in stored.splitlines(keepends=True):
            if (record := self._parse(line)) is None:
                break
            self._take(record, line)
            good += len(line)
        if good < len(stored):
            os.truncate(path, good)
            what = f"{len(stored) - good:,} of its {len(stored):,} bytes are damaged or incomplete and cut off"
            say(f"{path.name}: {what}; the work goes on after record {len(self.records)}")

    def append(self, record: Mapping[str, Any]) -> None:
        """Add a record, on disk before anything goes on."""
        line = self._line(record)
        new = not self._path.exists()
        with self._path.open("ab") as file:
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
        if new:
            flush(self._path.parent)
        self._take(dict(record), line)

    def _take(self, record: dict[str, Any], line: bytes) -> None:
        self.records.append(record)
        self._chain = hashlib.sha256(line).hexdigest()

    def _line(self, record: Mapping[str, Any]) -> bytes:
        """Return the line of the next record; the line before, which ends with a hash itself, is part of its hash."""
        chain = hashlib.sha256(f"{self._chain}{json.dumps(record)}".encode()).hexdigest()
        return (json.dumps({**record, CHAIN: chain}) + "\n").encode()

    def _parse(self, line: bytes) -> dict[str, Any] | None:
        """Return the record of a line, None if it is not what was written."""
        try:
            record = json.loads(line)
            del record[CHAIN]
            return record if self._line(record) == line else None
        except (ValueError, TypeError, KeyError, RecursionError):
            return None
