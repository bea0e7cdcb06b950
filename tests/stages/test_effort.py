"""What an iteration plans: its links, in proportion to their work, and the time that is said beforehand."""

from __future__ import annotations

from typing import Any

import pytest

from gsl.commandline.composer import compose
from gsl.commandline.config import prepare, resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.stages.effort import count_rollouts, foresee, links


def planned(*settings: str) -> Any:
    with open_hydra(None):
        return prepare(resolve(compose("iterate", [*settings, "workers=1"])))[0]


@pytest.mark.parametrize(
    ("settings", "count"),
    [
        (("grounding=none",), 2),
        (("grounding=none", "beside=true", "pretrained=true"), 5),
        (("grounding=servo",), 4),
        (("grounding=gat",), 6),
        (("grounding=gat", "iterations=3"), 18),
        (("grounding=effects",), 4),
        (("grounding=effects", "grounding.method=identify"), 4),
    ],
)
def test_every_grounding_has_its_links(settings: tuple[str, ...], count: int) -> None:
    assert len(links(planned("preset=toy", *settings))) == count


def test_twice_the_rollouts_take_twice_as_long() -> None:
    once, twice = (
        planned("preset=paper", "grounding=none", "iterations=1", f"budget.rollouts={count}") for count in (20, 40)
    )
    assert count_rollouts(once) == 30_000 and count_rollouts(twice) == 60_000
    (search, _), (longer, _) = links(once), links(twice)
    assert longer.seconds == pytest.approx(2.0 * search.seconds) and longer.steps == 60_000


def test_a_long_iteration_says_beforehand_how_long_it_takes() -> None:
    parts, said = foresee(planned("preset=paper", "task.duration=0.2"))
    assert said.startswith("about ") and "h for 2 iterations with 60000 rollouts" in said.replace("min", "h")
    assert sum(part.seconds for part in parts) > 0.0
    assert foresee(planned("preset=toy"))[1] == ""
