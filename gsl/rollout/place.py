"""Where a worker stands: relative paths, and modules of a user's own, are those of the process that sends it a job."""

from __future__ import annotations

import os
import sys
from typing import NamedTuple


class Place(NamedTuple):
    """A folder, and where modules are imported from."""

    folder: str
    path: tuple[str, ...]

    @classmethod
    def here(cls) -> Place:
        """Return the place of this process."""
        return cls(os.getcwd(), tuple(sys.path))

    def enter(self) -> None:
        """Go there, as a worker outlives a change of folder."""
        self._go()
        sys.path[:] = self.path

    def enter_elsewhere(self) -> None:
        """Go there on a machine that may have no such folder, and has packages of its own."""
        self._go()
        if self.folder in self.path and self.folder not in sys.path:
            sys.path.append(self.folder)

    def _go(self) -> None:
        if os.path.isdir(self.folder):
            os.chdir(self.folder)
