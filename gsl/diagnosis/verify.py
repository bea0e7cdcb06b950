"""Verification: the final answer, which the chain model found, replayed in Bullet."""

from __future__ import annotations

from typing import Any

import numpy as np

from gsl.core.body import lumped
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.nuisance import calibrated
from gsl.effects.effect import applied, built
from gsl.worlds.engine import Engine
from gsl.worlds.physics import Physics
from gsl.worlds.servo_state import COMMANDS
from gsl.worlds.start import resting

WINDOWS = 12  # held-out windows that are replayed


def in_bullet(found: Findings, *, iterations: int = 50) -> dict[str, Any]:
    """Return how far Bullet and the chain model differ with the answer [mrad], and Bullet's gap in floors."""
    exp, chosen, sim = found.experiment, found.answer, found.simulator
    index = exp.held_out[np.unique(np.linspace(0, len(exp.held_out) - 1, WINDOWS).round().astype(int))]
    part = exp.pieces.chosen(index)
    plant = calibrated(applied(sim.plant, built(chosen.effects)), chosen.fit.nuisances)
    told = np.empty(part.real.shape)
    for known, group in part.alike:
        engine = Engine(applied(plant, built(known)), Physics(sim.step, iterations, sim.period, floating=False))
        for k in group:
            told[k] = _replayed(engine, *(values[k] for values in part.windows))[:, : len(exp.joints)]
        engine.close()
    told += plant.sensors.bias[: len(exp.joints)]
    chain = sim.told(chosen.effects, chosen.fit.nuisances, part)
    z = exp.comparison.residual(told, part)
    difference = float(np.sqrt(np.mean((told - chain)[:, part.warm_up :] ** 2)))
    return {"windows": len(part), "chain_rms_mrad": 1e3 * difference, "rms": float(np.sqrt(np.mean(z**2)))}


def _replayed(engine: Engine, commands: np.ndarray, motion: np.ndarray, clock: float) -> np.ndarray:
    """Return what the encoders tell in Bullet after each control period [rad], shape (T, n_motors)."""
    length = len(commands) - COMMANDS + 1
    start = resting(lumped(engine.plant.robot), motion[0], commands[length], floating=False).reading
    engine.load(start._replace(motion=motion), commands[length:], float(clock))
    told = []
    for t in range(length):
        engine.run(commands[length - 1 - t])
        told.append(engine.encoders(engine.read())[0])
    return np.array(told)
