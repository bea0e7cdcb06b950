"""Action noise envelope (Jakobi 1995): noise on every action, so that nothing is learned that needs exactness."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gsl.core.action_noise import ActionNoiseRun
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding


@component
class ActionNoise:
    """Adds independent Gaussian noise to every joint's action in every tick."""

    sd: Annotated[float, setting("standard deviation of the noise", unit="rad", ge=0, lower=0.005, upper=0.04)] = 0.02

    def without_margins(self) -> NoGrounding:
        """Return no grounding: noise is all that it is."""
        return NoGrounding()

    def start(self, layout: Layout, rng: np.random.Generator) -> ActionNoiseRun:
        """Return the grounding at the beginning of an episode.

        Raises:
            ConfigError: Actions are choices.
        """
        if layout.choices:
            raise ConfigError("grounding", "its noise is for actions that are numbers; random_choice is for choices")
        return ActionNoiseRun(self.sd, rng)
