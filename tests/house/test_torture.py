"""The campaign of `make torture`, short: kills, flipped bits, rubbish, full disks; nothing happens that must not."""

from __future__ import annotations

from pathlib import Path

import pytest
from torture import Slice, run

pytestmark = pytest.mark.slow

SHORT = (
    Slice("kills", "train-forward", 0, 2),
    Slice("flips", "", 0, 20),
    Slice("inputs", "", 0, 20),
    Slice("disks", "", 0, 1),
)


@pytest.mark.parametrize("of", SHORT, ids=lambda of: f"{of.part} {of.name}".strip())
def test_nothing_happens_that_must_not(of: Slice, chain: Path) -> None:
    if of.part == "inputs":
        pytest.importorskip("hypothesis")
    counts = run(chain, of, seed=3)
    assert {what: count for what, count in counts.items() if what.startswith("!") and count} == {}
    assert sum(counts.values()) > 0
