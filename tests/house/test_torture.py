"""The campaign of `make torture`, short: kills, flipped bits, rubbish, full disks; nothing happens that must not."""

from __future__ import annotations

from pathlib import Path

import pytest
from torture import campaign

pytestmark = pytest.mark.slow

PARTS = {"kills": 1, "flips": 20, "inputs": 16, "disks": 1}


@pytest.mark.parametrize("part", PARTS)
def test_nothing_happens_that_must_not(part: str, chain: Path) -> None:
    counts = campaign(chain, seed=3, **{name: number * (name == part) for name, number in PARTS.items()})
    assert {what: count for what, count in counts.items() if what.startswith("!") and count} == {}
