"""Grounded action transformation: each action becomes the one that does in the simulator what it would do in reality.

Hanna, Desai, Karnan, Warnell, Stone: Grounded action transformation for sim-to-real reinforcement learning (2021).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from gsl.core.grounding import grounded
from gsl.core.history import Window
from gsl.core.layout import Layout
from gsl.core.observation import Senses
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.models.forward import ForwardModel
from gsl.models.inverse import InverseModel

REACH = 0.5  # [rad]; a servo told to go farther than this from the agent's target is at its torque limit anyway


@component
class ActionTransformation:
    """The models to use and how far to trust them; `load` reads them."""

    forward_model: Annotated[str, setting("path or run of the forward model of the robot")]
    inverse_model: Annotated[str, setting("path or run of the inverse model of the simulator")]
    alpha: Annotated[
        Annotated[float, setting("", ge=0, le=1)] | Literal["auto"],
        setting("how far to go from the agent's action to the grounded one; auto: as far as pi0 keeps its feet"),
    ] = "auto"
    noise: Annotated[float, setting("action noise on top", unit="rad", ge=0)] = 0.0

    def load(
        self, forward: Callable[[str], ForwardModel], inverse: Callable[[str], InverseModel]
    ) -> LoadedTransformation:
        """Return the grounding with its models, alpha 1 for `auto`.

        Args:
            forward: Reads a forward model.
            inverse: Reads an inverse model.

        Raises:
            ConfigError: The models are of different joints, or look ahead differently far.
        """
        f, f_inv = forward(self.forward_model), inverse(self.inverse_model)
        if f.joints != f_inv.joints:
            different = sorted(set(f.joints) ^ set(f_inv.joints)) or ["their order"]
            raise ConfigError(
                "inverse_model", f"its joints and those of the forward model differ: {', '.join(different)}"
            )
        if f.horizon != f_inv.horizon:
            problem = (
                f"it looks {f_inv.horizon} ticks ahead, the forward model {f.horizon}; train both with one horizon"
            )
            raise ConfigError("inverse_model", problem)
        return LoadedTransformation(f, f_inv, 1.0 if self.alpha == "auto" else self.alpha, self.noise)

    def start(self, layout: Layout, rng: np.random.Generator) -> TransformationRun:
        """Refuse to start without models.

        Raises:
            ConfigError: Always; what `load` returns can be started.
        """
        raise ConfigError("grounding", "its models are not loaded; a stage that uses it has to load them")


@dataclass(frozen=True)
class LoadedTransformation:
    """A grounding ready to act; it can be pickled.

    Attributes:
        forward: f, of the robot.
        inverse: f_inv, of the simulator.
        alpha: In [0, 1].
        noise: Standard deviation of the noise on top [rad].
    """

    forward: ForwardModel
    inverse: InverseModel
    alpha: float = 1.0
    noise: float = 0.0

    def start(self, layout: Layout, rng: np.random.Generator) -> TransformationRun:
        """Return the grounding at the beginning of an episode.

        Raises:
            ConfigError: The world has other joints than the models.
        """
        if layout.joints != self.forward.joints:
            different = sorted(set(layout.joints) ^ set(self.forward.joints)) or ["their order"]
            raise ConfigError("grounding", f"the models and the world differ in joints: {', '.join(different)}")
        return TransformationRun(self, layout, rng)


class TransformationRun:
    """The transformation in one episode.

    The forward model sees the agent's actions, as on the robot; the inverse model those that were carried out.
    """

    def __init__(self, grounding: LoadedTransformation, layout: Layout, rng: np.random.Generator) -> None:
        self._grounding, self._rng = grounding, rng
        self._senses = Senses(layout, grounding.forward.history.sensors)
        n = len(layout.joints)
        self._real, self._sim = Window(grounding.forward.history, n), Window(grounding.inverse.history, n)

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return the grounded action [rad], shape (n_joints,)."""
        grounding, real, sim = self._grounding, self._real, self._sim
        position = self._senses.position(observation)
        real.see(position, self._senses.sensed(observation))
        wanted = grounding.forward.effect(real.complete(action), self._rng)
        sim.see(position, ())
        inverse = grounding.inverse.action(sim.complete(action), action, wanted)
        sent = grounded(action, inverse, grounding.alpha)
        if grounding.noise:
            sent = sent + grounding.noise * self._rng.standard_normal(len(sent))
        # np.clip takes four times as long
        sent = np.asarray(np.minimum(np.maximum(sent, action - REACH), action + REACH))
        real.remember(action)
        sim.remember(sent)
        return sent
