"""What a person looks at after `iterate`: one joint's traces (the paper's figure 6), and a walk frame by frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.interfaces import Grounding, Policy, World
from gsl.core.layout import Layout
from gsl.core.observation import missing, observations
from gsl.core.seeds import derive_seed
from gsl.core.trajectory import Batch, Trajectory
from gsl.core.transitions import actions
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.log.records import LOADED
from gsl.grounding.none import NoGrounding
from gsl.policies.policy import describe_command
from gsl.report.film import Shot, film
from gsl.report.footfalls import Walk
from gsl.report.iteration_page import Seen
from gsl.report.joint_trace import Traces, joint_trace
from gsl.report.shown import scale_of
from gsl.report.style import GROUNDED, REAL
from gsl.rollout.rollout import Scenario, play_once
from gsl.validation.replay import PAST, Place, replay
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.ensemble import EnsembleWorld
from gsl.worlds.randomised import RandomisedWorld

TRACE, WALK = "joint_trace.png", "walk.png"
TAKEN_OVER, SHOWN = 2.0, 0.8  # when the simulators take over from the real robot, and for how long [s]


class Way(NamedTuple):
    """A simulator and what stands between actions and it."""

    world: BulletWorld
    grounding: Grounding


class _Listening:
    """A grounding that keeps what it sends."""

    def __init__(self, inner: Grounding) -> None:
        self._inner, self.sent = inner, list[np.ndarray]()
        self.span = getattr(inner, "span", 0)

    def start(self, layout: Layout, rng: np.random.Generator) -> _Listening:
        """Return itself at the beginning of an episode."""
        self._run = self._inner.start(layout, rng)
        return self

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return what the grounding sends."""
        self.sent.append(self._run.transform(observation, action))
        return self.sent[-1]


def draw_walk_and_joint(
    folder: Path, scenario: Scenario, real: Scenario, walk: Trajectory, returned: np.ndarray, seed: int
) -> Seen:
    """Draw a real walk that no model has seen, and what a grounded simulator makes of its actions.

    Nothing is drawn where there are no joints, or nobody knows where the body was.

    Args:
        folder: Where to write.
        scenario: Its grounding is ready to act.
        real: The real side, on which the policies walk once more if it is simulated.
        walk: A real trajectory.
        returned: Parameters of the policy that is returned, shape (n_parameters,).
        seed: Of all randomness.
    """
    world = scenario.world
    if not isinstance(world, BulletWorld) or missing(walk, world.layout):
        return Seen()
    traces = _draw_joint(folder, Way(world, NoGrounding()), Way(world, scenario.grounding), walk)
    _draw_walk(world.plant.robot, Shot("π0", "on the real side", walk, REAL), scenario.policy, folder)
    held_out = read_footfalls("a held-out walk on the real side", walk)
    walks = [*([held_out] if held_out else []), *show_steps(real, scenario, returned, seed)]
    caption = (
        "A real walk that nothing was learned from; both simulators start in one of its states and play its actions."
    )
    return Seen(traces, walks, caption)


def draw_flight(
    folder: Path, sim: World, scenario: Scenario, real: Scenario, log: Batch, parameters: np.ndarray, seed: int
) -> Seen:
    """Draw a held-out motion in the air, and a walk of the policy that is returned, in the grounded simulator.

    Args:
        folder: Where to write.
        sim: The simulator as it was.
        scenario: In the grounded simulator.
        real: The real side, on which the policies walk once more if it is simulated.
        log: Real motions in the air, of which a part was held out.
        parameters: Of the policy, shape (n_parameters,).
        seed: Of all randomness.
    """
    grounded = centre(scenario.world)
    if not isinstance(sim, BulletWorld) or grounded is None:
        return Seen()
    robot, traces = grounded.plant.robot, {}
    held, steady = (replace(world, floating=False) for world in (sim, grounded))
    shown = _largest_held_out(log, held)
    if not missing(shown, held.layout):
        traces = _draw_joint(folder, Way(held, NoGrounding()), Way(steady, NoGrounding()), shown)
    walk = play_once(scenario, parameters, derive_seed(seed, WALK))
    if not missing(walk, grounded.layout):
        shot = Shot("returned policy", "in the grounded simulator", walk, GROUNDED)
        _draw_walk(robot, shot, scenario.policy, folder)
    caption = "A real motion in the air that nothing was learned from; both simulators play its commands."
    return Seen(traces, show_steps(real, scenario, parameters, seed), caption)


def show_steps(
    real: Scenario, simulated: Scenario, returned: np.ndarray, seed: int, place: str = "in the grounded simulator"
) -> list[Walk]:
    """Return the footfalls of π0 and of the policy that is returned, on the real side if that is simulated, in both."""
    sides = {"on the real side": real} if centre(real.world) else {}
    walks = [
        read_footfalls(f"{name} {where}", play_once(scenario, parameters, derive_seed(seed, WALK)))
        for where, scenario in {**sides, place: simulated}.items()
        for name, parameters in (("π0", simulated.policy.initial), ("the returned policy", returned))
    ]
    return [walk for walk in walks if walk]


def _draw_walk(robot: Robot, shot: Shot, policy: Policy, folder: Path) -> None:
    film(robot, robot.controlled, [shot._replace(about=", ".join(describe_command(policy)))], folder / WALK)


def read_footfalls(label: str, walk: Trajectory) -> Walk | None:
    """Return when each foot bears load, None where that is not known or no foot ever does, as in the air."""
    prefix = "foot_force."
    feet = {
        name.removeprefix(prefix): force > LOADED for name, force in walk.sensors.items() if name.startswith(prefix)
    }
    fell = float(walk.time[-1]) if walk.ended_in_a_fall else None
    return Walk(label, walk.time, feet, fell) if any(map(np.any, feet.values())) else None


def _draw_joint(folder: Path, plain: Way, grounded: Way, real: Trajectory) -> dict[str, Traces]:
    """Draw the joint that moves most, and return the traces of all; arguments as those of `trace_joints`."""
    traces = trace_joints(plain, grounded, real)
    first = next(iter(traces))
    joint_trace(folder / TRACE, traces[first]._replace(sent=None), first)
    return traces


def trace_joints(plain: Way, grounded: Way | None, real: Trajectory) -> dict[str, Traces]:
    """Return the traces of all joints, of the one that moves most first.

    Args:
        plain: The simulator as it was.
        grounded: And grounded, if it was.
        real: A real trajectory, whose actions are replayed from one of its states.
    """
    layout, issued = plain.world.layout, actions(real, carried_out=True)
    tick, ticks = show_window(real, plain.world.period)
    place = Place(observations(real, layout), issued, tick)
    bare, _ = _observe(plain, place, ticks)
    other, sent = _observe(grounded, place, ticks) if grounded else (None, issued[tick : tick + ticks])
    shown = slice(tick + 1, tick + 1 + ticks)
    changed = not np.array_equal(sent, issued[tick : tick + ticks])
    return {
        layout.joints[k]: Traces(
            real.time[shown],
            issued[tick : tick + ticks, k],
            real.position[shown, k],
            bare[:, k],
            None if other is None else other[:, k],
            sent[:, k] if changed else None,
            scale=scale_of(layout.joints[k], plain.world.plant.robot.slides),
        )
        for k in np.argsort(-np.ptp(real.position[shown], axis=0), kind="stable")
    }


def show_window(real: Trajectory, period: float) -> tuple[int, int]:
    """Return the tick from which traces are shown, and for how many."""
    tick = max(PAST, min(round(TAKEN_OVER / period), len(real) // 2))
    return tick, min(round(SHOWN / period), len(real) - tick)


def _observe(way: Way, place: Place, ticks: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the observations of a replay, shape (ticks, layout.size), and what was sent, shape (ticks, n_joints)."""
    env, grounding = way.world.make(), _Listening(way.grounding)
    seen = np.array(list(replay(env, grounding, place, np.random.default_rng(0), ticks)))
    env.close()
    return seen, np.array(grounding.sent[-ticks:])


def centre(world: World | EnsembleWorld | RandomisedWorld) -> BulletWorld | None:
    """Return the simulator that stands for all where there are several, None where there are no joints."""
    inner = world.world if isinstance(world, EnsembleWorld | RandomisedWorld) else world
    return inner if isinstance(inner, BulletWorld) else None


def _largest_held_out(log: Batch, world: BulletWorld) -> Trajectory:
    """Return the largest motion of a log that a diagnosis or a learned servo was not fitted to."""
    split = cut_log(log, lump(world.plant.robot))
    episodes = [log.episodes[split.order[k]] for k in np.unique(split.pieces.record[split.held_out])]
    return max(episodes, key=lambda episode: np.ptp(episode.position, axis=0).max())
