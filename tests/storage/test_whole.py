"""Files that appear whole or not at all, whatever an earlier process has left."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from gsl.storage.whole import replacing


def test_what_a_killed_process_left_goes_and_what_a_living_one_writes_stays(tmp_path: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    dead = tmp_path / f".[x].json.tmp-{process.pid}"
    living, other = tmp_path / f".[x].json.tmp-{os.getppid()}", tmp_path / f".y.json.tmp-{process.pid}"
    for path in (dead, living, other):
        path.write_text("half")
    with replacing(tmp_path / "[x].json") as temporary:
        temporary.write_text("whole")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([living.name, other.name, "[x].json"])
    assert (tmp_path / "[x].json").read_text() == "whole"
