"""The page of a run: the figures of its result, nothing from outside, and no name is markup."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from browser import CUT_OR_COVERED, PHONE, browser, check_seen
from page_reader import Page, check_alone, words

from gsl.core.unit import Unit
from gsl.report.account import evaluation_table
from gsl.report.charts import Bar, Curve, Dot, Pair, Span, bar_chart, dot_chart, line_chart, scatter
from gsl.report.console import Console
from gsl.report.evaluation_page import Look, write_evaluation_page
from gsl.report.footfalls import Walk, footfall_figure
from gsl.report.iteration_page import grounding
from gsl.report.joint_trace import Traces
from gsl.report.learning_curve import search
from gsl.report.markdown import table as markdown
from gsl.report.parts import element, join, prose, section, table
from gsl.report.run_page import Answer, Change, curves, describe_origin, footfalls, joints, parameters, write_page
from gsl.report.study_page import write_study_page
from gsl.report.style import COLOURS, curve_figure, look
from gsl.rollout.promise import promise
from gsl.storage.artifact import build
from gsl.storage.origin import Origin
from gsl.storage.policies import PolicyRecord
from gsl.validation.iteration_pictures import read_footfalls

HOSTILE = "<script>alert(1)</script>\"' onload='x' $\\frac{"
TIME = np.arange(0.0, 0.8, 0.02)
UNIT = Unit(100.0, "cm/s")


def trace(late: float) -> Traces:
    return Traces(TIME, np.sin(TIME), np.sin(TIME - late), np.sin(TIME), np.sin(TIME - late) + math.radians(2.0))


def measured(name: str, generation: int | None, value: float, falls: int = 0) -> dict[str, Any]:
    bounds = [None, None] if falls else [value - 0.01, value + 0.01]
    return {"name": name, "generation": generation, "value_sim": None, "value": value, "interval": bounds,
            "falls": falls, "episodes": 3, "outcome": {}}  # fmt: skip


PI0, BEST = measured("pi0", None, 0.19), measured("generation_01", 1, 0.21)
DOCUMENT = {"policies": [PI0, BEST, measured("generation_02", 2, 0.05, falls=1)], "check": [BEST],
            "confirmation": [PI0, BEST]}  # fmt: skip
METRICS = {
    "best": "generation_01", "best_generation": 1, "policies": 2, "returned": BEST, "baseline": PI0,
    "gain": {"value": 0.02, "interval": [0.004, 0.036], "share": 0.1}, "failed_check": [], "real_episodes": 18,
}  # fmt: skip
CHANGE = Change(("step-x", "swing"), (0.2, 1.0), (0.25, 0.9), (0.1, 0.5))


def written(folder: Path, metrics: dict[str, Any] = METRICS, look: Look = Look()) -> str:  # noqa: B008  a constant
    write_evaluation_page(folder, metrics, DOCUMENT, CHANGE, UNIT, look)
    return (folder / "report.html").read_text("utf-8")


def test_an_evaluation_says_its_gain_with_its_interval_and_shows_what_the_table_shows(tmp_path: Path) -> None:
    said = words(written(tmp_path))
    assert "generation_01 reaches 21.0 cm/s (95 % 20.0 to 22.0) on the real side, π0 19.0: " in said
    assert "the gain over π0, +2.0 cm/s (95 % +0.4 to +3.6), is significant." in said
    assert "generation_02 5.0 1 of 3" in said and "generation_01, fresh 21.0 20.0 to 22.0 0 of 3" in said
    assert "step-x 0.2 0.25 +0.50" in said and "swing 1 0.9 −0.20" in said
    assert "episodes to choose 9 episodes to check 3 fresh episodes to report 6 in all 18" in said
    assert "fell on the real side" in said  # marked in the learning curve


def test_a_policy_alone_has_neither_curve_nor_change(tmp_path: Path) -> None:
    alone = {**METRICS, "best": "pi0", "best_generation": 0, "policies": 0, "returned": PI0}
    said = words(written(tmp_path, alone))
    assert "How good is this policy on the real side?" in said and "π0 alone was measured: 19.0 cm/s (95 % " in said
    assert "Learning curves" not in said and "The policy before and after" not in said


def test_an_evaluation_shows_joints_feet_and_falls_of_what_it_reports(tmp_path: Path) -> None:
    check = tmp_path / "grounding.json"
    check.write_text(json.dumps({"compliance": {"groups": {"legs": {"stiffness": {"sim": 150.0, "grounded": 82.2}}}}}))
    real = trace(0.1)._replace(simulation=None, grounded=None)
    feet = Walk("generation_01 on the real side", TIME, {"left": TIME < 0.4}, fell=0.7)
    said = words(
        written(tmp_path, look=Look({"generation_01": {"knee": trace(0.1)}, "π0": {"hip": real}}, [feet], check))
    )
    assert "What grounding changes" in said and "legs stiffness [N·m/rad] 150 82.2" in said
    best, _, start = said.partition("Joint by joint: generation_01")[2].partition("Joint by joint: π0")
    assert "knee [°]" in best and "from real" in best and "play its actions" in best
    assert "hip [°]" in start and "from real" not in start and "play its actions" not in start
    assert "generation_01 on the real side" in start and " fell" in start.partition("Footfalls")[2]


def test_two_policies_are_shown_at_the_same_joint_first(tmp_path: Path) -> None:
    best, start = (dict.fromkeys(names, trace(0.1)) for names in (("knee", "hip"), ("hip", "knee")))
    seen = Look({"generation_01": best, "π0": start}, findings=["Learned servo: nearer."])
    page = Page(written(tmp_path, look=seen))
    assert [value for _, name, value in page.attributes if name == "data-of"] == ["knee", "hip"] * 2
    assert "Learned servo: nearer." in words((tmp_path / "report.html").read_text("utf-8"))


def test_of_many_joints_a_page_shows_those_that_any_policy_moves_most(tmp_path: Path) -> None:
    def moving(ranges: dict[str, float]) -> dict[str, Traces]:
        return {joint: trace(0.1)._replace(real=size * np.sin(TIME)) for joint, size in ranges.items()}

    best = moving({f"j{k}": 1.0 - 0.1 * k for k in range(8)})
    start = moving({f"j{k}": 0.01 for k in range(7)} | {"j7": 2.0})
    page = Page(written(tmp_path, look=Look({"generation_01": best, "π0": start})))
    shown = ["j7", "j0", "j1", "j2", "j3", "j4"]
    assert [value for _, name, value in page.attributes if name == "data-of"] == shown * 2
    assert "Shown are 6 of 8 joints" in words((tmp_path / "report.html").read_text("utf-8"))


def test_feet_that_never_touch_the_ground_have_no_pattern() -> None:
    force = np.zeros(len(TIME))
    walk = cast(Any, SimpleNamespace(time=TIME, sensors={"foot_force.left": force}, ended_in_a_fall=False))
    assert read_footfalls("in the air", walk) is None
    walk.sensors["foot_force.right"] = force + 30.0
    assert read_footfalls("on the ground", walk) is not None


def test_a_gain_that_may_be_none_is_called_so(tmp_path: Path) -> None:
    unsure = {**METRICS, "gain": {"value": 0.02, "interval": [-0.01, 0.05], "share": 0.1}}
    text = written(tmp_path, unsure)
    assert "is not significant" in words(text) and Page(text).classes()["doubt"] == 1
    assert Page(written(tmp_path)).classes()["good"] == 1


def test_a_promise_that_was_not_kept_is_on_the_page_as_in_the_terminal(tmp_path: Path) -> None:
    kept, broken = (promise_of(tmp_path / name, value) for name, value in (("kept", 0.21), ("broken", 0.3)))
    assert kept["warning"] == "" and broken["warning"].startswith("the search promised 30.0 cm/s (generation_01), but")
    said = words(written(tmp_path, {**METRICS, "promise": broken}))
    assert f"T{broken['warning'][1:]}." in said
    assert "promised" not in words(written(tmp_path, {**METRICS, "promise": kept}))


def promise_of(place: Path, value: float) -> dict[str, Any]:
    policies = [PolicyRecord("pi0", {}), PolicyRecord("generation_01", {}, generation=1, value_sim=value)]
    promised = promise(policies, 1, BEST, UNIT)
    assert promised is not None
    return promised


def test_every_warning_of_a_terminal_is_on_the_page_once(tmp_path: Path) -> None:
    class Warned:
        kind = "evaluate"

        def parents(self) -> dict[str, Path]:
            return {}

        def run(self, folder: Path, console: Console) -> dict[str, Any]:
            console.status("warning: the log says `kp` < 3")
            console.status("nothing of weight")
            console.status("warning: 5 % of it is shown")
            part = section("Seen", element("p", prose("5 % of it is shown.")))
            write_page(folder, Answer("Is it?", "It is.", sure=True), [part])
            return {}

    made = build(Warned(), config={}, out=tmp_path / "a", command="gsl a", force=False, console=Console())
    text = (made.folder / "report.html").read_text("utf-8")
    assert "Warnings The log says kp < 3. Seen" in words(text) and "<code>kp</code> &lt; 3" in text
    assert words(text).replace("\u00a0", " ").count("5 % of it is shown") == 1 and "weight" not in words(text)


def test_a_column_that_says_the_value_again_is_left_out(tmp_path: Path) -> None:
    def rows(**outcome: float) -> list[str]:
        policies = [{**row, "outcome": {name: row["value"] * factor for name, factor in outcome.items()}}
                    for row in DOCUMENT["policies"]]  # fmt: skip
        return list(evaluation_table({**DOCUMENT, "policies": policies, "check": [], "confirmation": []}, UNIT)[0])

    plain = ["policy", "in simulation [cm/s]", "on the real side [cm/s]", "95 % interval", "falls"]
    assert rows(**{"speed [cm/s]": 100.0}) == plain
    assert rows(**{"speed [cm/s]": 100.0, "distance [m]": 15.0}) == [*plain, "distance [m]"]


def test_equal_runs_write_equal_pages_that_need_nothing_else(tmp_path: Path) -> None:
    text = written(tmp_path)
    assert written(tmp_path) == text
    check_alone(text)
    assert Page(text).tags["script"] == 0  # there is nothing to choose


def joint_page(folder: Path, *names: str) -> str:
    answer = Answer(f"Is {names[0]} right?", f"{names[0]} is.", sure=True)
    walk = Walk(names[0], TIME, {"left": TIME < 0.4, "right": TIME >= 0.3}, fell=0.7)
    seen = {name: trace(0.1 * (index + 1)) for index, name in enumerate(names)}
    write_page(folder, answer, [joints(seen, names[0]), footfalls([walk])])
    return (folder / "report.html").read_text("utf-8")


def test_each_joint_can_be_chosen_and_only_our_script_runs(tmp_path: Path) -> None:
    text = joint_page(tmp_path, "LKneePitch", "RKneePitch")
    page = Page(text)
    assert page.tags["option"] == 2 and page.tags["select"] == 1
    assert [attribute[2] for attribute in page.attributes if attribute[1] == "data-of"] == ["LKneePitch", "RKneePitch"]
    allowed = base64.b64encode(hashlib.sha256(page.script.encode()).digest()).decode()
    assert f"script-src 'sha256-{allowed}'" in text
    check_alone(text)


def test_a_hostile_name_is_shown_and_never_markup(tmp_path: Path) -> None:
    plain, hostile = Page(joint_page(tmp_path, "knee")), Page(joint_page(tmp_path, HOSTILE))
    assert hostile.tags == plain.tags
    assert [attribute[:2] for attribute in hostile.attributes] == [attribute[:2] for attribute in plain.attributes]
    assert hostile.script == plain.script and HOSTILE in hostile.text


def test_a_browser_shows_the_joint_that_is_chosen_without_an_error(tmp_path: Path) -> None:
    joint_page(tmp_path, "LKneePitch", "RKneePitch")
    visible = "[...document.querySelectorAll('[data-of]')].filter(one => one.offsetHeight).map(one => one.dataset.of)"
    choose = (
        "{ const one = document.querySelector('select'); one.value = 'RKneePitch'; "
        "one.dispatchEvent(new Event('change')); }"
    )
    with browser() as shown:
        shown.open(tmp_path / "report.html", PHONE)
        assert shown.value(visible) == ["LKneePitch"]
        shown.value(choose)
        assert shown.value(visible) == ["RKneePitch"]
        assert shown.wrong == []


def test_a_browser_is_heard_when_something_is_wrong(tmp_path: Path) -> None:
    place = tmp_path / "bad.html"
    text = "<text x='0' y='9'>one</text><text x='2' y='9'>another</text><text x='95' y='30'>too far</text>"
    place.write_text(
        f"<p style='width: 2000px'>wide</p><svg width='100' height='50'>{text}</svg>"
        "<script>console.error('oh'); missing()</script><img src='http://localhost:9/x.png'>"
    )
    with browser() as shown:
        shown.open(place, PHONE)
        assert shown.value("document.documentElement.scrollWidth") > PHONE
        assert {"one covers another", "cut: too far"} <= {*shown.value(CUT_OR_COVERED)}
        said = "\n".join(shown.wrong)
        assert "oh" in said and "missing is not defined" in said and "localhost:9" in said


def test_a_browser_shows_an_evaluation_at_any_width(tmp_path: Path) -> None:
    written(tmp_path)
    check_seen(tmp_path / "report.html", "generation_01 reaches 21.0 cm/s", "20.0 to 22.0", "1 of 3")


def test_a_study_shows_the_tables_and_sentences_of_its_file(tmp_path: Path) -> None:
    text = (
        f"{markdown(('grounding', 'value'), [('gat', '3.1')])}\nOne line\nand its end.\n\n{markdown(('a',), [('b',)])}"
    )
    (tmp_path / "table.md").write_text(text)
    with look():
        picture = curve_figure()
        picture.subplots().set_title("what is seen")
    write_study_page(tmp_path, Answer("Why?", "Therefore.", sure=False, more=["And so."]), ["table.md"], [picture])
    page = (tmp_path / "report.html").read_text("utf-8")
    assert "grounding value gat 3.1 One line and its end. a b" in words(page)
    assert "Why? ? Therefore. And so. Pictures" in words(page) and "what is seen" in words(page)
    assert Page(page).tags["table"] == 2
    check_alone(page)
    check_seen(tmp_path / "report.html", "3.1", "One line and its end.", "what is seen")


def test_what_the_check_measured_is_what_grounding_changes() -> None:
    spans = {name: {"one_tick": {"by_joint_deg": {"knee": 9.0}}, "10_ticks": {"by_joint_deg": {"knee": error}}}
             for name, error in (("ungrounded", 4.0), ("grounded", 1.0), ("no_change", 8.0))}  # fmt: skip
    said = words(str(grounding({"errors": {"pi0": spans}, "problems": ["π0 falls"]}, ["Diagnosis: causes."])))
    assert "Diagnosis: causes." in said and "The check says: π0 falls." in said
    assert "Grounding takes the joint error from 4.00° to 1.00° of π0." in said
    loads = {"legs": {"stiffness": {"sim": 150.0, "grounded": 82.2}}}
    said = words(str(grounding({"compliance": {"groups": loads}}, [])))
    assert "joints simulator grounded legs stiffness [N·m/rad] 150 82.2" in said
    loads["legs"]["stiffness"]["real"] = 81.5
    said = words(str(grounding({"compliance": {"groups": loads}}, [])))
    assert "joints simulator grounded real legs stiffness [N·m/rad] 150 82.2 81.5" in said
    assert grounding(None, []) is None


def test_of_many_parameters_the_most_changed_are_listed() -> None:
    names = tuple(f"p{k}" for k in range(100))
    after = tuple(float(k == 70) for k in range(100))
    said = words(str(parameters(Change(names, (0.0,) * 100, after, (1.0,) * 100))))
    assert "The 40 most changed of 100." in said and "p70 0 1 +1.00" in said


def test_a_foot_bears_load_in_as_many_bars_as_it_stands() -> None:
    loaded = np.sin(20.0 * TIME) > 0.0
    (axes,) = footfall_figure([Walk("walk", TIME, {"left": loaded, "right": ~loaded})]).axes
    left, right = (part.get_paths() for part in axes.collections)
    starts = np.count_nonzero(np.diff(loaded.astype(int)) == 1) + loaded[0]
    assert len(left) == starts and len(left) + len(right) == 1 + np.count_nonzero(np.diff(loaded.astype(int)))
    lengths = [np.ptp(path.vertices[:, 0]) for path in (*left, *right)]
    assert sum(lengths) == pytest.approx(TIME[-1])  # one foot or the other


def test_a_picture_has_the_colours_of_the_page_and_its_words_as_text() -> None:
    drawn = str(curves([search("iteration 1", DOCUMENT, shown=100.0, returned="generation_01")], "cm/s"))
    assert "generation" in Page(drawn).text and "var(--real)" in drawn
    assert not [colour for colour in COLOURS.values() if colour in drawn]
    assert not re.search(r"#[0-9a-f]{6}\b", drawn)


def axis_ends(chart: str | None) -> list[float]:
    """Horizontal ends of the lines that are drawn as one stroke from left to right."""
    assert chart is not None
    return [float(x) for x in re.findall(r"L ([\d.]+) ", chart)]


def test_charts_draw_nothing_where_there_is_no_number() -> None:
    assert line_chart([Curve("a", "real", [], [])], x="x", y="y") is None
    assert line_chart([Curve("a", "real", [0.0, 1.0], [None, None])], x="x", y="y") is None
    assert bar_chart([]) is None and bar_chart([Bar("a", [("before", None)], "")]) is None
    assert dot_chart([], str) is None and dot_chart([Dot("a", None, None, None, "other")], str) is None
    assert scatter([], {}, x="real", y="sim") is None


def test_a_line_is_broken_where_there_is_no_number() -> None:
    whole = line_chart([Curve("a", "real", [0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 0.0, 1.0])], x="x", y="y")
    broken = line_chart([Curve("a", "real", [0.0, 1.0, 2.0, 3.0], [0.0, 1.0, None, 1.0])], x="x", y="y")
    assert len(axis_ends(broken)) < len(axis_ends(whole))


def test_charts_tell_their_labels_and_values() -> None:
    bars = bar_chart([Bar("simulator", [("before", 4.0), ("after", 1.0)], "4.00 × → 1.00 ×")], mark=1.0)
    dots = dot_chart([Dot("gain of knee", 0.8, 0.7, 0.9, "after")], lambda share: f"{100 * share:.0f} %")
    pairs = scatter([Pair("after", Span(1.0, 0.9, 1.1), Span(1.2))], {"after": "diagnosed"}, x="real", y="sim")
    assert "simulator" in words(str(bars)) and "4.00 × → 1.00 ×" in words(str(bars))
    assert "gain of knee" in words(str(dots)) and "80 %" in words(str(dots))
    assert {"diagnosed", "real", "sim"} <= {*words(str(pairs)).split()}


def test_a_column_without_a_value_is_left_out() -> None:
    rows = [("gat", "", "0.5", None), ("none", "", "", None)]
    assert words(table(("grounding", "drift", "promise", "rank"), rows)) == "grounding promise gat 0.5 none"
    assert words(table(("grounding", "drift"), [])) == "grounding drift"


def test_text_is_escaped_once_and_markup_never() -> None:
    assert element("td", "a < b", element("b", "&")) == "<td>a &lt; b<b>&amp;</b></td>"
    assert element("p", kind="a", style='"') == '<p class="a" style="&#34;"></p>'
    assert join("<", None, element("b", ">")) == "&lt;<b>&gt;</b>"
    assert '<th scope="row">&lt;a&gt;</th><td>\ufffd</td>' in table(("x",), [("<a>", "\u202e")])
    assert prose("97 % of 3 ms at 2 cm/s") == "97\u00a0% of 3\u00a0ms at 2\u00a0cm/s"


def test_a_log_that_cannot_be_read_costs_no_page_its_warnings(tmp_path: Path) -> None:
    """Torn in the middle of a letter, a link to nowhere, far too many, with a terminal's escapes."""
    folders = [tmp_path / name for name in ("own", "torn", "nowhere")]
    for folder in folders:
        folder.mkdir()
    many = [f"x gsl: warning: number {k}\x1b[2J" for k in range(80)]
    (folders[0] / "log.txt").write_text("\n".join(many))
    (folders[1] / "log.txt").write_bytes(b"x gsl: warning: half a letter \xcf")
    (folders[2] / "log.txt").symlink_to("/proc/kmsg")
    built = cast(Any, dict.fromkeys(folders[1:]))
    warnings = Origin("gsl x", "", (), folders[0], folders[0], built).warnings
    assert warnings[0] == "number 0\\u001b[2J" and len(warnings) == 51 and warnings[-1] == "31 more, in the logs"


def test_a_part_of_a_chain_says_how_it_is_repeated_alone(tmp_path: Path) -> None:
    typed = ("gsl iterate (it)", "gsl iterate")
    said = [join(*describe_origin(Origin(command, "a: 1", (), tmp_path, tmp_path, {}))) for command in typed]
    assert "A part of gsl iterate; gsl rerun and the folder of this page repeat it alone." in said[0]
    assert "A part of" not in said[1] and "gsl iterate" in said[1]
