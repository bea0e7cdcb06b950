"""Ctrl-C and SIGTERM end every stage with one line and 130; nothing half-written stays, and no worker."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from itertools import cycle
from pathlib import Path

import pytest
from commands import PROGRESS, eventually, gsl, session, started

pytestmark = pytest.mark.slow

FOREVER = {
    "collect": ("episodes=2000",),
    "train-forward": ("data=chain/collect_real", "model=mlp", "model.epochs=1000000", "model.patience=1000000"),
    "optimize": ("grounding=none", "rollouts=500"),
    "iterate": ("grounding=gat", "budget.real_episodes=2000"),
    "compare": ("iterate.budget.rollouts=500",),
}
STOPS = signal.SIGINT, signal.SIGTERM
WORKERS = {"collect": "workers=2", "optimize": "workers=2", "iterate": "workers=2",
           "compare": "iterate.workers=2"}  # fmt: skip


def stopped(stage: str, stop: signal.Signals, chain: Path, out: Path) -> str:
    """Start a stage, wait until it works, stop it, and return what it says when it and its workers are gone."""
    settings = (*FOREVER[stage], *filter(None, [WORKERS.get(stage)]), f"out={out}/it", f"name={out.name}")
    with started(stage, *settings, folder=chain) as process:
        expected = 4 if stage in WORKERS else 1
        assert eventually(lambda: any(out.iterdir()) and len(session(process.pid)) >= expected), process.poll()
        time.sleep(0.4)
        assert gsl("collect", f"out={out}/it", folder=chain).lines == [
            f"gsl collect: {out}/it: another process is building it; wait for it or choose another out="
        ]
        for pause in (0.0, 0.02, 0.15):  # an impatient user, or `timeout`, says it more than once
            time.sleep(pause)
            with suppress(ProcessLookupError):
                if stop == signal.SIGINT:
                    os.killpg(process.pid, stop)  # as a terminal does it
                else:
                    process.send_signal(stop)
        _, said = process.communicate(timeout=30)
        assert process.returncode == 130, said
        assert eventually(lambda: not session(process.pid), seconds=5.0), "workers are left"
    return said


@pytest.mark.parametrize(("stage", "stop"), [*zip(FOREVER, cycle(STOPS)), ("collect", STOPS[1])])  # noqa: B905
def test_a_stage_that_is_stopped_leaves_nothing(stage: str, stop: signal.Signals, chain: Path, tmp_path: Path) -> None:
    said = stopped(stage, stop, chain, tmp_path)
    lines = [line for line in said.splitlines() if not (line.startswith("fitting ") or PROGRESS.search(line))]
    estimates = [line for line in lines if " rollouts at most: about " in line or line.startswith("about ")]
    longest = {"optimize": 1, "iterate": 1, "compare": 1}  # of long work; it may be stopped before
    assert len(estimates) <= longest.get(stage, 0)
    lines = [line for line in lines if line not in estimates]
    assert lines == [f"gsl {stage}: interrupted; what is complete stays, and the same command does the rest"]
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []
    assert not (chain / "runs" / tmp_path.name).exists()


def test_an_interruption_waits_until_a_library_is_imported() -> None:
    """One within torch's import is an exception in its C++, which aborts the process (seen once)."""
    importing = """
import os, signal
from gsl.core.interruption import hold_interrupts, listen
listen()
try:
    with hold_interrupts():
        os.kill(os.getpid(), signal.SIGINT)
        print("imported")
    print("went on")
except KeyboardInterrupt:
    print("interrupted")
"""
    done = subprocess.run([sys.executable, "-c", importing], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["imported", "interrupted"]


def test_a_semaphore_that_an_interruption_leaves_is_nobodys_worry() -> None:
    """Its last thread can be stopped between removing it and saying so (seen once, on a busy machine)."""
    leaving = """
from gsl.core.interruption import processes_starting
from joblib.externals.loky.backend import resource_tracker
with processes_starting():
    pass
resource_tracker.register("/gsl-removed-already", "semlock")
"""
    left = subprocess.run([sys.executable, "-c", leaving], capture_output=True, text=True, check=True)
    assert (left.stdout, left.stderr) == ("", "")


def test_after_kill_9_no_worker_stays_and_the_artifact_can_be_built(chain: Path, tmp_path: Path) -> None:
    with started("collect", *FOREVER["collect"], "workers=2", f"out={tmp_path}/it", folder=chain) as process:
        assert eventually(lambda: len(session(process.pid)) >= 4)
        time.sleep(1.0)
        process.kill()
        process.wait()
        assert eventually(lambda: not session(process.pid), seconds=60.0)
    quick = ("episodes=1", "neighbours=0", "task.duration=0.1", "workers=1")
    assert gsl("collect", *quick, f"out={tmp_path}/it", folder=chain).code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["it"]


EARLY = """
import os, signal, sys

class Finder:
    def find_spec(self, name, *more):
        if name == "gsl.cli":
            os.kill(os.getpid(), getattr(signal, sys.argv[1]))

sys.meta_path.insert(0, Finder())
import gsl.__main__
gsl.__main__.main()
"""


@pytest.mark.parametrize("stop", ["SIGINT", "SIGTERM"])
def test_an_interruption_before_anything_is_loaded_is_one_line(stop: str) -> None:
    said = subprocess.run([sys.executable, "-c", EARLY, stop], capture_output=True, text=True, check=False)
    assert (said.returncode, said.stdout, said.stderr) == (130, "", "gsl: interrupted before it began\n")
