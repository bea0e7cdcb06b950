"""Simulated logs of an arm of two joints whose causes are known, and their diagnosis; it takes seconds."""

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from gsl.core.body import Joint, Link, Robot
from gsl.core.plant import nominal
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.diagnose import diagnose
from gsl.diagnosis.options import Options
from gsl.diagnosis.simulate import calibration
from gsl.diagnosis.verdict.findings import Findings
from gsl.effects.effect import apply_all, build, names
from gsl.worlds.held import Held, Windows
from gsl.worlds.servo_state import COMMANDS

PERIOD, NOISE = 0.02, 0.0015
QUICK = Options(duels=0, nulls=0, most=1, threads=1)
KEPT = {"command_latency", "coulomb_friction", "viscous_friction", "servo_gain", "load_friction", "target_smoothing"}
FEW = replace(QUICK, without=tuple(sorted({*names()} - KEPT)))  # where it does not matter what else there might be


@cache
def arm() -> Robot:
    """Two links that hang from a fixed base, with axes at right angles."""
    inertia = np.diag([4e-4, 4e-4, 1e-4])
    links = [Link(name, 0.4, np.array([0.0, 0.0, -0.06]), inertia) for name in ("base", "upper", "lower")]
    axes = {"shoulder": np.array([0.0, 1.0, 0.0]), "elbow": np.array([1.0, 0.0, 0.0])}
    joints = tuple(
        Joint(name, parent, child, np.array([0.0, 0.0, drop]), axes[name], -1.5, 1.5, 6.0, 3.0, 0.005)
        for name, parent, child, drop in (("shoulder", "base", "upper", 0.0), ("elbow", "upper", "lower", -0.12))
    )
    named = {link.name: link for link in links}
    gains = dict.fromkeys(axes, (40.0, 1.0))
    return Robot("arm", named, joints, tuple(axes), gains=gains, encoder_step=NOISE)


def motions() -> dict[str, np.ndarray]:
    """Steps, triangles, a chirp and poses, two variants of each, shape (T, 2)."""
    time, paths = PERIOD * np.arange(150), {}
    for variant, (size, phase) in {"a": (1.0, 0.0), "b": (0.8, 1.0)}.items():
        wave = [np.sin(2 * np.pi * 0.6 * time + phase + k) for k in range(2)]
        stairs = [np.repeat(np.random.default_rng([k, ord(variant)]).uniform(-1, 1, 6), 25) for k in range(2)]
        chirp = [np.sin(2 * np.pi * (0.5 + 0.7 * time) * time + phase + k) for k in range(2)]
        poses = [np.repeat([0.3, -0.9, 0.9], 50) * (-1) ** k for k in range(2)]
        shapes = {"steps": 0.4, "triangle": 0.7, "chirp": 0.3, "poses": 0.8}
        for (name, share), columns in zip(shapes.items(), (stairs, wave, chirp, poses), strict=True):
            paths[f"{name}_{variant}"] = share * size * np.array(columns).T * np.minimum(1.0, time / 0.3)[:, None]
    return paths


def log(effects: Mapping[str, Any], seed: int = 1, *, jitter: float = 1.0, noise: float = NOISE) -> Batch:
    """What the arm with effects and small deviations of its own would log; one motion is played twice."""
    rng, robot = np.random.default_rng(seed), arm()
    drawn = calibration.SPREADS[:, None] * rng.standard_normal((len(calibration.SPREADS), 2)) * 0.7 * jitter
    drawn[calibration.COULOMB] = np.abs(drawn[calibration.COULOMB])
    held = Held.of(calibration.calibrate(apply_all(nominal(robot), build(effects)), drawn), 0.002, PERIOD)
    played = motions()
    order = [*played, "steps_a"]
    return Batch(
        tuple(logged(held, played[name], noise, rng) for name in order),
        robot.controlled,
        PERIOD,
        {"episodes": [{"policy": name} for name in order], "world": {"step": 0.002}},
    )


def logged(held: Held, targets: np.ndarray, noise: float, rng: np.random.Generator) -> Trajectory:
    before = 25
    padded = np.vstack([np.repeat(targets[:1], COMMANDS - 1 + before, axis=0), targets])
    motion = np.array([[targets[0] + 0.02 * rng.standard_normal(2), np.zeros(2)]])
    windows = Windows(np.ascontiguousarray(padded[::-1])[None], motion, np.array([-before * PERIOD]))
    position = held.replay(windows)[0, before - 1 :]
    position = position + noise * rng.standard_normal(position.shape)
    return Trajectory(PERIOD * np.arange(len(position)), targets, position, np.zeros_like(position))


def found(effects: Mapping[str, Any], *, seed: int = 1, **options: Any) -> Findings:
    """What a diagnosis finds; the same question is asked once."""
    return _found(json.dumps(effects, sort_keys=True), seed, tuple(sorted(options.items())))


@cache
def _found(effects: str, seed: int, options: tuple[tuple[str, Any], ...]) -> Findings:
    made, how = log(json.loads(effects), seed), replace(QUICK, **dict(options))
    return diagnose(made, nominal(arm()), 0.002, how, lambda phase: None)
