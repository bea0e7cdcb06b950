"""The mix: how many cases of which kind, strength and generator a benchmark has."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gsl.core.setting import component, setting
from gsl_benchmarks.blind.label import ABSENT, FOREIGN, JOINT, NULL, SAME, SINGLE, TWO, WALK, WITHHELD

WEAK, MEDIUM, STRONG = "weak", "medium", "strong"
STRENGTHS = {
    SINGLE: (WEAK, MEDIUM, STRONG),
    JOINT: (MEDIUM, STRONG),
    TWO: (MEDIUM,),
    WITHHELD: (MEDIUM, STRONG),
    ABSENT: (MEDIUM, STRONG),
}


@component
class Mix:
    """Shares of the cases; with as many cases as their sum they are the numbers of cases."""

    no_cause: Annotated[int, setting("robots that differ from the simulator as any two of one make do", ge=0)] = 40
    single: Annotated[int, setting("one effect on all joints or a group, in three strengths", ge=0)] = 112
    joint: Annotated[int, setting("one effect on a single joint", ge=0)] = 24
    two: Annotated[int, setting("two effects", ge=0)] = 24
    withheld: Annotated[int, setting("an effect that is taken out of the answering library", ge=0)] = 20
    absent: Annotated[int, setting("an effect that the library never had", ge=0)] = 20
    foreign: Annotated[int, setting("of all these, those of the foreign generator, with a reference log", ge=0)] = 60
    walk: Annotated[int, setting("robots that walk, beside all these whatever `cases` is", ge=0)] = 0

    @property
    def kinds(self) -> dict[str, int]:
        """Shares by kind, of the cases in the air."""
        shares = {kind: getattr(self, kind) for kind in (SINGLE, JOINT, TWO, WITHHELD, ABSENT)}
        return {NULL: self.no_cause, **shares}

    def __post_init__(self) -> None:
        """Refuse a mix of nothing and more foreign cases than cases."""
        if not 0 < sum(self.kinds.values()) >= self.foreign:
            raise ValueError("needs at least one case, and not more foreign ones than cases")


class Slot(NamedTuple):
    """A place that a case has to fill.

    Attributes:
        kind, generator, strength: What is wanted.
        turn: Which of the effects is tried first, so that all have their turn.
        programme: Number of the commands.
    """

    kind: str
    generator: str
    strength: str
    turn: int
    programme: int


def slots(mix: Mix, cases: int, programmes: int, rng: np.random.Generator) -> list[Slot]:
    """Return the slots in the air in random order, the foreign ones spread evenly over kinds and strengths."""
    wanted = [(kind, turn) for kind, count in apportion(mix.kinds, cases).items() for turn in range(count)]
    share = mix.foreign / sum(mix.kinds.values())
    slots: list[Slot] = []
    firsts: dict[tuple[str, str], int] = {}
    for index, (kind, turn) in enumerate(wanted):
        generator = FOREIGN if int((index + 1) * share + 1e-9) > int(index * share + 1e-9) else SAME
        strengths = STRENGTHS.get(kind, ("none",))
        strength = strengths[turn % len(strengths)]
        first = firsts.setdefault((kind, strength), int(rng.integers(1000)))
        slots.append(Slot(kind, generator, strength, first + turn // len(strengths), 0))
    order = rng.permutation(len(slots))
    return [slots[k]._replace(programme=place % programmes) for place, k in enumerate(order)]


def walk_slots(mix: Mix, rng: np.random.Generator) -> list[Slot]:
    """Return the slots of the robots that walk; they come after all others, which they do not change."""
    first = int(rng.integers(1000))
    return [Slot(WALK, SAME, STRONG, first + turn, 0) for turn in range(mix.walk)]


def apportion(shares: dict[str, int], total: int) -> dict[str, int]:
    """Return whole numbers in proportion to shares that add up to a total (largest remainders)."""
    exact = {key: total * share / sum(shares.values()) for key, share in shares.items()}
    whole = {key: int(value) for key, value in exact.items()}
    for key in sorted(exact, key=lambda name: whole[name] - exact[name])[: total - sum(whole.values())]:
        whole[key] += 1
    return whole
