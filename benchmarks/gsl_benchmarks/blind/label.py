"""A label: what a case's robot really has, which nobody reads before the answers are in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

SAME, FOREIGN = "same", "foreign"
NULL, SINGLE, JOINT, TWO, WITHHELD, ABSENT = "null", "single", "joint", "two", "withheld", "absent"
WALK = "walk"  # one effect, on the ground; all others are in the air
KNOWN = (SINGLE, JOINT, TWO)  # kinds in the air whose causes are in the library


@dataclass(frozen=True)
class Label:
    """The truth of a case.

    Attributes:
        case: Its name.
        kind: One of the words above.
        generator: `same` (gsl's chain model, or Bullet on the ground) or `foreign` (other servos in MuJoCo).
        strength: `none`, `weak`, `medium` or `strong`.
        gap: What the causes alone do, in floors: rms of what they change in the nominal simulator's replay, and noise.
        effects: As a world's `effects:`, one entry each.
        neutral: Values at which the parameters of each effect that were dialled do nothing.
        extra: Name and parameters of what the library never had.
        without: Effects that the answering library has to do without.
        programme: Number of the commands.
        noise: Standard deviation of the encoders [rad].
        clock: Standard deviation of the logger's clock, in control periods.
    """

    case: str
    kind: str
    generator: str
    strength: str = "none"
    gap: float = 1.0
    effects: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    neutral: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    extra: Mapping[str, Any] | None = None
    without: tuple[str, ...] = ()
    programme: int = 0
    noise: float = 0.0
    clock: float = 0.0

    @property
    def truth(self) -> tuple[str, ...]:
        """Names of the effects that are to be found; none if they are not in the library that answers."""
        return tuple(self.effects) if self.kind in (*KNOWN, WALK) else ()

    @property
    def document(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Label:
        """Read a document again; keys that are not known are left out, missing ones have their defaults."""
        fields = {key: document[key] for key in cls.__dataclass_fields__ if key in document}
        return cls(**{**fields, "without": tuple(fields.get("without", ()))})
