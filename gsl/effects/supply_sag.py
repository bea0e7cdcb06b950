"""The common supply's voltage sags under load, and with it every motor's torque limit and no-load speed."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class SupplySag:
    """Battery, cables and connectors have a resistance: V = V0 - resistance · sum of |torque| / torque constant.

    Signature: as weak and slow motors, but only while many of them work: one joint alone does better than the same
    joint among all. Confused with a torque limit, which does not care what the others do, and load-dependent friction;
    moving one joint and then all of them, or a log of the voltage, separates them.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 8

    resistance: Annotated[float, setting("of the supply that all motors share", unit="Ω", ge=0, lower=0.0, upper=1.0,
                                         source="estimate: 0.1-1 with cables and a worn battery")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant on a weaker supply; `joints` are those that suffer, the current is that of all."""
        mask, servo = scope(plant, self.joints), plant.servo
        return plant.with_servo(supply_resistance=servo.supply_resistance + np.where(mask, self.resistance, 0.0))
