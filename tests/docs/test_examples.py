"""The notebooks of examples/ run, cell by cell, and what they make is what docs/ say of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

# What is run otherwise than it is printed, so that it is over sooner.
SHRUNK = {"nulls=1": "nulls=0"}
EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.ipynb"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_a_notebook_runs(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert not any(cell.get("outputs") for cell in cells)  # what it says is not stored
    for number, source in enumerate(code):
        for printed, shorter in SHRUNK.items():
            source = source.replace(printed, shorter)  # noqa: PLW2901
        exec(compile(source, f"{path.name}, cell {number}", "exec"), names)  # noqa: S102
    assert capsys.readouterr().out
    if path.stem == "diagnose_a_log":
        look_at(names["found"])


def look_at(findings: Any) -> None:
    """A diagnosis is an object with its page."""
    assert "command_latency" in findings.causes
    assert str(findings).startswith(f"{findings.verdict}: ")
    assert 'iframe srcdoc="' in findings._repr_html_()
    assert 'sandbox="allow-scripts"' in findings._repr_html_()  # of an origin of its own: not the notebook's
    assert "command_latency" in findings.world.effects
    assert findings.page == findings.folder / "report.html"
    delay = findings.suspects.set_index("parameter").loc["delay"]
    assert (delay.effect, delay.unit) == ("command_latency", "s") and delay.low < delay.value < delay.high


def test_there_are_two() -> None:
    assert [path.stem for path in EXAMPLES] == ["diagnose_a_log", "ground_a_policy"]
