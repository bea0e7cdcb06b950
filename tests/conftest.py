"""What several test modules share: one small chain of all stages, made by the real command line."""

from __future__ import annotations

from pathlib import Path

import pytest
from torture import chain as all_stages


@pytest.fixture(scope="session")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which every single stage has run, as runs/chain; nobody may change anything in it for good."""
    return all_stages(tmp_path_factory.mktemp("chain"))
