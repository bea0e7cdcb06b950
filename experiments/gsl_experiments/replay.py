"""A replay study's row: one method, once, in one real world, and how its simulator's joints move and yield."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple


class Replay(NamedTuple):
    """One method, once, in one real world: root mean square errors over replays of real actions off π0.

    Attributes:
        world, method, trial: What was tried.
        after_a_tick: Of the joints [deg].
        joints, pitch: After 0.2 s [deg].
        forward: Of the body's place after 0.2 s [mm].
        unreached: Share of steps and joints in which no action of the simulator does what f predicts; None where
            nothing is predicted a tick ahead.
        alpha: How far the grounding goes, None where it is no transformation.
        replays: Their number.
        stiffness: Compliance transferred by group of joints: 0 as stiff as the simulator, 1 as the real robot, None
            where these two do not differ. None as a whole where nobody measured, as in trials of before.
        strength: The same of the load at which a joint gives way.
        stiffness_closed: Share of the gap in stiffness and damping that is closed joint by joint: 1 at best, below 0
            where it grew. Joints that go too far do not make up for others, as they do in `stiffness`.
        strength_closed: The same of the load at which a joint gives way.
    """

    world: str
    method: str
    trial: int
    after_a_tick: float
    joints: float
    pitch: float
    forward: float
    unreached: float | None
    alpha: float | None
    replays: int
    stiffness: Mapping[str, float | None] | None = None
    strength: Mapping[str, float | None] | None = None
    stiffness_closed: Mapping[str, float | None] | None = None
    strength_closed: Mapping[str, float | None] | None = None

    @property
    def contradiction(self) -> str:
        """What cannot be, of figures that a file told."""
        if not self.trial > 0 < self.replays:
            return f"trial {self.trial}, replays {self.replays}"
        errors = self.after_a_tick, self.joints, self.pitch, self.forward
        shares = (self.unreached or 0.0, self.alpha or 0.0)
        if min(errors) < 0.0 or not all(0.0 <= share <= 1.0 for share in shares):
            return f"errors {errors}, unreached {self.unreached}, alpha {self.alpha}"
        parts = self.stiffness, self.strength, self.stiffness_closed, self.strength_closed
        groups = [None if part is None else set(part) for part in parts]
        return "" if all(part == groups[0] for part in groups) else f"shares of groups {groups}"

    def nearness(self, group: str) -> float | None:
        """Return how nearly a group's joints yield as the robot's, 1 at best; None where nobody knows.

        The mean of what is closed joint by joint in stiffness and strength, as far as simulator and robot differ.
        """
        parts = [(part or {}).get(group) for part in (self.stiffness_closed, self.strength_closed)]
        near = [share for share in parts if share is not None]
        return math.fsum(near) / len(near) if near else None
