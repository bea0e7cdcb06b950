"""The figures of a report: what is drawn are the numbers that were given."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from gsl.core.statistics import mean_interval
from gsl.report.grounding_errors import grounding_errors, grounding_errors_figure
from gsl.report.joint_trace import Traces, joint_trace, joint_trace_figure
from gsl.report.learning_curve import Point, Search, learning_curve, learning_curve_figure, points, search
from gsl.report.style import GAT, SGAT, spread
from gsl_experiments.budget_curve import Line, budget_curve_figure
from gsl_experiments.noise_bars import Bars, noise_bars_figure
from gsl_experiments.noise_curve import Curve, noise_curve_figure
from gsl_experiments.trial_dots import Dots, trial_dots_figure

PI0 = {"name": "pi0", "generation": None, "value_sim": None, "value": 0.19, "interval": [0.18, 0.20], "falls": 0}
STABLE = {
    "name": "generation_01",
    "generation": 1,
    "value_sim": 0.25,
    "value": 0.21,
    "interval": [0.20, 0.22],
    "falls": 0,
}
FALLEN = {
    "name": "generation_02",
    "generation": 2,
    "value_sim": 0.30,
    "value": 0.0,
    "interval": [None, None],
    "falls": 1,
}
AGAIN = {**STABLE, "value": 0.205, "interval": [0.195, 0.215]}
EVALUATION = {"policies": [PI0, STABLE, FALLEN], "check": [AGAIN], "confirmation": [PI0, AGAIN]}
SEARCH = search("iteration 1", EVALUATION, shown=100.0, returned="generation_01")
TIME = np.arange(0.0, 1.5, 0.02)
TRACES = Traces(TIME, np.sin(TIME), np.sin(TIME - 0.1), np.sin(TIME), np.sin(TIME - 0.1) + math.radians(2.0))
ERRORS = {
    "of π0": {"ungrounded": {"a": 3.0, "b": 4.0}, "grounded": {"a": 1.0, "b": 1.0}, "no_change": {"a": 9.0, "b": 5.0}},
    "off π0": {"ungrounded": {"a": 2.0, "b": 2.0}, "grounded": {"a": 3.0, "b": 3.0}, "no_change": {"a": 8.0, "b": 4.0}},
}


def lines(axes: object) -> dict[str, tuple[list[float], list[float]]]:
    """Labelled lines as they were drawn."""
    return {line.get_label(): tuple(map(list, line.get_data())) for line in axes.get_lines()}  # type: ignore[attr-defined]


def test_points_are_the_rows_of_an_evaluation_in_the_unit_that_is_shown() -> None:
    start, stable, fallen = points(EVALUATION["policies"], shown=100.0)
    assert start == Point(0, None, 19.0, 18.0, 20.0, 0)
    assert stable == Point(1, 25.0, 21.0, 20.0, 22.0, 0)
    assert fallen == Point(2, 30.0, 0.0, -math.inf, math.inf, 1)


def test_a_policy_that_falls_after_the_choice_has_fallen() -> None:
    later = search("iteration 1", {**EVALUATION, "check": [{**STABLE, "falls": 1}]}, shown=100.0)
    assert [(point.falls, point.later) for point in later.points] == [(0, 0), (0, 1), (1, 0)]
    axes = learning_curve_figure([later], unit="cm/s", title="t").axes[0]
    assert lines(axes)["fell later"] == ([1], [21.0])


def test_the_returned_policy_is_shown_as_it_was_measured_again() -> None:
    assert SEARCH.confirmed == pytest.approx(Point(1, 25.0, 20.5, 19.5, 21.5, 0))
    assert search("iteration 1", EVALUATION, returned="pi0").confirmed is None


def test_a_learning_curve_shows_values_and_falls() -> None:
    axes = learning_curve_figure([SEARCH], unit="cm/s", title="t").axes[0]
    drawn = lines(axes)
    assert axes.get_ylabel() == "value [cm/s]"
    assert drawn["simulation"] == ([1, 2], [25.0, 30.0])
    assert drawn["real"] == ([0, 1], [19.0, 21.0])
    assert drawn["fell"][0] == [2]
    assert drawn["fell"][1][0] < 18.0  # below every value
    assert drawn["π0"][1] == [19.0, 19.0]
    assert drawn["measured again"][1] == [20.5]


def test_a_learning_curve_has_its_title_and_a_panel_of_each_search() -> None:
    title = "Real side: 20.5 cm/s with grounding, 20.5 without, π0 19.0; the gain is not significant"
    figure = learning_curve_figure([SEARCH, Search("no grounding", SEARCH.points)], unit="cm/s", title=title)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["iteration 1", "no grounding"]
    assert figure.get_suptitle() == title
    head, right = figure.texts[0].get_window_extent(), figure.bbox.x1
    assert head.x1 < right


def test_the_start_is_drawn_where_the_table_has_it() -> None:
    fresh = {**PI0, "value": 0.185}
    drawn = search("iteration 1", {**EVALUATION, "confirmation": [fresh, AGAIN]}, shown=100.0, returned="generation_01")
    assert drawn.points[0].real == pytest.approx(18.5)


def test_what_is_not_drawn_takes_no_room() -> None:
    fell = Point(1, None, 13.0, -150.0, 410.0, 1)
    whole = [Point(0, None, 20.0, 19.5, 20.5, 0), fell, Point(2, None, 22.0, 21.0, 23.0, 0)]
    (axes,) = learning_curve_figure([Search("x", whole)], unit="cm/s", title="t").axes
    assert axes.get_ylim()[0] > 15.0 and axes.get_ylim()[1] < 30.0


def test_nothing_that_is_stable_is_drawn_too() -> None:
    fallen = [Point(generation, None, 0.0, -math.inf, math.inf, 1) for generation in range(3)]
    learning_curve_figure([Search("bad", fallen)], unit="cm/s", title="t")


def test_a_trace_is_in_degrees_and_says_how_far_off_the_simulators_are() -> None:
    figure = joint_trace_figure(TRACES, "LKneePitch")
    drawn = lines(figure.axes[0])
    np.testing.assert_allclose(drawn["command"][1], np.degrees(TRACES.command))
    np.testing.assert_allclose(drawn["real"][1], np.degrees(TRACES.real))
    assert "grounded simulation,\n2.0° from real" in drawn
    assert figure.axes[0].get_ylabel() == "LKneePitch [°]"
    assert "with grounding 2.0° from the real robot" in figure.get_suptitle()


def test_a_trace_does_without_grounding() -> None:
    assert len(lines(joint_trace_figure(TRACES._replace(grounded=None), "LKneePitch").axes[0])) == 3


def test_errors_are_bars_joint_by_joint() -> None:
    figure = grounding_errors_figure(ERRORS)
    bars = {bars.get_label(): [bar.get_height() for bar in bars] for bars in figure.axes[0].containers}
    assert bars == {"no change at all": [9.0, 5.0], "simulator": [3.0, 4.0], "grounded simulator": [1.0, 1.0]}
    assert [label.get_text() for label in figure.axes[1].get_xticklabels()] == ["a", "b"]
    assert (
        figure.get_suptitle() == "Grounding takes the joint error from 3.54° to 1.00° of π0, from 2.00° to 3.00° off π0"
    )


def test_every_trial_is_a_dot_and_a_failed_one_is_hollow() -> None:
    panels = {"a world": {"none": Dots([3.0, -1.0], [False, True]), "gat": Dots([9.0, 8.0], [False, False])}}
    (axes,) = trial_dots_figure(panels, axis="improvement [%]", title="t").axes
    dots = [line for line in axes.lines if line.get_marker() == "o"]
    drawn = sorted((float(x), int(y)) for line in dots for x, y in zip(*line.get_data(), strict=True))
    assert drawn == [(-1.0, 0), (3.0, 0), (8.0, 1), (9.0, 1)]
    hollow = [line.get_xdata()[0] for line in dots if len(line.get_xdata()) and line.get_markerfacecolor() == "white"]
    assert hollow == [-1.0]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["none", "gat"]


def test_trials_that_came_out_alike_are_all_seen() -> None:
    panels = {"a world": {"none": Dots([3.0, 3.0, 3.01, 9.0], [False] * 4), "gat": Dots([0.0] * 10, [False] * 10)}}
    (axes,) = trial_dots_figure(panels, axis="improvement [%]", title="t").axes
    few, many = [line.get_ydata() for line in axes.lines if line.get_marker() == "o" and len(line.get_xdata())]
    assert sorted(few) == [-0.13, 0.0, 0.0, 0.13]
    assert len(np.unique(many)) == 10 and np.ptp(many) < 0.61


def test_a_method_has_one_colour_in_all_figures() -> None:
    from matplotlib.colors import to_hex

    intervals = [mean_interval([1.0, 2.0])] * 2
    budget = budget_curve_figure({"p": {name: Line((1, 2), intervals) for name in ("sgat", "gat")}}, {}, "t").axes[0]
    noise = noise_curve_figure({name: Curve((0.1, 0.2), intervals) for name in ("gat", "sgat")}, {}, "t").axes[0]
    values = {name: [(1.0, 0.1)] for name in ("gat", "sgat")}
    bars = noise_bars_figure({"w": Bars(("0.5",), values)}, "none", title="t", along="noise").axes[0]
    drawn = [line.get_color() for axes in (budget, noise) for line in axes.lines if line.get_marker() == "o"]
    assert drawn == [SGAT, GAT, GAT, SGAT]
    assert [
        to_hex(container.patches[0].get_facecolor()) for container in bars.containers if hasattr(container, "patches")
    ] == [GAT, SGAT]


def test_bars_tell_widths_of_noise_apart() -> None:
    values = {name: [(1.0, 0.1)] for name in ("none", "ane 0.2", "ane 0.4", "gat", "trained on real")}
    (axes,) = noise_bars_figure({"a world": Bars(("0.5",), values)}, "trained on real", title="t", along="noise").axes
    hatches = {bars.get_label(): bars.patches[0].get_hatch() for bars in axes.containers if hasattr(bars, "patches")}
    assert hatches["ane 0.2"] != hatches["ane 0.4"] and not hatches["gat"]
    assert "trained on real" not in hatches


def test_files_are_written_1600_pixels_wide_and_leave_nothing_behind(tmp_path: Path) -> None:
    import matplotlib
    from PIL import Image

    before = dict(matplotlib.rcParams)
    learning_curve(tmp_path / "a.png", [SEARCH], unit="cm/s", title="t")
    joint_trace(tmp_path / "b.png", TRACES, "LKneePitch")
    grounding_errors(tmp_path / "c.png", ERRORS)
    assert {Image.open(path).width for path in tmp_path.glob("*.png")} == {1600}
    assert dict(matplotlib.rcParams) == before
    assert "matplotlib.pyplot" not in sys.modules or not sys.modules["matplotlib.pyplot"].get_fignums()


def test_the_same_figure_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        joint_trace(tmp_path / name, TRACES, "LKneePitch")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_labels_move_apart_as_little_as_needed() -> None:
    assert spread([0.1, 0.5, 0.9], 0.1) == [0.1, 0.5, 0.9]
    np.testing.assert_allclose(spread([0.5, 0.52], 0.1), [0.46, 0.56], atol=1e-6)
    assert np.diff(spread([0.2, 0.21, 0.22, 0.23], 0.1)).min() > 0.0999
