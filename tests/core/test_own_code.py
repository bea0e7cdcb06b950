"""Whose fault a failure is: a user's own code is named with its place, ours is an internal error."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from commands import ENVIRONMENT, forget_modules, gsl

from gsl.core.own_code import describe_own

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("package", ["gsl.core", "gsl_experiments", "gsl_benchmarks.blind"])
def test_a_failure_in_one_of_our_packages_is_no_users_own(package: str, tmp_path: Path) -> None:
    assert describe_own(_fail(tmp_path, f"{package}.module")) is None
    line = describe_own(_fail(tmp_path, "mine.module"))
    assert line == "mine.module.<module> failed (module.py, line 1): ZeroDivisionError: division by zero"


EXITS = """import sys
from dataclasses import dataclass
from gsl.policies.walk_engine import WalkEngine

@dataclass(frozen=True)
class Mine(WalkEngine):
    def start(self, parameters, layout):
        sys.exit(0)
"""


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_work_that_a_users_own_code_ends_has_failed(workers: int, tmp_path: Path) -> None:
    (tmp_path / "exits.py").write_text(EXITS)
    words = ("collect", "policy._target_=exits.Mine", "preset=toy", "task.duration=1.6", f"workers={workers}")
    if workers == 1:
        code, _, said = gsl(*words, "name=refused", folder=tmp_path)
        forget_modules(tmp_path)
    else:  # workers of an earlier test stand in another folder
        line = [sys.executable, "-m", "gsl", *words, "name=refused"]
        ended = subprocess.run(line, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=False)
        code, said = ended.returncode, ended.stderr
    assert code == 1
    wanted = "gsl collect: exits.Mine.start failed (exits.py, line 8): SystemExit: 0"
    assert said.splitlines()[-1].startswith(wanted)


def _fail(folder: Path, name: str) -> ZeroDivisionError:
    (folder / "module.py").write_text("1 / 0\n")
    with pytest.raises(ZeroDivisionError) as failure:
        runpy.run_path(str(folder / "module.py"), run_name=name)
    trace = failure.value.__traceback__
    while trace is not None and trace.tb_frame.f_code.co_filename != str(folder / "module.py"):
        trace = trace.tb_next
    return failure.value.with_traceback(trace)
