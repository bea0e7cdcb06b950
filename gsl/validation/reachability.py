"""Reachability: is there an action of the simulator that does what the forward model predicts (the paper's section 9)?

Asked of the simulator itself: from a real state, its own actions are corrected joint by joint (secant steps) until each
joint moves as predicted, or the action is at the end of what a grounding may send.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gsl.core.history import windows
from gsl.core.layout import Layout
from gsl.core.observation import Senses
from gsl.grounding.gat import REACH, LoadedTransformation
from gsl.validation.replay import PAST, Place, replay

STEPS = 6  # of the secant iteration
PROBE = 0.05  # first change of the actions [rad]
LEAST = 1e-3  # change of a joint per change of its action that still counts as an answer
TOLERANCE = 0.1  # share of what a joint moves in a tick by which a prediction may be missed
FLOOR = 1e-3  # and [rad]: a start in a measured state alone is off by as much


class Reachability(NamedTuple):
    """How much of what is predicted the simulator can do.

    Attributes:
        joints: Names of the joints.
        unreached: Share of steps in which no action was found, by joint, shape (n_joints,).
        steps: Number of steps.
    """

    joints: tuple[str, ...]
    unreached: np.ndarray
    steps: int

    @property
    def share(self) -> float:
        """Over all joints."""
        return float(self.unreached.mean())

    @property
    def sentence(self) -> str:
        """In a sentence."""
        worst = int(np.argmax(self.unreached))
        share = f"in {100 * self.share:.0f} % of the steps and joints no action of the simulator does what is predicted"
        if self.unreached[worst] == 0.0:
            return share
        return f"{share}, most often in {self.joints[worst]} ({100 * self.unreached[worst]:.0f} %)"

    def metrics(self) -> dict[str, Any]:
        """Return everything as a JSON document."""
        shares = dict(zip(self.joints, self.unreached.tolist(), strict=True))
        return {"steps": self.steps, "unreached": self.share, "by_joint": shares}


def reachability(env: Any, grounding: LoadedTransformation, starts: Sequence[Place], seed: int) -> Reachability:
    """Try to carry out the forward model's expectation at every start, one tick ahead.

    Args:
        env: The simulator.
        grounding: Whose forward model.
        starts: On real trajectories that no model has seen.
        seed: Of all randomness.
    """
    x, joints = env.layout["position"], grounding.forward.joints
    numbers = env.layout.numbers(joints)
    changes = np.array([place.seen[place.tick + 1][x] - place.seen[place.tick][x] for place in starts])
    wanted = changes.copy()  # of joints that the models do not know nothing else is expected
    wanted[:, numbers] = [_expect(grounding, place, numbers, env.layout) for place in starts]
    tolerance = FLOOR + TOLERANCE * np.sqrt(np.mean(changes[:, numbers] ** 2, axis=0))
    missed = [measure_misses(env, place, target, seed)[numbers] for place, target in zip(starts, wanted, strict=True)]
    return Reachability(joints, np.mean(np.abs(missed) > tolerance, axis=0), len(starts))


def _expect(grounding: LoadedTransformation, place: Place, numbers: list[int], layout: Layout) -> np.ndarray:
    """Return what the forward model expects of the agent's action at a start [rad], shape (len(known),)."""
    history, seen = grounding.forward.history, place.seen[: place.tick + 1]
    senses = Senses(layout, history.sensors)
    sensed = np.array([senses.read(observation) for observation in seen])
    ticks = np.array([place.tick])
    position = seen[:, layout["position"]][:, numbers]
    return grounding.forward.effects(windows(history, position, place.actions[:, numbers], sensed, ticks))[0]


def measure_misses(env: Any, place: Place, wanted: np.ndarray, seed: int) -> np.ndarray:
    """Return by how much each joint misses its wanted change at best [rad], shape (n_joints,)."""
    x = env.layout["position"]
    before, now = np.zeros(len(wanted)), np.where(wanted > 0.0, PROBE, -PROBE)
    error = _move(env, place, before, seed)[x] - place.seen[place.tick][x] - wanted
    least = np.abs(error)
    for _ in range(STEPS):
        next_error = _move(env, place, now, seed)[x] - place.seen[place.tick][x] - wanted
        least = np.minimum(least, np.abs(next_error))
        step = now - before
        slope = np.where(step == 0.0, LEAST, (next_error - error) / np.where(step == 0.0, 1.0, step))
        before, error = now, next_error
        now = np.clip(now - next_error / np.maximum(slope, LEAST), -REACH, REACH)
    return least


def _move(env: Any, place: Place, change: np.ndarray, seed: int) -> np.ndarray:
    """Return what is seen one tick after a start whose action is changed [rad], shape (layout.size,)."""
    return next(replay(env, _Changed(change), place, np.random.default_rng(seed), 1))


class _Changed:
    """Sends the agent's actions until the replay begins, and the changed one then."""

    def __init__(self, change: np.ndarray) -> None:
        self._change, self._sent = change, 0

    def start(self, layout: Layout, rng: np.random.Generator) -> _Changed:
        return self

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        self._sent += 1
        return action if self._sent <= PAST else action + self._change
