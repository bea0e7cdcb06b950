"""Models of a world whose state is a vector, observed whole: no history is needed, and one tick tells (section 8.2).

f(s, a) is the change of the state variables of interest; f_inv(s, d) the action that brings about a change d. Where an
action is a choice, f_inv asks a forward model of the simulator about each of them and takes the nearest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gsl.core.draws import Draws
from gsl.models.head import Head
from gsl.models.network import Network


@dataclass(frozen=True)
class StateForward:
    """f: a network from state and action to what the variables of interest change by.

    Attributes:
        network: (s, a) to raw outputs; a choice is a row of zeros with a one.
        head: How they are read.
        states: Number of entries of the state.
        actions: Number of entries of an action, or of choices.
        choices: Number of choices, 0 where actions are numbers.
        variables: Indices of the variables of interest, in order.
        scale: Size of usual changes, shape (n_variables,).
        mixing: What makes the variables' draws err together, shape (n_variables, n_variables), None if they do not.
    """

    kind: ClassVar[str] = "forward_model"
    space: ClassVar[str] = "states"

    network: Network
    head: Head
    states: int
    actions: int
    choices: int
    variables: tuple[int, ...]
    scale: np.ndarray
    mixing: np.ndarray | None = None

    def change(self, state: np.ndarray, action: np.ndarray, draws: Draws | None = None) -> np.ndarray:
        """Return the expected change of the variables, shape (n_variables,); with `draws`, one that may happen."""
        raw = self.network.predict(np.concatenate([state, self.encode(action[None])[0]]))
        return self.head.expect(raw) if draws is None else self.head.draw(raw, draws, self.mixing)

    def changes(self, states: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Return the expected changes, shape (N, n_variables), for many states and actions."""
        return self.head.expect(self.network.predict_many(np.hstack([states, self.encode(actions)])))

    def encode(self, actions: np.ndarray) -> np.ndarray:
        """Return actions as the network sees them, (N, n_entries) -> (N, actions)."""
        return encode(actions, self.choices)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint stores."""
        together = {} if self.mixing is None else {"mixing": self.mixing}
        return {**self.network.arrays(), "scale": self.scale, **together}

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says of the arrays."""
        sizes = {"states": self.states, "actions": self.actions, "choices": self.choices}
        about = {"kind": self.kind, "space": self.space, "variables": list(self.variables)}
        return {**about, **sizes, **vars(self.head)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> StateForward:
        """Return the model that a checkpoint holds."""
        sizes = about["states"], about["actions"], about["choices"], tuple(about["variables"])
        head = Head(about["likelihood"], about["components"])
        return cls(Network.from_arrays(arrays), head, *sizes, arrays["scale"], arrays.get("mixing"))


@dataclass(frozen=True)
class StateInverse:
    """f_inv of numbers: a network from state and wanted change to the action.

    Attributes:
        network: (s, d) to a.
        states: Number of entries of the state.
        actions: Number of entries of an action.
        variables: Indices of the variables of interest, in order.
    """

    space: ClassVar[str] = "states"
    method: ClassVar[str] = "regression"

    network: Network
    states: int
    actions: int
    variables: tuple[int, ...]

    def action(self, state: np.ndarray, action: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the action, shape (n_actions,).

        Args:
            state: Shape (n_states,).
            action: The agent's; it does not matter here.
            wanted: Change of the variables of interest, shape (n_variables,).
        """
        return self.network.predict(np.concatenate([state, wanted])).astype(float)

    def actions_for(self, states: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the actions for many states and wanted changes, shape (N, n_actions)."""
        return self.network.predict_many(np.hstack([states, wanted]))

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint stores."""
        return self.network.arrays()

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says of the arrays."""
        about = {"kind": "inverse_model", "space": self.space, "method": self.method}
        return {**about, "states": self.states, "actions": self.actions, "variables": list(self.variables)}


@dataclass(frozen=True)
class NearestChoice:
    """f_inv of choices: the one whose change in the simulator is nearest to the wanted one, in units of usual changes.

    Attributes:
        simulator: f_sim.
    """

    space: ClassVar[str] = "states"
    method: ClassVar[str] = "nearest"

    simulator: StateForward

    @property
    def states(self) -> int:
        """Number of entries of the state."""
        return self.simulator.states

    @property
    def variables(self) -> tuple[int, ...]:
        """Indices of the variables of interest."""
        return self.simulator.variables

    def action(self, state: np.ndarray, action: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the number of the choice, shape (1,); arguments as those of `StateInverse`."""
        return self.actions_for(state[None], wanted[None])[0]

    def actions_for(self, states: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the choices for many states and wanted changes, shape (N, 1)."""
        f = self.simulator
        each = [f.changes(states, np.full((len(states), 1), float(choice))) for choice in range(f.choices)]
        off = np.array([np.square((change - wanted) / f.scale).sum(axis=1) for change in each])
        return off.argmin(axis=0).astype(float)[:, None]

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint stores."""
        return self.simulator.arrays()

    def description(self) -> dict[str, Any]:
        """Return what a checkpoint says of the arrays."""
        return {**self.simulator.description(), "kind": "inverse_model", "method": self.method}


def encode(actions: np.ndarray, choices: int) -> np.ndarray:
    """Return actions as a network sees them: numbers as they are, choices as rows of an identity matrix."""
    return np.eye(choices)[actions[:, 0].astype(int)] if choices else actions


def state_inverse_from(arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> StateInverse | NearestChoice:
    """Return the inverse model that a checkpoint holds."""
    if about["method"] == NearestChoice.method:
        return NearestChoice(StateForward.from_arrays(arrays, about))
    return StateInverse(Network.from_arrays(arrays), about["states"], about["actions"], tuple(about["variables"]))
