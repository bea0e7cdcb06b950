"""Grounded action transformation: each action becomes the one that does in the simulator what it would do in reality.

Stochastic (SGAT) where the forward model's answer is drawn from a distribution: what a robot may do, not what it does
on average. Where an ensemble of forward models disagrees, a gate leaves the action alone.

Hanna, Desai, Karnan, Warnell, Stone: Grounded action transformation for sim-to-real reinforcement learning (2021).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from gsl.core.draws import Draws
from gsl.core.grounding import ground
from gsl.core.history import Window
from gsl.core.interfaces import Prepared, World
from gsl.core.layout import Layout
from gsl.core.observation import Senses
from gsl.core.setting import component, setting
from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError
from gsl.grounding.states import StateTransformation, TableTransformation
from gsl.models.config import FARTHEST
from gsl.models.counts import Counts
from gsl.models.ensemble import Ensemble, Forward
from gsl.models.head import Likelihood
from gsl.models.inverse import InverseModel, Solver
from gsl.models.states import StateForward
from gsl.storage.models import read_forward_model, read_inverse_model
from gsl.storage.references import resolve

REACH = 0.5  # [rad]; a servo told to go farther than this from the agent's target is at its torque limit anyway


def check_coverage(joints: Sequence[str], modelled: Sequence[str], where: str) -> None:
    """Refuse joints that models do not know; `where` is the setting that names them."""
    for joint in joints:
        if joint not in modelled:
            raise ConfigError(
                where, f"the models know no joint of this name{did_you_mean(joint, modelled)}", given=joint
            )


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
    predicts: Annotated[
        Likelihood, setting("a point, what f expects (GAT); a distribution, drawn from in every tick (SGAT)")
    ] = "point"
    residual: Annotated[
        bool,
        setting("f learns how the robot differs from the simulator, and says as the simulator where data say little"),
    ] = False
    multi_step: Annotated[
        int,
        setting("ticks over which f, then an MLP, is fitted to its own answers as well; 1 for none", ge=1, le=FARTHEST),
    ] = 1
    x: Annotated[
        tuple[str, ...] | Literal["all", "auto"],
        setting("joints that are grounded; auto: the fewest that do as well on validation trajectories"),
    ] = "all"
    gate: Annotated[
        float | None,
        setting(
            "disagreement of an ensemble, 1 where it knows, from which on it is trusted less; none for always", gt=0
        ),
    ] = None

    def __post_init__(self) -> None:
        """Refuse what no fit can be: a residual is linear, and steps are of a network that predicts a point."""
        if self.residual and self.predicts == "mixture":
            raise ConfigError("residual", "is linear and has no mixture; say predicts=gaussian", given="true")
        if self.multi_step > 1 and (self.residual or self.predicts != "point"):
            raise ConfigError("multi_step", "is of a network that predicts a point", given=str(self.multi_step))

    def load(self, forward: Callable[[str], Any], inverse: Callable[[str], Any]) -> AnyLoaded:
        """Return the grounding with its models, alpha 1 for `auto`.

        Args:
            forward: Reads a forward model.
            inverse: Reads an inverse model.

        Raises:
            ConfigError: The models are of different joints, look ahead differently far, or cannot do what is asked.
        """
        f, f_inv = forward(self.forward_model), inverse(self.inverse_model)
        if getattr(f, "space", "joints") != getattr(f_inv, "space", "joints"):
            raise ConfigError("inverse_model", "is of another kind of world than the forward model")
        if self.x != "all" and not isinstance(f, Forward):
            raise ConfigError("x", "names joints of a robot; an environment's variables are those of its models")
        if isinstance(f, Counts):
            if self.noise or self.gate is not None or self.alpha not in (1.0, "auto"):
                raise ConfigError("grounding", "alpha, noise and gate are for actions that are numbers, not choices")
            return TableTransformation(f, f_inv, draws=self.predicts != "point")
        if self.residual and (isinstance(f, StateForward) or f.base is None):
            raise ConfigError("forward_model", "corrects no simulator; train it with residual_to=<the inverse model>")
        if self.residual and not (isinstance(f_inv, Solver) and f.base.network.same(f_inv.simulator.network)):
            raise ConfigError("inverse_model", "is not the one that the forward model corrects; train both together")
        if self.predicts not in ("point", f.head.likelihood):
            problem = f"predicts a {f.head.likelihood}; train it with model.likelihood={self.predicts}"
            raise ConfigError("forward_model", problem)
        if self.multi_step > 1 and not isinstance(f, Forward):
            raise ConfigError("multi_step", "is for robots", given=str(self.multi_step))
        if self.multi_step > 1 and f.horizon == 1 and f.multi_step != self.multi_step:
            problem = f"was not fitted to its own answers of {self.multi_step} ticks"
            raise ConfigError("forward_model", f"{problem}; train it with model=mlp model.multi_step={self.multi_step}")
        if self.gate is not None and not isinstance(f, Ensemble):
            raise ConfigError("gate", "needs an ensemble; train the forward model with model.members=5, say")
        alpha = 1.0 if self.alpha == "auto" else self.alpha
        if isinstance(f, StateForward):
            return StateTransformation(f, f_inv, alpha, self.noise, self.predicts != "point")
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
        x = f.joints if isinstance(self.x, str) else self.x
        check_coverage(x, f.joints, "x")
        return LoadedTransformation(f, f_inv, alpha, self.noise, x, self.predicts != "point", self.gate)

    def parents(self, path: str) -> Mapping[str, Path]:
        """Return both models."""
        return {
            f"{path}.forward_model": resolve(self.forward_model, kind="train_forward"),
            f"{path}.inverse_model": resolve(self.inverse_model, kind="train_inverse"),
        }

    def check(self, world: World) -> None:
        """Take any world: what its models need is checked where they are trained."""

    def prepare(self, world: World, settled: Mapping[str, Any]) -> Prepared:
        """Return the same world and the transformation with its models, with what a search settled of alpha and x."""
        chosen = replace(self, alpha=settled["alpha"], x=tuple(settled["x"])) if "x" in settled else self
        return Prepared(world, chosen.load(read_forward_model, read_inverse_model))

    def without_margins(self) -> ActionTransformation:
        """Return the same without noise on top."""
        return replace(self, noise=0.0)

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
        x: Names of the joints that are grounded, None for all that the models know; others get the agent's actions.
        draws: Whether f's answer is drawn and not expected.
        gate: Doubt of f from which on it is trusted less, None for never.
    """

    forward: Forward
    inverse: InverseModel
    alpha: float = 1.0
    noise: float = 0.0
    x: tuple[str, ...] | None = None
    draws: bool = False
    gate: float | None = None

    @property
    def span(self) -> int:
        """Ticks before the present one at which its models look."""
        return max(self.forward.history.span, self.inverse.history.span)

    @property
    def deterministic(self) -> LoadedTransformation:
        """The same without noise on top and without draws, whose width would count as error where replays judge it."""
        return replace(self, noise=0.0, draws=False)

    def start(self, layout: Layout, rng: np.random.Generator) -> TransformationRun:
        """Return the grounding at the beginning of an episode.

        Raises:
            ConfigError: The models know joints that the world lacks.
        """
        if lacking := [joint for joint in self.forward.joints if joint not in layout.joints]:
            raise ConfigError("grounding", f"its models know joints that the world lacks: {', '.join(lacking)}")
        return TransformationRun(self, layout, rng)


AnyLoaded = LoadedTransformation | StateTransformation | TableTransformation


class TransformationRun:
    """The transformation in one episode.

    The forward model sees the agent's actions, as on the robot; the inverse model those that were carried out.
    """

    def __init__(self, grounding: LoadedTransformation, layout: Layout, rng: np.random.Generator) -> None:
        self._grounding, self._rng = grounding, rng
        self._draws = Draws(rng, grounding.forward.memory) if grounding.draws else None
        self._senses = Senses(layout, grounding.forward.history.sensors)
        joints = grounding.forward.joints
        n, x = len(joints), joints if grounding.x is None else grounding.x
        self._whole = joints == layout.joints
        self._known = slice(None) if self._whole else layout.numbers(joints)
        self._alpha = grounding.alpha * np.array([joint in x for joint in joints])
        self._real, self._sim = Window(grounding.forward.history, n), Window(grounding.inverse.history, n)

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return the grounded action [rad], shape (n_joints,)."""
        grounding, real, sim = self._grounding, self._real, self._sim
        position, every, action = self._senses.position(observation)[self._known], action, action[self._known]
        real.see(position, self._senses.read(observation))
        window = real.complete(action)
        wanted, trust = self._predict(window)
        sim.see(position, ())
        inverse = grounding.inverse.action(sim.complete(action), action, wanted)
        sent = ground(action, inverse, self._alpha * trust)
        noise = grounding.noise * self._rng.standard_normal(len(every)) if grounding.noise else None
        if noise is not None:
            sent = sent + noise[self._known]
        # np.clip takes four times as long
        sent = np.asarray(np.minimum(np.maximum(sent, action - REACH), action + REACH))
        real.remember(action)
        sim.remember(sent)
        if self._whole:
            return sent
        every = every.copy() if noise is None else every + noise
        every[self._known] = sent
        return every

    def _predict(self, window: np.ndarray) -> tuple[np.ndarray, float | np.ndarray]:
        """What f says, and how far to believe it: from 1 up to the gate to 0 at twice that, joint by joint."""
        gate, forward = self._grounding.gate, self._grounding.forward
        if gate is None or not isinstance(forward, Ensemble):
            return forward.effect(window, self._draws), 1.0
        wanted, doubt = forward.judge(window, self._draws)
        return wanted, np.clip(2.0 - doubt / gate, 0.0, 1.0)
