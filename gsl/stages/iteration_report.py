"""What a person looks at after `iterate`: the table, the learning curve and one joint's traces."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def write_report(folder: Path, iterate: Any, done: list, ungrounded: Any, console: Any) -> None:
    """Write the report."""
