"""What a search for wiring faults ends with."""

from __future__ import annotations

from dataclasses import dataclass

from gsl.diagnosis.wiring.fault import Fault
from gsl.diagnosis.wiring.physics import Fit


@dataclass(frozen=True)
class Stand:
    """A fault that stands.

    Attributes:
        fault: What.
        before, after: Physics alone, and physics beside the fault.
        rivals: Other faults that do about as well.
    """

    fault: Fault
    before: Fit
    after: Fit
    rivals: tuple[Fault, ...] = ()


@dataclass(frozen=True)
class Wiring:
    """What a search found.

    Attributes:
        stands: Faults, in the order in which they were found.
        before, after: The best physics of the log as it is, and of the mended log.
        doubted: A fault that would stand, were there more than one motion and a larger gap: friction or soft gains may
            do the same.
        late: By how many whole rows all commands act later, 0 if by none: a shift, or a latency.
    """

    stands: tuple[Stand, ...]
    before: Fit
    after: Fit
    late: int
    doubted: Fault | None = None
