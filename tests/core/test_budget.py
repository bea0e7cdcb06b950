"""The budget of CPU ends what takes too long, wherever that is."""

import sys
import time

import pytest

from gsl.core.budget import within
from gsl.errors import InputError


def spin(seconds: float) -> None:
    """Be busy for longer than a tick."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


class Slow:
    """Takes a while to be freed, where Python swallows what is raised."""

    def __del__(self) -> None:
        """Be busy."""
        spin(0.3)


def test_a_budget_that_runs_out_in_a_finaliser_ends_the_work_after_it_and_shows_no_traceback(
    capfd: pytest.CaptureFixture[str],
) -> None:
    shown = sys.unraisablehook
    with pytest.raises(InputError, match="freeing takes more than 0.1 s of CPU"), within("freeing", 0.1):
        Slow()
        spin(1.0)
    assert capfd.readouterr().err == "" and sys.unraisablehook is shown
