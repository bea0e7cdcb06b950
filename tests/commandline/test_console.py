"""The console speaks to people on stderr and gives results on stdout."""

import json
import logging
import re
import sys
import time
from contextlib import suppress

import pytest

from gsl.cli import call
from gsl.core.workload import Part
from gsl.report.console import Console
from gsl.report.tables import fitting


def test_results_go_to_stdout_and_talk_to_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console()
    console.status("collecting [all] of it")
    console.table("speeds", ["policy", "speed"], [("first", 0.2), ("best", 0.31)], caption="in m/s")
    printed = capsys.readouterr()
    assert printed.err == "collecting [all] of it\n"
    assert [word for word in ("speeds", "first", "0.31", "in m/s") if word in printed.out] != []
    assert "\x1b" not in printed.out


def test_with_json_stdout_holds_one_document_without_nan(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(json=True)
    console.table("speeds", ["policy"], [("first",)])
    with console.progress(3, "steps") as progress, console.live_table("rounds", ["round", "value"]) as table:
        progress.advance()
        table.row(1, 0.5)
    console.result({"value": float("nan")})
    assert json.loads(capsys.readouterr().out) == {"value": None}


def test_rows_of_a_live_table_are_lines_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console()
    with console.live_table("rounds [m/s]", ["round", "value", "what it is made of"]) as table:
        table.row(1, "", "air")
        table.row("a very long round", 0.5, "")
        console.status("walking")
        table.row(3, 0.25, "water")
    printed = capsys.readouterr()
    assert printed.err.splitlines() == [
        "rounds [m/s]",
        "  round          value          what it is made of",
        "  1                             air",
        "  a very long round  0.5",
        "walking",
        "rounds [m/s]",
        "  round              value          what it is made of",
        "  3                  0.25           water",
    ]
    assert printed.out == ""


def test_brackets_are_text_and_long_tables_are_not_cut(capsys: pytest.CaptureFixture[str]) -> None:
    Console().table("speed [cm/s]", ["policy", "way [mm]"], [("[red]", "x" * 150)], caption="[bold] is no style")
    printed = capsys.readouterr().out
    for text in ("speed [cm/s]\n", "way [mm]", "[red]", "x" * 150, "[bold] is no style"):
        assert text in printed


def test_a_terminal_gets_a_bar_and_a_growing_table(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    console = Console()
    with console.progress(3, "walking") as progress:
        progress.advance()
        progress.advance(2)
    with console.live_table("rounds", ["round", "value"]) as table:
        table.row(1, 0.5)
        with console.progress(2, "optimizing") as progress:
            progress.advance(2)
    printed = capsys.readouterr()
    assert "100 % done" in printed.err
    assert "0.5" in printed.err
    assert printed.out == ""


def on_a_terminal(monkeypatch: pytest.MonkeyPatch, columns: int) -> Console:
    for name, value in {"FORCE_COLOR": "1", "NO_COLOR": "1", "TERM": "xterm", "COLUMNS": str(columns)}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    return Console()


def test_words_of_a_growing_table_stay_whole(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    console = on_a_terminal(monkeypatch, 60)
    titles = ["iteration", "policy", "in simulation", "in real", "95 % interval", "falls", "gain over the last"]
    with console.live_table("rounds [cm/s]", titles) as table:
        table.row(1, "generation_01", "24.5", "25.3", "24.3 to 26.3", "0 of 3", "+8.1 %")
    said = capsys.readouterr().err
    assert all(word in said for word in ("generation_01", "simulation", "interval", "[cm/s]"))


def test_what_is_said_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="gsl"):
        Console().status("collecting")
    assert caplog.messages == ["collecting"]


def test_a_table_leaves_out_columns_that_there_is_no_room_for(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    columns = [f"column_{k:05d}" for k in range(20)]
    Console().table("t", ["name", *columns], [["a", *range(20)]])
    assert capsys.readouterr().out.split()[2:22] == columns  # a file has room for all
    on_a_terminal(monkeypatch, 200).table("t", ["name", *columns], [["a", *range(20)]])
    heading, left_out = re.sub(r"\x1b\[\d*m", "", capsys.readouterr().out).split("8 more in a wider window: ")
    assert heading.split()[2:14] == columns[:12] and left_out.strip().split(", ") == columns[12:]


def test_words_of_a_table_stay_whole_where_there_is_room_for_some_columns() -> None:
    widths = fitting(["name", "improvement [%]", "95 % interval"], [["gat", "3.6", "0.3 to 6.9"]], 34)
    assert widths == [4, 11, 9]
    assert fitting(["name", "improvement [%]"], [["gat", "3.6"]], 10) == [4]
    assert fitting(["name", "improvement [%]"], [["gat", "3.6"]], 10, leave_out=False) == [4, 11]
    assert fitting(["name", "took"], [["a/long/reference/to/copy", "1 min"]], 40) == [24, 5]  # whole
    assert fitting(["name", "took"], [["a/long/reference/to/copy", "1 min"]], 30) == [18, 5]  # folded: all columns
    assert (
        fitting(["name"], [["漢字漢字"]], 40) == [8] and fitting(["name"], [], 40) == [4] and fitting([], [], 40) == []
    )


def test_tables_of_a_part_are_progress(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console()
    with console.part("gat, trial 1"):
        with suppress(KeyError), console.part("its second round"):
            console.table("values", ["a"], [[1]])
            raise KeyError
        console.table("errors", ["a"], [[1]])
        console.status("warning: look at this")
        with console.live_table("rounds", ["round"]) as rounds:
            rounds.row(1)
    console.table("results", ["a"], [[1]])
    out, err = capsys.readouterr()
    assert "its second round: values" in err and "gat, trial 1: errors" in err and "gat, trial 1: rounds" in err
    assert "errors" not in out and "results" in out
    assert "warning: gat, trial 1: look at this\n" in err


def test_progress_without_a_terminal_is_a_line_every_ten_seconds_at_most(
    capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    console = Console()
    with caplog.at_level(logging.INFO, logger="gsl"), console.plan("stage", [Part(30.0, 60), Part(30.0, 30)]):
        for name, steps in {"collect": 60, "optimize": 30}.items():
            console.begin(name)
            with console.progress(steps, "walking") as progress:
                for _ in range(steps):
                    now += 0.5
                    progress.advance()
            console.finish()
    assert capsys.readouterr().err.splitlines() == [
        "17 % done, about 50 s left; stage 1 of 2 (collect), walking: 20 of 60, 2.0 a second",
        "33 % done, about 40 s left; stage 1 of 2 (collect), walking: 40 of 60, 2.0 a second",
        "50 % done, about 30 s left; stage 1 of 2 (collect), walking: 60 of 60, 2.0 a second",
        "83 % done, about 8 s left; stage 2 of 2 (optimize), walking: 20 of 30, 2.0 a second",
    ]
    assert caplog.messages == []  # nothing of it enters the log of an artifact


def test_work_that_says_nothing_shows_its_stage_within_two_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console()
    with console.at_work("diagnose"):
        console.phase("looking at the wiring")
        time.sleep(2.0)
        said = capsys.readouterr()
    assert said == ("", "looking at the wiring, 1 s\n")
    with console.at_work("diagnose"):
        pass
    assert capsys.readouterr() == ("", "")  # what is done soon says nothing


def test_work_that_says_nothing_is_silent_where_that_was_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["-q", "--version"]) == 0
    capsys.readouterr()
    with Console().at_work("diagnose"):
        time.sleep(1.5)
    Console.quiet = False
    assert capsys.readouterr() == ("", "")


def test_a_terminal_shows_a_phase_at_once_and_without_colours_where_there_are_none(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    console = on_a_terminal(monkeypatch, 80)
    with console.at_work("diagnose"):
        console.phase("looking at the wiring")
        time.sleep(0.5)
        console.table("result", ["a"], [[1]])
    said = capsys.readouterr().err
    assert "looking at the wiring, 0 s" in said and "result" in said
    assert not re.search(r"\x1b\[[\d;]*m", said)


def test_quiet_shows_no_progress(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    console, now = on_a_terminal(monkeypatch, 80), 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    assert call(["-q", "--version"]) == 0
    capsys.readouterr()
    with console.plan("stage", [Part(1.0, 4)]), console.live_table("rounds", ["round"]) as table:
        with console.progress(4, "walking") as progress:
            now += 60.0
            progress.advance(4)
        table.row(1)
    Console.quiet = False
    assert capsys.readouterr() == ("", "")


def test_a_terminal_without_colours_gets_none(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    console = on_a_terminal(monkeypatch, 200)
    with console.progress(4, "walking") as progress:
        progress.fell(2)
        progress.best("best 20.0 cm/s in simulation")
        progress.advance(2)
    said = capsys.readouterr().err
    assert "50 % done" in said and "best 20.0 cm/s in simulation, 2 falls" in said
    assert not re.search(r"\x1b\[[\d;]*m", said)


def test_quiet_leaves_results_warnings_and_errors(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["-q", "--version"]) == 0
    console = Console()
    console.status("at work")
    console.status("warning: look at this")
    console.result({}, text="done")
    Console.quiet = False
    said = capsys.readouterr()
    assert said.err == "warning: look at this\n"
    assert said.out.splitlines()[-1] == "done"
    assert call(["nonsense", "--quiet"]) == 2
    assert call(["--version"]) == 0
    console.status("at work")
    assert "at work" in capsys.readouterr().err
