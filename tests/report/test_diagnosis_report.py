"""The report of a diagnosis: the answer comes first, nothing is invented, and no name of a joint is markup."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import diagnosis_document as made
import pytest
from browser import check_seen
from page_reader import Page, check_alone, words

from gsl.report.console import Console
from gsl.report.diagnosis import report_html
from gsl.report.diagnosis_next import steps
from gsl.report.diagnosis_text import summary_lines
from gsl.report.diagnosis_verdict import cause_name, headline, places, where_sentence
from gsl.report.diagnosis_words import between, interval, level, list_words, probability, share, short, value
from gsl.storage.diagnosis_report import see_from

pytestmark = pytest.mark.slow

DOCUMENTS: dict[str, Callable[[], dict[str, Any]]] = {
    "causes": made.document,
    "no_gap": made.no_gap,
    "inseparable": made.inseparable,
    "unknown": made.unknown,
    "one joint": lambda: made.document(("Knee",), causes=1),
    "25 joints": lambda: made.document(tuple(f"joint_{index}" for index in range(25))),
    "nothing": dict,
}
HOSTILE = "<script>alert(1)</script>\"' onload='x' &amp; [red]</td></style><img src=//x.y>\u202e\x00\ud800"
UNSAID = re.compile(r"\bNone\b(?! of)|\bnan\b")


@cache
def draw_page(kind: str) -> str:
    """The page of a document; to draw one takes a second."""
    return report_html(DOCUMENTS[kind]())


@pytest.mark.parametrize("kind", DOCUMENTS)
def test_the_page_is_whole_and_needs_nothing_else(kind: str) -> None:
    text = draw_page(kind)
    page = Page(text)
    assert page.tags["script"] == 0
    check_alone(text)
    assert UNSAID.search(page.text) is None
    assert len(text.encode()) < 200_000


def test_equal_documents_give_equal_pages() -> None:
    assert report_html(DOCUMENTS["causes"]()) == draw_page("causes")


@pytest.mark.parametrize("kind", ["causes", "25 joints"])
def test_a_browser_shows_a_diagnosis_at_any_width(kind: str, tmp_path: Path) -> None:
    verdict, text = DOCUMENTS[kind](), draw_page(kind)
    (tmp_path / "report.html").write_text(text, encoding="utf-8")
    answers = words(text).split("Where is the gap?")[1].split("Caveats")[0]
    check_seen(tmp_path / "report.html", headline(verdict), answers.strip())


def test_long_records_of_many_joints_stay_small() -> None:
    document = made.document(tuple(f"joint_{index}" for index in range(25)))
    document["replays"] = [record | {key: record[key] * 40 for key in ("time", "command", "real", "before", "after")}
                        for record in document["replays"] * 9]  # fmt: skip
    assert len(report_html(document).encode()) < 400_000


def test_a_cause_that_is_not_sure_is_called_probable() -> None:
    probable = {**made.document(causes=1), "sure": False}
    assert "Probable cause: servo gain of LKneePitch" in words(report_html(probable)).split("Caveats")[0]
    unlikely = {**probable, "doubt": "possibly"}
    assert "Possible cause: servo gain of LKneePitch" in words(report_html(unlikely)).split("Caveats")[0]


def test_what_cannot_be_told_apart_is_said_once() -> None:
    undecided = {**made.document(causes=2), "verdict": "inseparable", "inseparable": [["servo_gain", "torque_limit"]]}
    undecided["summary"] = "The gap looks like servo gain, but this log cannot tell apart: servo gain or torque limit."
    answers = words(report_html(undecided)).split("What causes it?")
    assert "this log cannot tell its possible causes apart: servo gain or torque limit" in answers[0]
    assert "looks like" not in answers[0] and "cannot tell" not in answers[1].split("What next?")[0]
    (first, *_) = summary_lines(undecided)
    assert "cannot tell" in first.title and "cannot tell" not in (first.caption or "")
    many = {**undecided, "inseparable": [["servo_gain", "torque_limit"]] * 3 + [["deadband", "backlash"]]}
    assert "deadband or backlash: this log cannot tell which" in words(report_html(many))


def test_the_first_screen_answers_everything() -> None:
    first = words(draw_page("causes")).split("Caveats")[0]
    assert "2 causes found: servo gain of LKneePitch and command latency of all joints" in first
    assert "In 3 of 14 joints: LKneePitch 60 % of the excess (most when fast, " in first
    assert " ×), LHipRoll 22 % and LHipPitch 8 %. The others are not significantly beyond the noise." in first
    assert "kp 0.57 (0.55 to 0.60)" in first and "delay 31.2 ms (29.0 to 33.5 ms)" in first
    assert "97 % sure, 81 % of what a calibration leaves comes back without it (70 to 90 %)" in first
    assert "From 3.20 × to 1.05 × the noise floor on held-out records: 98 % of the excess is gone (95 to 99 %)" in first
    assert "gsl collect task=excite policy.file=runs/worn/diagnose/next.json name=next" in first


@pytest.mark.parametrize(
    ("kind", "phrases"),
    [
        ("no_gap", ("No gap beyond the noise", "No joint stands out", "1.02 × the noise floor", "grounding=none")),
        (
            "inseparable",
            (
                "apart: zero offset or sensor bias",
                "zero offset of legs",
                "offset 1.00° (0.90 to 1.10°)",
                "Play steps_large",
            ),
        ),
        (
            "unknown",
            (
                "no effect that we know explains it",
                "The nearest: servo gain of LKneePitch.",
                "LKneePitch: a lag or a function of the error, which the servo's torque follows (20 ms late)",
                "LHipPitch: a function of position.",
                "missing torque [N·m]",
                "grounding=effects_servo",
            ),
        ),
        ("nothing", ("No verdict", "Not measured")),
    ],
)
def test_every_verdict_is_told(kind: str, phrases: tuple[str, ...]) -> None:
    text = words(draw_page(kind))
    assert [entry for entry in phrases if entry not in text] == []


@pytest.mark.parametrize(
    ("gone", "phrase"), [(0.99, "explains all of it"), (0.6, "explains it"), (None, "explains it")]
)
def test_a_gap_that_is_nearly_explained_is_said_to_be_so(gone: float | None, phrase: str) -> None:
    document = {"verdict": "unknown", "shrinkage": {"nearest_fraction": gone}}
    assert headline(document) == f"There is a gap, and no effect that we know {phrase}"


def test_where_a_calibration_explains_a_large_gap_the_calibrated_simulator_is_advised() -> None:
    world = {"world_file": "runs/far/diagnose/world/diagnosed.yaml"}
    far = made.no_gap() | world | {"shrinkage": made.no_gap()["shrinkage"] | {"before": 51.0, "after": 0.34}}
    (step, *_) = steps(far)
    assert step.why.startswith("Train in the calibrated simulator (") and "51 × the noise floor" in step.why
    assert "world=diagnosed" in step.command
    assert "No gap beyond the noise and a calibration of each joint" in words(report_html(far))


def test_where_no_law_says_what_is_missing_a_grounding_learns_it() -> None:
    (step, *_) = steps(made.unknown() | {"forms": []})
    assert step.command == "gsl iterate grounding=gat"
    assert "What is missing" not in words(report_html(made.unknown() | {"forms": []}))


def test_what_was_given_to_do_is_what_is_told() -> None:
    document = made.document() | {"commands": [{"why": "Do this.", "command": "gsl this\ngsl that"}]}
    assert [step.command for step in steps(document)] == ["gsl this\ngsl that"]
    assert "gsl optimize" not in report_html(document)


def test_a_command_is_safe_to_paste() -> None:
    document = made.document()
    document["next_experiment"]["file"] = "a b; rm -rf ~"
    document["command"] += " sim=$(ls) name=before"
    assert steps(document)[1].command.splitlines() == [
        "gsl collect task=excite 'policy.file=a b; rm -rf ~' name=next",
        "gsl diagnose real=next/collect_real sim=nao_ideal 'sim=$(ls)' name=next",
    ]
    assert steps(document | {"command": "gsl 'diagnose"})[1].command.endswith(
        "gsl diagnose real=next/collect_real name=next"
    )


def test_commands_for_a_robot_of_ones_own_name_it() -> None:
    own = {"robot": "my arm.urdf", "period": 0.01, "world": "simulator"}
    train, play = steps(made.document() | {"own": own})[:2]
    assert train.command == "" and "with a task and a policy of yours" in train.why
    first, again = play.command.splitlines()
    robot = "world=robot 'world.robot=my arm.urdf' world.floating=false world.period=0.01 'world.sensors=[]'"
    assert first == f"gsl collect {robot} task=excite policy.file=runs/worn/diagnose/next.json name=next"
    assert again.startswith("gsl diagnose --config-dir runs/worn/diagnose sim=simulator real=next/collect_real ")
    for kind in ("no_gap", "unknown"):
        (step, *_) = steps(DOCUMENTS[kind]() | {"own": own})
        assert step.command == ""


def test_the_corrected_world_is_trained_in_by_its_folder_and_name() -> None:
    document = made.document()
    command = "gsl optimize --config-dir runs/worn/diagnose world=diagnosed grounding=none name=diagnosed"
    assert steps(document)[0].command == command
    here = steps(document | {"world_file": "world/diagnosed.yaml"})[0]
    assert "--config-dir . world=diagnosed" in here.command and "in the folder of this report" in here.why
    assert steps(document | {"world_file": None})[0].command == ""


def test_a_cause_is_named_with_what_was_chosen_of_it() -> None:
    assert cause_name({"effect": "joint_limit", "scope": "LKneePitch", "fixed": {"side": "upper"}}) == (
        "joint limit of LKneePitch (side upper)"
    )
    assert cause_name({"effect": "link_mass", "scope": "torso", "joints": [], "fixed": {"link": "torso"}}) == (
        "link mass of torso"
    )
    assert cause_name({"effect": "supply_sag", "scope": "", "joints": []}) == "supply sag"


def test_what_a_ceiling_leaves_is_a_share_of_squares() -> None:
    shrinkage = {"before": 3.0, "after": 1.0, "fraction": 1.0, "ceiling_fraction": 0.625}  # 9 - 0.625 (9 - 1) = 2²
    assert "ceiling: a law of each servo on top 3.00 × 1.00 × 2.00 ×, 62 %" in words(
        report_html({"shrinkage": shrinkage})
    )


def poisoned(document: Any, key: str = "") -> Any:
    """The document with every string of people's, and every name of a joint or parameter, hostile."""
    if isinstance(document, dict):
        named = key in ("rms", "sd", "parameters")
        return {f"{HOSTILE}{name}" if named else name: poisoned(entry, name) for name, entry in document.items()}
    if isinstance(document, list):
        return [poisoned(entry, key) for entry in document]
    return f"{HOSTILE}{document}" if isinstance(document, str) and key not in ("verdict", "source") else document


@pytest.mark.parametrize("kind", ["causes", "no_gap", "inseparable", "unknown"])
def test_no_name_is_markup(kind: str) -> None:
    plain, text = draw_page(kind), report_html(poisoned(DOCUMENTS[kind]()))
    before, after = Page(plain), Page(text)
    assert set(after.tags) <= set(before.tags)
    assert {attribute[:2] for attribute in after.attributes} <= {attribute[:2] for attribute in before.attributes}
    assert not [attribute for attribute in after.attributes if "alert" in attribute[2]]
    assert "<script>alert(1)</script>" in after.text  # as text
    text.encode("utf-8")


def paths(document: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every place of a mapping, of a list only those in its first entry."""
    for key in document if isinstance(document, dict) else range(min(1, len(document))):
        if isinstance(document, dict):
            yield (*path, key)
        if isinstance(document[key], dict | list):
            yield from paths(document[key], (*path, key))


@pytest.mark.parametrize("absent", [True, False])
def test_whatever_is_missing_the_rest_is_told(absent: bool) -> None:
    whole = made.document(("Hip", "Knee")) | {"inseparable": [["zero_offset", "sensor_bias"]]}
    figures = {"policy_gap", "shrinkage", "ranking", "replays", "horizon"}
    for *path, last in {(place[0], place[-1]): place for place in paths(whole)}.values():
        first = (*path, last)[0]
        damaged = copy.deepcopy({key: value for key, value in whole.items() if key == first or key not in figures})
        place: Any = damaged
        for key in path:
            place = place[key]
        if absent:
            del place[last]
        else:
            place[last] = None
        assert UNSAID.search(Page(report_html(damaged)).text) is None, (*path, last)
        assert (
            UNSAID.search(str([table._replace(caption=table.caption or "") for table in summary_lines(damaged)]))
            is None
        )


def test_empty_lists_make_no_sections() -> None:
    emptied = {key: [] if isinstance(entry, list) else entry for key, entry in made.document().items()}
    emptied |= dict.fromkeys(("horizon", "shrinkage", "floor", "policy_gap", "self_test", "next_experiment"))
    page = Page(report_html(emptied | {"verdict": "no_gap"}))
    assert page.tags["section"] == 1  # how it was measured


def test_the_map_frames_the_named_cells_and_greys_the_rest() -> None:
    document = made.document()
    classes = Page(report_html(document)).classes()
    named = sum(cell["named"] for cell in document["where"])
    assert classes["named"] == named
    assert classes["noise"] == len(document["where"]) - named
    document["where"] = [cell for cell in document["where"] if cell["named"] or cell["regime"] == "all"]
    shown = {cell["regime"] for cell in document["where"]}
    assert Page(report_html(document)).classes()["noise"] == len(made.NAO) * len(shown) - named


def test_replays_are_in_degrees_with_their_distances() -> None:
    record = {"record": "r", "joint": "Knee", "time": [0.0, 1.0], "real": [0.0, 0.0], "command": None}
    text = words(report_html({"replays": [record | {"before": [0.1, 0.1], "after": [0.01, 0.01]}]}))
    assert "Knee in r: 5.7° from the robot as it was, 0.57° with the effects" in text


def test_numbers_are_told_as_people_read_them() -> None:
    assert [short(number) for number in (0, 0.57, 12.34, 123456.0, -0.00213, None)] == [
        "0", "0.570", "12.3", "123456", "−0.00213", "–"]  # fmt: skip
    assert (share(0.974), share(-0.0001), share(None)) == ("97 %", "0 %", "–")
    assert (probability(1.0), probability(0.0), probability(0.5)) == (">99 %", "<1 %", "50 %")
    assert (level(1.049), level(33.3), level(0.0)) == ("1.05 ×", "33 ×", "<0.01 ×")
    assert between({"low": 0.95, "high": 0.99}, share) == "95 to 99 %"
    width = {"value": 0.0175, "low": 0.0157, "high": 0.0192, "unit": "rad"}
    assert (value(width), interval(width)) == ("1.00°", "0.90 to 1.10°")
    torque = {"value": 0.1234, "low": 0.1, "high": 0.15, "unit": "N·m"}
    assert (value(torque), interval(torque)) == ("0.12 N·m", "0.10 to 0.15 N·m")
    assert value({"value": 2.5, "unit": "s"}) == "2.50 s"
    assert list_words(["a", "b", "c", "d", "e", "f"]) == "a, b, c and 3 more"


def test_noise_is_told_in_mrad_and_where_it_comes_from() -> None:
    assert "Knee 1.50 0.086" in words(report_html(made.document(("Knee",), causes=1)))
    estimated = report_html({"floor": {"source": "estimated", "pairs": 0, "sd": {"Knee": 0.001}}})
    assert "no motion was repeated" in estimated


def test_calibration_is_told_without_a_minus_before_nothing() -> None:
    row = {
        "joint": "Knee",
        "kp": 0.9951,
        "kd": 1.0,
        "coulomb": -2e-6,
        "viscous": 0.01234,
        "zero": -1e-6,
        "inertia": -5e-5,
    }
    assert "Knee 0.995 1.000 0.0000 0.0123 0.00 −0.05" in words(report_html({"calibration": [row]}))


def test_where_speaks_of_regimes_if_no_joint_stands_out_as_a_whole() -> None:
    cell = {"joint": "Knee", "regime": "high_load", "share": 0.4, "rms": 5.2, "named": True}
    whole = {"joint": "Knee", "regime": "all", "share": 0.1, "rms": 1.1, "named": False}
    hip = {"joint": "Hip", "regime": "all", "share": 0.01, "named": False}
    sentence = where_sentence({"where": [cell, whole, hip]})
    assert sentence == (
        "No joint stands out as a whole. Significantly beyond the noise only at times: Knee when asked for much "
        "torque, 5.20 ×. The others are not significantly beyond the noise."
    )
    beside = where_sentence({"where": [cell, whole, {**hip, "share": 0.6, "rms": 3.0, "named": True}]})
    assert beside == (
        "In 1 of 2 joints: Hip 60 % of the excess. Significantly beyond the noise only at times: Knee when asked for "
        "much torque, 5.20 ×."
    )


def test_a_place_is_told_with_the_figures_of_the_whole_joint() -> None:
    cell = {"joint": "Knee", "regime": "fast", "share": 0.4, "rms": 5.2, "named": True}
    whole = {"joint": "Knee", "regime": "all", "share": 0.1, "rms": 1.1, "named": False}
    (place,) = places({"where": [cell, whole]})
    assert (place.cell, place.when) == (whole, "fast, 5.20 ×")


def test_an_explanation_that_costs_less_says_why_it_is_not_the_verdict() -> None:
    hypothesis = {"effects": ["backlash"], "scopes": ["all"], "gain": {"value": 0.9}, "behind": -300.0}
    text = words(
        report_html({"ranking": [{**hypothesis, "passed_over": "not significantly better"}], "least_gain": 2800.0})
    )
    assert (
        "backlash of all joints 90 % −300 passed over: not significantly better" in text
        and "has to save 2,800 over calibration alone" in text
    )


def test_chance_that_saved_nothing_is_called_so() -> None:
    test = {"cases": 4, "null_gain": -27.3}
    text = words(report_html({"self_test": test, "least_gain": 20.0}))
    assert "Where nothing was wrong, chance saved nothing; an effect has to save 20.0, or to free much" in text
    text = words(report_html({"self_test": test | {"null_gain": 40.0}, "least_gain": 52.0}))
    assert "chance saved 40.0 in cost at most; an effect has to save 52.0, or to free much" in text


def test_a_page_names_folders_as_the_terminal_does() -> None:
    seen = see_from(made.document() | {"world_file": "world/diagnosed.yaml"}, Path("runs/first/diagnose"))
    assert "gsl optimize --config-dir runs/first/diagnose world=diagnosed" in words(report_html(seen))


def test_the_verdict_is_marked_among_the_explanations() -> None:
    document = made.document()
    for ranking in (document["ranking"], document["ranking"][::-1]):
        rows = re.findall(
            r'<th scope="row">([^<]*)<span[^\n]*<td>the verdict</td>', report_html({**document, "ranking": ranking})
        )
        assert rows == ["servo gain of LKneePitch + command latency of all joints"]


def test_a_side_is_worse_only_where_it_is_more_than_noise_and_chance() -> None:
    rows = [("Knee", 4.0, 1.1, 0.01), ("Hip", 0.5, 0.1, 0.01), ("Ankle", 4.0, 3.0, 0.4)]
    text = words(report_html({"sides": [dict(zip(("pair", "left", "right", "p"), row, strict=True)) for row in rows]}))
    assert "Knee 4.00 × 1.10 × 1 % worse on the left" in text
    assert "Hip 0.50 × 0.10 × 1 % both within the noise" in text
    assert "Ankle 4.00 × 3.00 × 40 % alike" in text


def test_policies_are_told_in_the_unit_of_their_task() -> None:
    text = words(draw_page("causes"))
    assert (
        "policy simulator [cm/s] 95 % interval diagnosed [cm/s] 95 % interval real [cm/s] 95 % interval falls" in text
    )
    assert "generation_05 31.0 30.0 to 32.0 21.0 19.0 to 23.0 16.0 0 of 5, 1 of 5, 1 of 5" in text
    assert "3 policies: returns are 6.70 (2.00 to 15.0) cm/s from real in the simulator, 2.00 (0.400 to 5.00)" in text
    assert "Rank correlation with real: −0.50 (−1.0 to 1.0) in the simulator, 1.0 (1.0 to 1.0) in the diagnosed" in text
    assert "25 policies were measured" in text
    none = made.document() | {"policy_gap": None}
    assert "Policies" not in words(report_html(none))
    assert [table for table in summary_lines(none) if "Rank" in str(table)] == []


@pytest.mark.parametrize("kind", DOCUMENTS)
def test_a_terminal_shows_it_in_some_lines(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    document = DOCUMENTS[kind]()
    for table in summary_lines(document):
        Console().table(*table)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert lines[0] == headline(document)
    assert len(lines) <= 25
    assert max(map(len, lines)) <= 130


def test_a_terminal_shows_names_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    for table in summary_lines(made.document(("[red]Knee",), causes=1)):
        Console().table(*table)
    assert "servo gain of [red]Knee" in capsys.readouterr().out


def test_a_corrected_simulator_is_not_for_what_it_does_not_explain() -> None:
    document = {**made.document(causes=1), "unexplained": [{"part": "fast"}, {"part": "Jaw"}]}
    assert steps(document)[0].why.endswith("not where it is still far from the robot: fast, Jaw.")


def test_an_unsure_cause_comes_with_what_would_tell() -> None:
    document = made.document(causes=1)
    (cause,) = document["causes"]
    confused = {**cause, "probability": 0.46, "confused": "kp; two weights tell them apart"}
    unsure = {**document, "causes": [confused], "sure": False, "next_experiment": None}
    reason = steps(unsure)[-1].why
    assert reason.startswith("To be surer of ") and reason.endswith(
        "which is confused with kp; two weights tell them apart."
    )
    assert [step.why for step in steps({**unsure, "causes": [cause]})] == [steps(unsure)[0].why]
