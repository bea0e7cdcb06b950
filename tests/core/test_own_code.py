"""Whose fault a failure is: a user's own code is named with its place, ours is an internal error."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from gsl.core.own_code import describe_own


@pytest.mark.parametrize("package", ["gsl.core", "gsl_experiments", "gsl_benchmarks.blind"])
def test_a_failure_in_one_of_our_packages_is_no_users_own(package: str, tmp_path: Path) -> None:
    assert describe_own(_fail(tmp_path, f"{package}.module")) is None
    line = describe_own(_fail(tmp_path, "mine.module"))
    assert line == "mine.module.<module> failed (module.py, line 1): ZeroDivisionError: division by zero"


def _fail(folder: Path, name: str) -> ZeroDivisionError:
    (folder / "module.py").write_text("1 / 0\n")
    with pytest.raises(ZeroDivisionError) as failure:
        runpy.run_path(str(folder / "module.py"), run_name=name)
    trace = failure.value.__traceback__
    while trace is not None and trace.tb_frame.f_code.co_filename != str(folder / "module.py"):
        trace = trace.tb_next
    return failure.value.with_traceback(trace)
