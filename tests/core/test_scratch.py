"""Temporary folders go with their process, or when the next one starts."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

MAKING = """
import os, signal, sys
from gsl.core.scratch import Scratch
folder = Scratch()
print(folder.name, flush=True)
if len(sys.argv) > 1:
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_the_folder_of_a_killed_process_goes_with_the_next(tmp_path: Path) -> None:
    def made(*arguments: str) -> Path:
        command = [sys.executable, "-c", MAKING, *arguments]
        done = subprocess.run(command, env={"TMPDIR": str(tmp_path), "PYTHONPATH": ":".join(sys.path)}, stdout=-1)
        return Path(done.stdout.decode().strip())

    (tmp_path / "gsl-of-somebody").mkdir()
    left = made("die")
    assert left.is_dir()
    assert not made().exists()
    assert [path.name for path in tmp_path.iterdir()] == ["gsl-of-somebody"]
