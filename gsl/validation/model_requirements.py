"""What a model has to be for a grounding in a simulator, whatever else its settings say."""

from __future__ import annotations

import math
from dataclasses import replace

from gsl.core.interfaces import World
from gsl.core.servo import Servo
from gsl.errors import ConfigError
from gsl.grounding.gat import ActionTransformation
from gsl.models.config import FARTHEST, ModelConfig
from gsl.worlds.bullet import BulletWorld

MEMBERS = 5  # of the ensemble behind a gate, where nothing else is said
SLIGHT = 0.25  # ticks of a delay that leave an action most of its effect
SHRINKING = 1.0  # least ridge of a residual: in directions that the data hardly show it is no correction


def extra_ticks(sim: World) -> int:
    """Return how many ticks more than one a model has to look ahead in a simulator that acts, or tells, late."""
    return extra_ticks_of(sim.plant.servo, sim.layout.control_period) if isinstance(sim, BulletWorld) else 0


def extra_ticks_of(servo: Servo, period: float) -> int:
    """Return the same of servos that are controlled once in a period [s]: what shows for a tick alone is too little."""
    ticks = float((servo.delay + servo.sensor_delay).max()) / period
    return 0 if ticks <= SLIGHT else 1 + math.floor(ticks + SLIGHT)


def looking_ahead(model: ModelConfig, extra: int) -> ModelConfig:
    """Return a model that looks some ticks more than one ahead, and back over the actions that are on their way.

    It is fitted to no answers of its own: these are a tick apart.
    """
    horizon = max(model.horizon, min(1 + extra, FARTHEST))
    history = model.history if model.history == "auto" else max(model.history, horizon - 1)
    return model if horizon == model.horizon else replace(model, horizon=horizon, history=history, multi_step=1)


def as_needed(model: ModelConfig, grounding: ActionTransformation) -> ModelConfig:
    """Return the settings of a forward model that can do what a grounding asks of it.

    Raises:
        ConfigError: No model can.
    """
    wanted = model if grounding.predicts == "point" else replace(model, likelihood=grounding.predicts)
    if grounding.multi_step > 1:
        wanted = replace(wanted, family="mlp", multi_step=grounding.multi_step)
    if grounding.residual:
        if model.multi_step > 1:
            raise ConfigError("multi_step", "is of a model that corrects none", given=str(model.multi_step))
        wanted = replace(wanted, family="linear", encoding="plain", ridge=max(wanted.ridge, SHRINKING))
    return wanted if grounding.gate is None or wanted.members > 1 else replace(wanted, members=MEMBERS)
