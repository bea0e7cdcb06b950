"""What several test modules share: one small chain of all stages, made by the real command line."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import SMALL, done


@pytest.fixture(scope="session")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which every single stage has run, as runs/chain; nobody may change anything in it for good."""
    folder = tmp_path_factory.mktemp("chain")
    for role in ("real", "sim"):
        done("collect", f"role={role}", "name=chain", *SMALL, folder=folder)
    done("train-forward", "name=chain", "model=linear", folder=folder)
    done("train-inverse", "name=chain", folder=folder)
    done("optimize", "name=chain", *SMALL, "grounding=gat", "accept=true", folder=folder)
    done("evaluate", "name=chain", *SMALL, folder=folder)
    return folder
