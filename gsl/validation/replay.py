"""Open-loop replay: held-out real actions, from real states, in the simulator, and how far off it is after 0.2 s."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gsl.core.interfaces import Grounding
from gsl.core.layout import Layout
from gsl.core.observation import observations
from gsl.core.trajectory import Trajectory
from gsl.core.transitions import actions, usable
from gsl.models.free_run import TICKS
from gsl.worlds.bullet import BulletEnv
from gsl.worlds.physics import Reading
from gsl.worlds.start import Start

PAST = 6  # ticks for which a grounding watches the real robot before, at least; as many as its models look back
STRIDE = 15  # ticks from one replay to the next


class Place(NamedTuple):
    """Where a replay begins: an episode's observations, shape (T + 1, layout.size), its actions, and the tick."""

    seen: np.ndarray
    actions: np.ndarray
    tick: int


@dataclass(frozen=True)
class Deviations:
    """Simulated less real, one row a replay.

    Attributes:
        joints: [rad], shape (N, n_joints).
        pitch: Of the body [rad], shape (N,).
        forward: Of the body's place [m], shape (N,).
    """

    joints: np.ndarray
    pitch: np.ndarray
    forward: np.ndarray

    @property
    def forward_mm(self) -> float:
        """Root mean square of the body's place [mm]."""
        return 1000.0 * float(np.sqrt(np.mean(self.forward**2)))

    def __len__(self) -> int:
        """Number of replays."""
        return len(self.pitch)


def places(episodes: Sequence[Trajectory], layout: Layout, limit: int, past: int = PAST) -> list[Place]:
    """Return where replays begin, `limit` at most, spread evenly over the episodes.

    Args:
        episodes: Of the real robot.
        layout: Of the simulator's observations.
        limit: Number of places.
        past: Ticks that there are before each, at least.

    Raises:
        KeyError: with the name of a column that was not recorded.
    """
    places = []
    for episode in episodes:
        seen = observations(episode, layout)
        sent = actions(episode, carried_out=True)
        places += [Place(seen, sent, tick) for tick in range(past, usable(episode) - TICKS + 1, STRIDE)]
    chosen = np.unique(np.linspace(0, len(places) - 1, min(limit, len(places))).round().astype(int)) if places else ()
    return [places[index] for index in chosen]


def replay_starts(env: BulletEnv, grounding: Grounding, starts: Sequence[Place], seed: int) -> dict[int, Deviations]:
    """Return the deviations of a simulator with a grounding after one tick and after `TICKS`."""
    ends: dict[int, list[np.ndarray]] = {1: [], TICKS: []}
    for index, place in enumerate(starts):
        rng = np.random.default_rng([seed, index])
        for tick, observation in enumerate(replay(env, grounding, place, rng, TICKS), start=1):
            if tick in ends:
                ends[tick].append(observation)
    return {tick: _deviations(env.layout, np.array(seen), starts, tick) for tick, seen in ends.items()}


def predict_no_change(layout: Layout, starts: Sequence[Place]) -> dict[int, Deviations]:
    """Return the deviations of a prediction that nothing changes."""
    seen = np.array([place.seen[place.tick] for place in starts])
    return {tick: _deviations(layout, seen, starts, tick) for tick in (1, TICKS)}


def replay(
    env: BulletEnv, grounding: Grounding, place: Place, rng: np.random.Generator, ticks: int
) -> Iterator[np.ndarray]:
    """Yield the observations after each tick; the simulator takes over from the real robot at `place.tick`."""
    run, tick = grounding.start(env.layout, rng), place.tick
    watched = max(0, tick - max(PAST, getattr(grounding, "span", 0)))
    sent = [run.transform(place.seen[k], place.actions[k]) for k in range(watched, tick)]
    start = _start(env, place.seen[tick], np.array(sent[::-1]))
    observation, _ = env.reset(seed=int(rng.integers(2**31)), options={"start": start})
    if "foot_force" in env.layout.sizes:
        observation[env.layout["foot_force"]] = place.seen[tick][env.layout["foot_force"]]  # no contact is solved yet
    for k in range(tick, tick + ticks):
        observation, *_ = env.step(run.transform(observation, place.actions[k]))
        yield observation


def _start(env: BulletEnv, seen: np.ndarray, sent: np.ndarray) -> Start:
    layout, drive = env.layout, env.world.plant.robot.drive
    motion = np.array([seen[layout["position"]][drive], seen[layout["velocity"]][drive]])
    quaternion = tuple(seen[layout["base.orientation"]].tolist())
    parts = (seen[layout[part]] for part in ("base.position", "base.velocity", "gyro"))
    place, velocity, gyro = (part.copy() for part in parts)
    return Start(Reading(motion, place, quaternion, velocity, gyro, 1.0, np.zeros(0)), sent[:, drive])


def _deviations(layout: Layout, seen: np.ndarray, starts: Sequence[Place], ticks: int) -> Deviations:
    real = np.array([place.seen[place.tick + ticks] for place in starts])
    forward = layout["base.position"].start
    turn = layout["base.orientation"]
    return Deviations(
        joints=seen[:, layout["position"]] - real[:, layout["position"]],
        pitch=_pitch(seen[:, turn]) - _pitch(real[:, turn]),
        forward=seen[:, forward] - real[:, forward],
    )


def _pitch(quaternion: np.ndarray) -> np.ndarray:
    pitch: np.ndarray = Rotation.from_quat(quaternion).as_euler("ZYX")[:, 1]
    return pitch
