"""What a person looks at after `iterate`: one joint's traces (the paper's figure 6), and a walk frame by frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.interfaces import Grounding, World
from gsl.core.observation import missing, observations
from gsl.core.seeds import derive_seed
from gsl.core.trajectory import Batch, Trajectory
from gsl.core.transitions import actions
from gsl.diagnosis.log.log import cut_log
from gsl.grounding.none import NoGrounding
from gsl.report.film import Shot, film
from gsl.report.joint_trace import Traces, joint_trace
from gsl.report.style import GROUNDED, REAL
from gsl.rollout.rollout import Scenario, rollout
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


def draw_walk_and_joint(folder: Path, scenario: Scenario, walk: Trajectory) -> None:
    """Draw a real walk that no model has seen, and what a grounded simulator makes of its actions.

    Nothing is drawn where there are no joints, or nobody knows where the body was.

    Args:
        folder: Where to write.
        scenario: Its grounding is ready to act.
        walk: A real trajectory.
    """
    world = scenario.world
    if not isinstance(world, BulletWorld) or missing(walk, world.layout):
        return
    draw_joint(folder, Way(world, NoGrounding()), Way(world, scenario.grounding), walk)
    _draw_walk(world.plant.robot, Shot("π0", "on the real side", walk, REAL), folder)


def draw_flight(folder: Path, sim: World, scenario: Scenario, log: Batch, parameters: np.ndarray, seed: int) -> None:
    """Draw a held-out motion in the air, and a walk of the policy that is returned, in the grounded simulator.

    Args:
        folder: Where to write.
        sim: The simulator as it was.
        scenario: In the grounded simulator.
        log: Real motions in the air, of which a part was held out.
        parameters: Of the policy, shape (n_parameters,).
        seed: Of all randomness.
    """
    grounded = _centre(scenario.world)
    if not isinstance(sim, BulletWorld) or grounded is None:
        return
    robot = grounded.plant.robot
    held, steady = (replace(world, floating=False) for world in (sim, grounded))
    shown = _largest_held_out(log, held)
    if not missing(shown, held.layout):
        draw_joint(folder, Way(held, NoGrounding()), Way(steady, NoGrounding()), shown)
    env = scenario.make()
    walk = rollout(scenario, env, parameters, derive_seed(seed, WALK))
    env.close()
    if not missing(walk, grounded.layout):
        _draw_walk(robot, Shot("returned policy", "in the grounded simulator", walk, GROUNDED), folder)


def _draw_walk(robot: Robot, shot: Shot, folder: Path) -> None:
    film(robot, robot.controlled, [shot], folder / WALK)


def draw_joint(folder: Path, plain: Way, grounded: Way, real: Trajectory) -> None:
    """Draw the joint that moves most: a real trajectory, and its actions replayed from one of its states.

    Args:
        folder: Where to write.
        plain: The simulator as it was.
        grounded: And grounded.
        real: A real trajectory that nothing was learned from.
    """
    layout, period = plain.world.layout, plain.world.period
    tick = max(PAST, min(round(TAKEN_OVER / period), len(real) // 2))
    sent = actions(real, carried_out=True)
    place = Place(observations(real, layout), sent, tick)
    ticks = min(round(SHOWN / period), len(real) - tick)
    simulated = [_observe(way, place, ticks) for way in (plain, grounded)]
    shown = slice(tick + 1, tick + 1 + ticks)
    joint = int(np.argmax(np.ptp(real.position[shown], axis=0)))
    command = sent[tick : tick + ticks, joint]
    bare, other = (seen[:, joint] for seen in simulated)
    traces = Traces(real.time[shown], command, real.position[shown, joint], bare, other)
    joint_trace(folder / TRACE, traces, layout.joints[joint])


def _observe(way: Way, place: Place, ticks: int) -> np.ndarray:
    """Return observations of a replay, shape (ticks, layout.size)."""
    env = way.world.make()
    seen = np.array(list(replay(env, way.grounding, place, np.random.default_rng(0), ticks)))
    env.close()
    return seen


def _centre(world: World | EnsembleWorld | RandomisedWorld) -> BulletWorld | None:
    """Return the simulator that stands for all where there are several, None where there are no joints."""
    inner = world.world if isinstance(world, EnsembleWorld | RandomisedWorld) else world
    return inner if isinstance(inner, BulletWorld) else None


def _largest_held_out(log: Batch, world: BulletWorld) -> Trajectory:
    """Return the largest motion of a log that a diagnosis or a learned servo was not fitted to."""
    split = cut_log(log, lump(world.plant.robot))
    episodes = [log.episodes[split.order[k]] for k in np.unique(split.pieces.record[split.held_out])]
    return max(episodes, key=lambda episode: np.ptp(episode.position, axis=0).max())
