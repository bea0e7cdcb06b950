"""The console speaks to people on stderr and gives results on stdout."""

import json
import logging

import pytest

from gsl.console import Console


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
    with Console().live_table("rounds", ["round", "value"]) as table:
        table.row(1, 0.5)
    assert capsys.readouterr().err == "round: 1  value: 0.5\n"


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
    assert "100%" in printed.err
    assert "0.5" in printed.err
    assert printed.out == ""


def test_what_is_said_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="gsl"):
        Console().status("collecting")
    assert caplog.messages == ["collecting"]
