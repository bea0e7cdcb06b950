"""How wide torque noise has to be to explain what a simulator leaves of held-out motions, beyond the encoders' noise.

A residual r of a replay, robot less simulator, is taken to be the answer to loads that the simulator lacks: one that is
constant in a window, of standard deviation c, and one that is drawn at every physics step, of standard deviation s. An
error of the model that changes slowly, with the posture say, is such a constant for as long as a step of a walk takes.

    r = c S + s h + noise of the encoders            S, h: answers to a constant torque and to white noise, of size 1

S and h are differences of replays with and without such loads, so that friction, limits and gravity are in them. With
<x, y> the sum of x y over a window's N scored ticks, the part along S holds c and the rest does not:

    E <S, r>² / <S, S>           = c² <S, S> + f² + s² E <S, h>² / <S, S>
    E <r, r> - <S, r>² / <S, S>  = f² (N - 1) + s² (E <h, h> - E <S, h>² / <S, S>)
    roughness²                   = f² + s² (roughness of h)²                              f: noise of the encoders

so that s and f follow from the last two lines and then c from the first one, as sums over windows and joints. What the
roughness explains is no noise of torque: a width that is not significant is 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import scipy

from gsl.core.plant import Plant
from gsl.diagnosis.log.floor import roughness, third_differences
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.log.records import Pieces
from gsl.diagnosis.settings import FloorSettings
from gsl.diagnosis.simulate.in_the_air import change
from gsl.models.servo import ServoModel
from gsl.worlds.fits import fitting_step
from gsl.worlds.held import Held, Windows

DRAWS = 8  # of white noise: with dozens of windows its answer is known to a few percent
PASSES = 2  # the second one measures the answers at the widths of the first: friction answers small loads less
FIRST = (0.3, 0.05)  # shares of a torque limit whose answers are measured first: grounding.torque_noise's usual sizes
MOST = (1.0, 0.3)  # shares up to which answers are measured: under larger loads joints stall and hit their stops
LEFT = 0.1  # share of the roughness' square that is the encoders' at least
CONFIDENCE = 0.95  # that a width is not chance, one-sided
SLACK = float(2.0 * np.sqrt(2.0 / FloorSettings.estimate))  # of a floor that comes from roughness

Replay = Callable[[np.ndarray | None], np.ndarray]
"""Given loads on the motors [N·m], shape (T · substeps, n_motors), or none: positions [rad], shape (W, T, n_joints)."""


class TorqueWidth(NamedTuple):
    """Standard deviations of torque noise [N·m]: drawn at every physics step, and once an episode."""

    step: float
    constant: float


class Moments(NamedTuple):
    """Sums over the ticks of each window and joint, each of shape (W, n_joints).

    Attributes:
        ticks: Number of residuals, N; 0 where a replay diverges.
        along: <S, r>² / <S, S> [rad²].
        rest: <r, r> less that [rad²].
        constant: <S, S>, the answer to a constant torque of 1 N·m [rad²].
        step_along: E <S, h>² / <S, S> [rad²].
        step_rest: E <h, h> less that [rad²].
        step_rough: Square of the roughness of h [rad²].
    """

    ticks: np.ndarray
    along: np.ndarray
    rest: np.ndarray
    constant: np.ndarray
    step_along: np.ndarray
    step_rest: np.ndarray
    step_rough: np.ndarray


def measure_widths(
    log: Log, plant: Plant, model: ServoModel | None = None, *, step: float, seed: int = 0,
    groups: Mapping[str, np.ndarray] | None = None,
) -> Mapping[str, TorqueWidth]:  # fmt: skip
    """Return the widths by group of joints, `all` for a robot without groups, from a log's held-out windows.

    Args:
        log: In the air.
        plant: The simulator that is to be widened, its effects in it.
        model: The learned servo on top of it, if there is one.
        step: Physics period [s], that of the world in which the noise will act: white noise has its size there.
        seed: Of the white noise.
        groups: Which joints share their widths, by name, shape (n_joints,) each; those of the robot by default.
    """
    pieces, physics = log.held_out_pieces, fitting_step(step, log.period)
    replay = replays(plant, model, pieces, physics, log.period)
    floor = np.maximum(roughness(log.records), max(log.robot.encoder_step / np.sqrt(12.0), 1e-5))
    calm = ~log.comparison.shaking  # the phase of the others is not in a log
    if groups is None:
        names = log.robot.groups or {"all": log.joints}
        groups = {name: np.isin(log.joints, members) for name, members in names.items()}
    quiet = {name: mask & calm for name, mask in groups.items()}
    steps = pieces.windows.length * round(log.period / physics)
    widths = torque_widths(replay, pieces, floor, quiet, plant, steps, np.random.default_rng(seed))
    finer = float(np.sqrt(physics / step))  # of white noise that is drawn less often
    return {name: TorqueWidth(finer * each.step, each.constant) for name, each in widths.items()}


def replays(plant: Plant, model: ServoModel | None, pieces: Pieces, step: float, period: float) -> Replay:
    """Return replays of some windows under loads, as the world at this step replays them.

    Args:
        plant: What the servo stands on; what is known of each record is added to it.
        model: The learned servo, if there is one.
        pieces: The windows, in the air.
        step: Physics period [s].
        period: Control period [s].
    """
    assert isinstance(pieces.windows, Windows), "windows in the air"
    plants = [(change(plant, conditions), index) for conditions, index in pieces.alike]
    parts = [(Held.of(model.on(own) if model else own, step, period), index) for own, index in plants]
    windows, joints = pieces.windows, pieces.real.shape[2]

    def replay(load: np.ndarray | None) -> np.ndarray:
        positions = np.empty(pieces.real.shape)
        for held, index in parts:
            positions[index] = held.replay(Windows(*(part[index] for part in windows)), load)[..., :joints]
        return positions

    return replay


def torque_widths(
    replay: Replay,
    pieces: Pieces,
    floor: np.ndarray,
    groups: Mapping[str, np.ndarray],
    plant: Plant,
    steps: int,
    rng: np.random.Generator,
) -> Mapping[str, TorqueWidth]:
    """Return the widths of torque noise that explain residuals, by group.

    Args:
        replay: The simulator; a learned servo's too, if its replays take loads.
        pieces: The windows and what was measured in them.
        floor: The roughness of what was measured [rad], shape (n_joints,).
        groups: Which joints share their widths, by name, each of shape (n_joints,).
        plant: Whose torque limits say what is a small torque.
        steps: Physics steps in a window.
        rng: Draws the white noise.
    """
    still, limit = replay(None), np.where(np.isfinite(plant.servo.limit), plant.servo.limit, 1.0)
    sizes = np.array([share * limit for share in FIRST])
    widths: dict[str, TorqueWidth] = {}
    for _ in range(PASSES):
        sums = moments(replay, still, pieces, sizes, steps, rng)
        widths = {name: width(_of(sums, mask), floor[mask]) for name, mask in groups.items()}
        for name, mask in groups.items():
            motors = mask[plant.robot.drive]
            for row, value in enumerate(widths[name]):
                sizes[row, motors] = np.minimum(value or sizes[row, motors], MOST[row] * limit[motors])
    return widths


def moments(
    replay: Replay, still: np.ndarray, pieces: Pieces, sizes: np.ndarray, steps: int, rng: np.random.Generator
) -> Moments:
    """Return the sums over all windows.

    Args:
        replay: The simulator.
        still: What it says without loads, shape (W, T, n_joints).
        pieces: The windows and what was measured in them.
        sizes: Of the loads whose answers are measured, white and constant [N·m], shape (2, n_motors).
        steps: Physics steps in a window.
        rng: Draws the white noise.
    """
    scored, joints = slice(pieces.warm_up, None), pieces.real.shape[2]

    def answer(load: np.ndarray, size: np.ndarray) -> np.ndarray:
        return np.asarray(((replay(load) - still) / size[:joints])[:, scored])

    residual = (pieces.real - still)[:, scored]
    held = answer(np.tile(sizes[1], (steps, 1)), sizes[1])
    draws = [answer(sizes[0] * rng.standard_normal((steps, sizes.shape[1])), sizes[0]) for _ in range(DRAWS)]
    finite = np.array([np.isfinite(x).all(axis=1) for x in (residual, held, *draws)])
    whole = np.asarray(finite.all(axis=0))  # windows that did not diverge
    residual, held, *draws = (np.where(whole[:, None], x, 0.0) for x in (residual, held, *draws))
    constant = (held**2).sum(axis=1)
    least = np.maximum(constant, np.finfo(float).tiny)
    along = (held * residual).sum(axis=1) ** 2 / least
    step_along = np.mean([(held * h).sum(axis=1) ** 2 for h in draws], axis=0) / least
    step = np.mean([(h**2).sum(axis=1) for h in draws], axis=0)
    rough = np.mean([third_differences(h).mean(axis=1) for h in draws], axis=0)
    rest = (residual**2).sum(axis=1) - along
    return Moments(residual.shape[1] * whole, along, rest, constant, step_along, step - step_along, rough)


def width(sums: Moments, floor: np.ndarray) -> TorqueWidth:
    """Return the widths that some joints share, 0 where the residual is no larger than its floor.

    Args:
        sums: Of these joints.
        floor: The roughness of what was measured of them [rad], shape (n_joints,).
    """
    some = (sums.ticks > 1) & (sums.constant > 0.0)
    if not some.any():
        return TorqueWidth(0.0, 0.0)
    square = np.broadcast_to(floor**2, some.shape)
    free = np.where(some, sums.ticks - 1, 0)
    over = float((sums.rest / square)[some].sum() / free.sum())
    step = 0.0
    if over > (1.0 + SLACK) * scipy.stats.chi2.ppf(CONFIDENCE, free.sum()) / free.sum():
        part = (sums.step_rest - sums.step_rough * free)[some].sum()
        step = max(0.0, float((sums.rest - square * free)[some].sum() / part))
    noise = np.maximum(square - step * sums.step_rough, LEFT * square) + step * sums.step_along
    constant, count = 0.0, int(some.sum())
    if float((sums.along / noise)[some].sum()) > (1.0 + SLACK) * scipy.stats.chi2.ppf(CONFIDENCE, count):
        constant = max(0.0, float((sums.along - noise)[some].sum() / sums.constant[some].sum()))
    return TorqueWidth(float(np.sqrt(step)), float(np.sqrt(constant)))


def _of(sums: Moments, mask: np.ndarray) -> Moments:
    return Moments(*(part[:, mask] for part in sums))
