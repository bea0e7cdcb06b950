"""What a forward model has to be for a grounding, in a simulator that may be late."""

from __future__ import annotations

import pytest

from gsl.grounding.gat import ActionTransformation
from gsl.models.config import ModelConfig
from gsl.validation.model_requirements import as_needed, extra_ticks, looking_ahead
from gsl.worlds.bullet import BulletWorld


def test_a_grounding_is_trained_the_forward_model_that_it_needs() -> None:
    point, wanted = ModelConfig(), ActionTransformation("f", "i", predicts="mixture", gate=1.0)
    assert (as_needed(point, wanted).likelihood, as_needed(point, wanted).members) == ("mixture", 5)
    residual = as_needed(point, ActionTransformation("f", "i", residual=True))
    assert (residual.family, residual.ridge) == ("linear", 1.0)
    own = ModelConfig(likelihood="gaussian", members=3)
    assert as_needed(own, ActionTransformation("f", "i", gate=1.0)) == own


@pytest.mark.parametrize(
    ("effects", "horizon", "history"),
    [
        ({}, 1, 3),
        ({"command_latency": {"delay": 0.005}}, 1, 3),
        ({"command_latency": {"delay": 0.03}}, 3, 3),
        ({"command_latency": {"delay": 0.02}, "sensor_delay": {"delay": 0.02}}, 4, 3),
        ({"command_latency": {"delay": 0.1}}, 7, 6),
        ({"command_latency": {"delay": 0.3}}, 10, 9),
    ],
)
def test_models_look_over_the_delay_of_a_late_simulator(effects: dict, horizon: int, history: int) -> None:
    extra = extra_ticks(BulletWorld("nao", effects))
    config = looking_ahead(ModelConfig(), extra)
    assert (config.horizon, config.history) == (horizon, history)
    assert looking_ahead(ModelConfig(history="auto"), extra).history == "auto"
    assert looking_ahead(ModelConfig(horizon=10), extra) == ModelConfig(horizon=10)
