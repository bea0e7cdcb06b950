"""A page on paper: nothing is folded up, and a heading stays with its picture."""

from pathlib import Path

import numpy as np
from browser import DESK, browser

from gsl.report.joint_trace import Traces
from gsl.report.parts import fold, prose
from gsl.report.run_page import Answer, joints, write_page


def test_paper_shows_what_is_folded_up_and_keeps_a_choice_with_its_picture(tmp_path: Path) -> None:
    time = np.arange(0.0, 0.8, 0.02)
    traces = joints({"knee": Traces(time, time, time, time, time)}, "Replayed.")
    write_page(tmp_path, Answer("Is it?", "It is.", sure=True), [traces, fold("all settings", prose("kp: 3"))])
    high = "document.querySelector('details').getBoundingClientRect().height"
    with browser() as shown:
        shown.open(tmp_path / "report.html", DESK)
        folded = shown.value(high)
        shown.print()
        assert shown.value(high) > folded
        assert shown.value("getComputedStyle(document.querySelector('[data-choice]')).breakInside") == "avoid"
