"""What a search promised of the policy that an evaluation returns, beside what the real world gives.

A search picks its best candidate by its value in simulation. Where the simulator is wrong, that is the one that gains
most by the error, and its value is an empty promise: what CMA-ES found is how the simulator errs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from gsl.core.unit import Unit
from gsl.storage.policies import PolicyRecord

# Share of a promise by which it may miss. The best of a generation is chosen by few episodes, so that its value is a
# little high in a perfect simulator too: winners in a learned servo's simulator walked at 0.98 to 1.02 of theirs.
ROOM = 0.05


def promise(
    policies: Sequence[PolicyRecord], best: int, measured: Mapping[str, Any], unit: Unit
) -> dict[str, Any] | None:
    """Return what was promised beside what was measured, with a `warning` if it was not kept; None without one.

    A promise is broken where it lies above the upper end of the real 95 % interval by more than `ROOM`. Where the
    baseline is returned, the promise is the greatest of the search, and the policy that gives more was not found.

    Args:
        policies: Those that were evaluated, the baseline first.
        best: Index of the one that is returned.
        measured: The summary of its fresh episodes: its value and interval.
        unit: Of what people are shown.
    """
    promising = [policies[best]] if best else policies[1:]
    values = {record.name: record.value_sim for record in promising if record.value_sim is not None}
    if not values:
        return None
    policy = max(values, key=lambda name: values[name])
    value, upper = values[policy], measured["interval"][1]
    room = ROOM * abs(value)
    broken = upper is not None and math.isfinite(upper) and value > upper + room
    returned = policy if best else policies[0].name
    reached = f"{unit.format(measured['value'])} on the real side, {unit.format(upper)} at most (95 %)"
    warning = f"the search promised {unit.format(value)} ({policy}), but {returned} gives {reached}" if broken else ""
    return {"policy": policy, "value_sim": value, "value": measured["value"], "upper": upper, "warning": warning}
