"""What all test modules share: one small chain of all stages, made once by the real command line."""

from __future__ import annotations

import gc
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from filelock import FileLock
from torture import chain as all_stages

SLOW = re.compile(r"^pytestmark = (\[\s*)?pytest\.mark\.slow\b", re.MULTILINE)  # a module that `make quick` leaves out

gc.set_threshold(50_000, 20, 20)  # else a tenth of the time goes by looking through the objects of all libraries


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import no slow module where its tests are left out: that takes a tenth of the time of `make quick`."""
    if config.option.markexpr != "not slow" or collection_path.suffix != ".py":
        return None
    return SLOW.search(collection_path.read_text("utf-8")) is not None or None


@pytest.fixture(scope="session")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which every single stage has run, as runs/chain; nobody may change anything in it for good.

    The first worker of pytest-xdist that asks makes it. The others take a copy, so that nobody sees what is changed for
    a moment.
    """
    mine = tmp_path_factory.mktemp("chain")
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return all_stages(mine)
    shared = tmp_path_factory.getbasetemp().parent / "chain"
    with FileLock(f"{shared}.lock"):
        if shared.exists():
            return shutil.copytree(shared, mine, dirs_exist_ok=True)
        shutil.copytree(all_stages(mine), shared)
        return mine


@pytest.fixture(scope="session", autouse=True)
def _logs_of_sb3(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Stable-Baselines3 makes a folder for its log in /tmp wherever a model learns without a logger of ours."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SB3_LOGDIR", str(tmp_path_factory.mktemp("sb3")))
        yield
