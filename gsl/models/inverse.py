"""Inverse models of the simulator: which action brings about a wanted change of the joint positions, f_inv(s, d).

`Regression` is the paper's: an action fitted to state and change. `Solver` asks a forward model of the simulator what
the agent's own action would do and corrects it by the difference: the identity where sim = real, whatever the fit.

With torque servos an action moves a joint little and late. Measured on a robot with weak, late servos with friction,
off pi0 and 0.2 s ahead, the joints are 1.9 degrees off without grounding, 0.4 with a linear regression and 0.6 with a
linear solver (damping 0.2; 0.8 with 0.05). A horizon of two ticks and one or three past ticks are as good; three ticks
ahead, an MLP as forward or as inverse model are a little worse.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from gsl.core.angles import Encoding, decode
from gsl.core.grounding import gain, solve_action
from gsl.core.history import History
from gsl.models.forward import ForwardModel, check_sizes, history_from
from gsl.models.network import Network

KIND = "inverse_model"


@dataclass(frozen=True)
class Regression:
    """A network from state and wanted change to the action, relative to where the joints are.

    Attributes:
        network: Window, with the wanted change in place of a_t - x_t, to the encoded a_t - x_t.
        history: What its windows hold; its past actions are those that were carried out.
        joints: Names of the joints, in order.
        encoding: Of its outputs.
        horizon: Ticks ahead of the wanted change.
    """

    method: ClassVar[str] = "regression"

    network: Network
    history: History
    joints: tuple[str, ...]
    encoding: Encoding = "plain"
    horizon: int = 1

    def __post_init__(self) -> None:
        """Hold network and windows together."""
        check_sizes(self.network, self.history, self.joints, self.encoding)

    def action(self, window: np.ndarray, action: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the action [rad], shape (n_joints,).

        Args:
            window: Of the simulator, with the agent's action in it; its first entries are overwritten.
            action: The agent's [rad], shape (n_joints,).
            wanted: Change of the joint positions [rad], shape (n_joints,).
        """
        n = len(wanted)
        window[:n] = wanted
        targets: np.ndarray = window[n : 2 * n] + decode(self.network.predict(window), self.encoding)
        return targets

    def actions(self, windows: np.ndarray, actions: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the actions [rad], shape (N, n_joints), for many windows."""
        n = wanted.shape[1]
        inputs = np.concatenate([wanted, windows[:, n:]], axis=1)
        targets: np.ndarray = windows[:, n : 2 * n] + decode(self.network.predict_many(inputs), self.encoding)
        return targets

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint stores."""
        return self.network.arrays()

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says of the arrays."""
        about = {"kind": KIND, "method": self.method, "joints": list(self.joints), "horizon": self.horizon}
        return {**about, "history": vars(self.history), "encoding": self.encoding}


@dataclass(frozen=True)
class Solver:
    """a + K (wanted - f_sim(s, a)), see `gsl.core.grounding`.

    Attributes:
        simulator: f_sim; the past actions of its windows are those that were carried out.
        sensitivity: B, how its effect depends on the action, shape (n_joints, n_joints).
        damping: Of K, in units of the mean squared sensitivity.
    """

    method: ClassVar[str] = "solve"

    simulator: ForwardModel
    sensitivity: np.ndarray
    damping: float
    correction: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Compute K once."""
        object.__setattr__(self, "correction", gain(self.sensitivity, self.damping))

    @property
    def history(self) -> History:
        """What its windows hold."""
        return self.simulator.history

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in order."""
        return self.simulator.joints

    @property
    def horizon(self) -> int:
        """Ticks ahead of the wanted change."""
        return self.simulator.horizon

    def action(self, window: np.ndarray, action: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the action [rad], shape (n_joints,); arguments as those of `Regression`."""
        return solve_action(action, self.correction, wanted, self.simulator.effect(window))

    def actions(self, windows: np.ndarray, actions: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the actions [rad], shape (N, n_joints), for many windows."""
        targets: np.ndarray = actions + (wanted - self.simulator.effects(windows)) @ self.correction.T
        return targets

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint stores."""
        return {**self.simulator.arrays(), "sensitivity": self.sensitivity}

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says of the arrays."""
        return {**self.simulator.description(), "kind": KIND, "method": self.method, "damping": self.damping}


InverseModel = Regression | Solver


def inverse_from(arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> InverseModel:
    """Return the inverse model that a checkpoint holds."""
    if about["method"] == Solver.method:
        return Solver(ForwardModel.from_arrays(arrays, about), arrays["sensitivity"], about["damping"])
    history, joints = history_from(about["history"]), tuple(about["joints"])
    return Regression(Network.from_arrays(arrays), history, joints, about["encoding"], about["horizon"])
