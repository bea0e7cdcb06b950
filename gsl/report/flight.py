"""What an excitation of the robot in the air cost and gave, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from gsl.grounding.diagnosis_file import Diagnosis


class Flight(NamedTuple):
    """What an excitation in the air cost, and what came of it: a diagnosis, a learned servo, or both.

    Attributes:
        episodes: Motions.
        seconds: Their duration.
        diagnosis: What was found, None where nothing was diagnosed.
        servo: Metrics of the learned servo, None where none was learned.
    """

    episodes: int
    seconds: float
    diagnosis: Diagnosis | None = None
    servo: Mapping[str, Any] | None = None

    @property
    def findings(self) -> tuple[str, ...]:
        """What was found, and what is done with it: of the diagnosis, then of the servo."""
        return tuple(filter(None, (self.verdict, self.gap)))

    @property
    def verdict(self) -> str:
        """What a diagnosis says, nothing where there is none."""
        if self.diagnosis is None:
            return ""
        verdict = self.diagnosis.verdict.replace("_", " ")
        return f"Diagnosis: {verdict}. {self.diagnosis.summary} {self.diagnosis.sentence}"

    @property
    def gap(self) -> str:
        """How near a learned servo is, nothing where none was learned."""
        return "" if self.servo is None else describe_servo(self.servo)


def describe_servo(metrics: Mapping[str, Any]) -> str:
    """Return how near a learned servo is to the robot, from its metrics."""
    before, after = metrics["floors_before"], metrics["floors_after"]
    fell = f"on held-out motions the gap fell from {before:.1f} to {after:.2f} noise floors"
    return f"Learned servo: {fell}. It acts on every joint's torque in the simulator."
