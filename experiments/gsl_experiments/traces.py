"""The paper's figures 6 and 7: one joint in real, in the simulator, and in the grounded simulator."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np

from gsl.core.console import Console
from gsl.core.history import windows
from gsl.core.interfaces import REAL, Grounding, World
from gsl.core.observation import observations, read_sensors
from gsl.core.setting import component, setting
from gsl.core.trajectory import Trajectory
from gsl.errors import ConfigError
from gsl.grounding.gat import ActionTransformation, LoadedTransformation, check_coverage
from gsl.grounding.none import NoGrounding
from gsl.models.ensemble import Forward
from gsl.report.joint_trace import Traces, joint_trace
from gsl.report.markdown import table
from gsl.report.run_page import Answer
from gsl.report.study_page import write_study_page
from gsl.rollout.rollout import Scenario, rollout
from gsl.stages.chain_training import train_transformation
from gsl.stages.iterate import Iterate, check_trainable
from gsl.storage.models import read_forward_model, read_inverse_model
from gsl.training.data import degrees
from gsl.validation.model_requirements import extra_ticks
from gsl.validation.replay import PAST, Place, replay
from gsl.worlds.grounded import GroundedEnv
from gsl_experiments.effort import duration_told, seconds_of_models
from gsl_experiments.sizes import PresetName, sizes_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE = "table.md"
TITLES = ("joint", "simulator", "RMS distance from real [°]")


@component
class Figure6:
    """A constant command from the start posture: in the simulator the joint follows at once, in real it is late.

    The grounding shown is that of the first iteration, its data and models built beside it.
    """

    kind: ClassVar[str] = "reproduce"

    iterate: Annotated[Iterate, setting("what the grounding is trained for")]
    joint: Annotated[str, setting("joint that is commanded to move")] = "LShoulderPitch"
    change: Annotated[float, setting("command, from the start posture", unit="rad")] = -math.pi / 12
    duration: Annotated[float, setting("what is shown", unit="s", gt=0)] = 1.0
    preset_name: PresetName = ""

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here."""
        return {}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Train the grounding, play the command in the three worlds, draw."""
        _check(self.iterate, self.joint, self.duration)
        iterate, loaded = self.iterate, train_grounding(self.iterate, folder.parent, console)
        layout = iterate.sim.layout
        index, period = layout.joints.index(self.joint), layout.control_period
        target = iterate.policy.posture(iterate.policy.initial, layout).copy()
        start = target.copy()
        target[index] += self.change
        ticks = round(self.duration / period)
        played = [
            _play(world, grounding, start, target, ticks, index)
            for world, grounding in ((iterate.real, NoGrounding()), (iterate.sim, NoGrounding()), (iterate.sim, loaded))
        ]
        (real, command), (bare, _), (grounded, sent) = played
        time = period * np.arange(1 - PAST, ticks + 1)
        moved = slice(PAST, None)  # before, all of them rest
        simulated = {"ungrounded": bare[moved], "grounded": grounded[moved]}
        traces = Traces(time, command, real, bare, grounded, sent)
        picture = joint_trace(folder / "figure_6.png", traces, self.joint, rest=PAST)
        return _write_errors(folder, self, real[moved], simulated, [picture])


@component
class Figure7:
    """π0 in real, and its actions from one of its states: in the simulator, in the grounded one, and as f predicts."""

    kind: ClassVar[str] = "reproduce"

    iterate: Annotated[Iterate, setting("what the grounding is trained for")]
    joint: Annotated[str, setting("joint that is shown")] = "RAnklePitch"
    begin: Annotated[float, setting("when simulators take over from the real robot", unit="s", gt=0)] = 2.0
    duration: Annotated[float, setting("what is shown", unit="s", gt=0)] = 1.0
    preset_name: PresetName = ""

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here."""
        return {}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Train the grounding, walk in real, replay in simulation, draw."""
        iterate = self.iterate
        if extra_ticks(iterate.sim):
            raise ConfigError("iterate.sim", "acts late: f looks several ticks ahead there and draws no trace")
        _check(iterate, self.joint, self.duration)
        walk = _walk(iterate)
        layout = iterate.sim.layout
        index, period = layout.joints.index(self.joint), layout.control_period
        tick = max(PAST, iterate.forward_model.of_body.span, round(self.begin / period))
        if tick >= len(walk):
            problem = f"π0's real walk is over after {period * len(walk):.1f} s; begin before"
            raise ConfigError("begin", problem, given=f"{self.begin:g}")
        ticks = min(round(self.duration / period), len(walk) - tick)
        loaded = train_grounding(iterate, folder.parent, console)
        place = Place(observations(walk, layout), walk.action, tick)
        env: Any = iterate.sim.make()
        bare, grounded = (
            np.array([seen[index] for seen in replay(env, way, place, np.random.default_rng(0), ticks)])
            for way in (NoGrounding(), loaded)
        )
        env.close()
        joints = loaded.forward.joints
        foreseen = _predict(loaded.forward, walk.only(layout.numbers(joints)), tick, ticks)
        predicted = foreseen[:, joints.index(self.joint)]
        shown = slice(tick + 1, tick + 1 + ticks)
        plain = Traces(walk.time[shown], walk.action[tick : tick + ticks, index], walk.position[shown, index], bare)
        far = [f"{degrees(trace - plain.real):.1f}°" for trace in (predicted, bare)]
        title = f"{self.joint}: as f predicts it {far[0]} from the real robot, in simulation {far[1]} (RMS)"
        first = joint_trace(
            folder / "figure_7a.png", plain._replace(grounded=predicted, name="forward model"), self.joint, title=title
        )
        second = joint_trace(folder / "figure_7b.png", plain._replace(grounded=grounded), self.joint)
        traces = {"ungrounded": bare, "forward model": predicted, "grounded": grounded}
        return _write_errors(folder, self, plain.real, traces, [first, second])


def train_grounding(iterate: Iterate, home: Path, console: Console) -> LoadedTransformation:
    """Return the grounding of an iteration's settings, alpha 1 for `auto`, trained below `home`."""
    assert isinstance(iterate.grounding, ActionTransformation), "_check has refused others"
    console.status(f"{duration_told(seconds_of_models(iterate))} from nothing; what is built is not built again")
    chain = replace(iterate.chain, accept=True)
    ready = train_transformation(chain, home, iterate.grounding, None, iterate.seed, console)
    loaded = ready.load(read_forward_model, read_inverse_model)
    assert isinstance(loaded, LoadedTransformation), "the world is a robot"
    return loaded


def _check(iterate: Iterate, joint: str, duration: float) -> None:
    """Refuse what cannot be drawn."""
    if not isinstance(iterate.grounding, ActionTransformation):
        raise ConfigError("iterate.grounding", "only a transformation of actions can be drawn, such as gat")
    check_trainable(iterate, "iterate.grounding", iterate.grounding)
    joints = iterate.forward_model.joints_of_interest(iterate.sim.layout.joints, "iterate.forward_model")
    check_coverage([joint], joints, "joint")
    if round(duration / iterate.sim.layout.control_period) < 1:
        problem = f"is less than a tick, {iterate.sim.layout.control_period:g} s"
        raise ConfigError("duration", problem, given=f"{duration:g}")


def _play(
    world: World, grounding: Grounding, start: np.ndarray, target: np.ndarray, ticks: int, index: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return a joint's positions and what was sent to it [rad], shape (PAST + ticks,) each; it rests for `PAST`."""
    env, positions, sent = GroundedEnv(world.make(), grounding), [], []
    env.reset(seed=0, options={"posture": start})
    for tick in range(-PAST, ticks):
        seen, _, _, _, info = env.step(start if tick < 0 else target)
        positions.append(seen[index])
        sent.append(info["grounded_action"][index])
    env.close()
    return np.array(positions), np.array(sent)


def _walk(iterate: Iterate) -> Trajectory:
    scenario = Scenario(iterate.real, iterate.task, iterate.policy, REAL, NoGrounding())
    env = scenario.make()
    walk = rollout(scenario, env, iterate.policy.initial, iterate.seed)
    env.close()
    return walk


def _predict(forward: Forward, walk: Trajectory, tick: int, ticks: int) -> np.ndarray:
    """Return where f, fed with its own answers, sees the joints go [rad], shape (ticks, n_joints)."""
    x, body = walk.position.copy(), read_sensors(walk, forward.history.sensors)
    for now in range(tick, tick + ticks):
        x[now + 1] = x[now] + forward.effects(windows(forward.history, x, walk.action, body, np.array([now])))[0]
    return x[tick + 1 : tick + 1 + ticks]


def _write_errors(
    folder: Path,
    figure: Figure6 | Figure7,
    real: np.ndarray,
    traces: Mapping[str, np.ndarray],
    pictures: Sequence[Figure],
) -> Mapping[str, Any]:
    errors = {name: degrees(trace - real) for name, trace in traces.items()}
    rows = [(figure.joint, name, f"{error:.2f}") for name, error in errors.items()]
    own, neighbours = figure.iterate.budget.real
    learned = f"The grounding learned from {own} real episodes of π0 and {neighbours} around it."
    below = f"{sizes_of(figure.preset_name)} {learned}"
    (folder / TABLE).write_text(f"{table(TITLES, rows)}\n{below}\n", encoding="utf-8")
    far = f"{errors['grounded']:.1f}° from the real robot with grounding, {errors['ungrounded']:.1f}° without"
    sentence = f"{figure.joint} is {far} (RMS of one motion, which has no interval)."
    answer = Answer("Does the grounded simulator move as the real robot does?", sentence, sure=False)
    write_study_page(folder, answer, [TABLE], pictures)
    return {"joint": figure.joint, "distance_deg": errors}
