"""The benchmark of the audit: its cases are the same for a seed, and its table counts them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from commands import done

pytestmark = pytest.mark.slow

TOY = (
    "sim.robot=blind_arm.arm", "sim.floating=false", "excitation.motions=[steps_large,triangle_fast]",
    "excitation.repeated=[steps_large]", "excitation.duration=2.0", "workers=1", "faults=3", "others=2",
)  # fmt: skip


def test_cases_are_drawn_audited_and_counted(tmp_path: Path) -> None:
    done("blind", "wiring", *TOY, "name=a", folder=tmp_path)
    done("blind", "wiring", *TOY, "name=b", folder=tmp_path)
    first, second = (
        json.loads((tmp_path / f"runs/{name}/blind_wiring/cases.json").read_text())["cases"] for name in "ab"
    )
    assert [(case["kind"], case["joints"], case["found"]) for case in first] == [
        (case["kind"], case["joints"], case["found"]) for case in second
    ]
    assert [bool(case["truth"]) for case in first] == [True] * 3 + [False] * 2
    table = (tmp_path / "runs/a/blind_wiring/table.md").read_text()
    assert "| all | 3 |" in table and "| physics | 1 |" in table
