"""The same commands to a robot held in the air, in the chain model and in Bullet."""

from __future__ import annotations

import numpy as np

from gsl.core.body import lump
from gsl.core.plant import Plant
from gsl.worlds.engine import Engine
from gsl.worlds.held import Windows
from gsl.worlds.physics import Physics
from gsl.worlds.servo_state import COMMANDS
from gsl.worlds.start import resting

PERIOD = 0.02  # [s]


def window(targets: np.ndarray) -> Windows:
    """Return a window that begins at rest at the first of the targets [rad], shape (T, n_motors)."""
    padded = np.vstack([np.repeat(targets[:1], COMMANDS - 1, axis=0), targets])
    start = np.array([[targets[0], np.zeros(targets.shape[1])]])
    return Windows(np.ascontiguousarray(padded[::-1])[None], start, np.zeros(1))


def in_bullet(plant: Plant, targets: np.ndarray, step: float) -> np.ndarray:
    """Return what the encoders tell after each control period in Bullet [rad], shape (T, n_motors)."""
    engine = Engine(plant, Physics(step, 50, PERIOD, floating=False))
    start = resting(lump(plant.robot), targets[0], targets[0], floating=False)
    engine.load(start.reading, start.commands)
    seen = []
    for target in targets:
        engine.run(target)
        seen.append(engine.encoders(engine.read())[0])
    engine.close()
    return np.array(seen)
