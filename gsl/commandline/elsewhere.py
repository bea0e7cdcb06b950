"""matplotlib reads a file of the folder that it is imported in, which may be a stranger's: it is imported elsewhere."""

from __future__ import annotations

import contextlib
import importlib.util
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

from gsl.version import PACKAGE

NAME = "matplotlib"


def import_elsewhere() -> None:
    """Have matplotlib, once it is needed, imported as if gsl had been typed in its own folder."""
    if NAME not in sys.modules:
        sys.meta_path.insert(0, _Elsewhere())


class _Elsewhere(MetaPathFinder):
    """Finds matplotlib once, as others do, with a loader that works in another folder."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Return its spec; nothing of other modules."""
        if name != NAME:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.loader is not None:
            load = spec.loader.exec_module

            def exec_module(module: ModuleType) -> None:
                with contextlib.chdir(PACKAGE):
                    load(module)

            spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec
