"""Hydra, opened on our configuration: a process has one, and a program around gsl may have it open already."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

from hydra import initialize_config_dir
from hydra.core.config_search_path import ConfigSearchPath, SearchPathQuery
from hydra.core.global_hydra import GlobalHydra
from hydra.initialize import get_gh_backup, restore_gh_from_backup
from hydra.plugins.search_path_plugin import SearchPathPlugin

from gsl.commandline.plugins import folders
from gsl.commandline.yaml_files import USER, BudgetedFiles, check_folder, load_plugins
from gsl.core.configuration import configuration_folder

_alone = threading.RLock()


class OtherConfiguration(SearchPathPlugin):
    """Puts the user's folder of yaml files before ours, so that a file of the same name wins, and plugins' behind."""

    folder: ClassVar[Path | None] = None
    ours: ClassVar[bool] = False  # whether hydra is open for gsl, and not for a program around it

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """Add the folders that there are."""
        if not self.ours:
            return
        if self.folder is not None:
            search_path.prepend(USER, f"file://{self.folder}", anchor=SearchPathQuery(provider="main"))
        for folder in folders():
            search_path.append(f"gsl-{folder.parent.name}", f"file://{folder}")


@contextmanager
def open_hydra(config_dir: Path | None) -> Iterator[None]:
    """Open hydra on our configuration and, in front of it, the user's; one thread at a time.

    A program around gsl that has hydra open, finds it as it was.

    Raises:
        InputError: The user's folder does not exist, or is an artifact whose yaml files are not as they were written.
    """
    if config_dir is not None:
        check_folder(config_dir)
    with _alone:
        around, before = get_gh_backup(), (OtherConfiguration.ours, OtherConfiguration.folder)
        GlobalHydra.instance().clear()
        OtherConfiguration.ours = True
        OtherConfiguration.folder = config_dir.resolve() if config_dir is not None else None
        try:
            load_plugins().register(OtherConfiguration)
            with BudgetedFiles.in_place_of_hydras():
                opening = initialize_config_dir(
                    config_dir=str(configuration_folder()), version_base="1.3", job_name="gsl"
                )
            with opening:
                yield
        finally:
            OtherConfiguration.ours, OtherConfiguration.folder = before
            restore_gh_from_backup(around)
