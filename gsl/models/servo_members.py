"""An ensemble of learned servos in one checkpoint: members that were fitted to other draws of one log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gsl.errors import ConfigError
from gsl.models.servo import ServoModel


@dataclass(frozen=True)
class ServoMembers:
    """Learned servos of one robot; the first one is the servo that a world has unless it names another.

    Attributes:
        members: At least one, all with the same joints and groups.
    """

    kind: ClassVar[str] = ServoModel.kind

    members: tuple[ServoModel, ...]

    def member(self, number: int, name: str) -> ServoModel:
        """Return a member.

        Args:
            number: The first is 0.
            name: What the user calls the servo.

        Raises:
            ConfigError: There is none of this number.
        """
        if number < len(self.members):
            return self.members[number]
        most = len(self.members) - 1
        problem = f"members of {name} are numbered from 0 to {most}; gsl train-servo members=N makes more"
        raise ConfigError("servo_member", problem, given=str(number))

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint holds, by name: the first member as if it were alone, further ones by number."""
        first, *further = (member.arrays() for member in self.members)
        numbered = {_name(k, name): values for k, arrays in enumerate(further, 1) for name, values in arrays.items()}
        return {**first, **numbered}

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says about them."""
        return {**self.members[0].description(), "members": len(self.members)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> ServoMembers:
        """Return the members of a checkpoint; a file that does not count them has one.

        Raises:
            KeyError: An array or a part of the description is missing.
            ValueError: An array has another shape.
        """
        first, further = ServoModel.from_arrays(arrays, about), []
        for k in range(1, about.get("members", 1)):
            prefix = _name(k, "")
            own = {name.removeprefix(prefix): values for name, values in arrays.items() if name.startswith(prefix)}
            further.append(ServoModel.from_arrays(own, about))
        return cls((first, *further))


def _name(number: int, name: str) -> str:
    return f"member_{number}.{name}"
