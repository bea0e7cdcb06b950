"""What a model has to be for a grounding in a simulator, whatever else its settings say."""

from __future__ import annotations

import math
from dataclasses import replace

from gsl.grounding.gat import ActionTransformation
from gsl.models.config import FARTHEST, ModelConfig
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.world import World

MEMBERS = 5  # of the ensemble behind a gate, where nothing else is said
SLIGHT = 0.25  # ticks of a delay that leave an action most of its effect
SHRINKING = 1.0  # least ridge of a residual: in directions that the data hardly show it is no correction


def lateness(sim: World) -> int:
    """Return after how many ticks more than one a robot's encoders tell what an action does in a simulator."""
    if not isinstance(sim, BulletWorld):
        return 0
    servo = sim.plant.servo
    return max(0, math.ceil((servo.delay + servo.sensor_delay).max() / sim.layout.control_period - SLIGHT))


def looking_ahead(model: ModelConfig, sim: World) -> ModelConfig:
    """Return a model that looks as far ahead as a late simulator needs, and back over the actions on their way."""
    horizon = max(model.horizon, min(1 + lateness(sim), FARTHEST))
    history = model.history if model.history == "auto" else max(model.history, horizon - 1)
    return model if horizon == model.horizon else replace(model, horizon=horizon, history=history)


def as_needed(model: ModelConfig, grounding: ActionTransformation) -> ModelConfig:
    """Return the settings of a forward model that can do what a grounding asks of it."""
    wanted = model if grounding.predicts == "point" else replace(model, likelihood=grounding.predicts)
    if grounding.residual:
        wanted = replace(wanted, family="linear", encoding="plain", ridge=max(wanted.ridge, SHRINKING))
    return wanted if grounding.gate is None or wanted.members > 1 else replace(wanted, members=MEMBERS)
