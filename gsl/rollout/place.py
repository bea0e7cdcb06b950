"""Where a worker stands: relative paths are those of the process that sends it a job."""

from __future__ import annotations

import os
import sys
from typing import NamedTuple


class Place(NamedTuple):
    """A folder, and whether modules are imported from it."""

    folder: str
    imports: bool

    @classmethod
    def here(cls) -> Place:
        """Return the place of this process."""
        return cls(os.getcwd(), os.getcwd() in sys.path)

    def enter(self) -> None:
        """Go there, as a worker outlives a change of folder; a machine that has no such folder stays where it is."""
        if os.path.isdir(self.folder):
            os.chdir(self.folder)
        if self.imports and self.folder not in sys.path:
            sys.path.append(self.folder)
