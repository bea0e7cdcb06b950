"""Train the inverse model: learn from trajectories of the simulator which action makes a motion."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from gsl.core.angles import encode
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch
from gsl.core.transitions import Transitions, transitions
from gsl.errors import ConfigError
from gsl.models.choice import Choice, best, fit_network
from gsl.models.config import ModelConfig
from gsl.models.forward import ForwardModel
from gsl.models.free_run import recovered_error, segments, shortest
from gsl.models.inverse import InverseModel, Regression, Solver
from gsl.models.linear import fit_linear
from gsl.models.network import Samples
from gsl.stages.train_states import inverse_of_states
from gsl.stages.training import Parts, checked, data_file, degrees, degrees_by_joint, parts, summary
from gsl.storage.models import write_model
from gsl.tasks.task import REAL

Method = Annotated[
    Literal["regression", "solve"],
    setting("fit the action (the paper), or solve a model of the simulator for it, the identity where sim = real"),
]
Damping = Annotated[
    float, setting("of solve: what a change of action costs, in units of the squared sensitivity", gt=0, upper=1.0)
]


@component
class TrainInverse:
    """Fits an inverse model of the simulator; the data need action noise, or it cannot tell one joint from another.

    `auto` takes the family that best recovers the actions of validation trajectories when it sees its own answers as
    the past actions.
    """

    kind: ClassVar[str] = "train_inverse"

    data: Annotated[str, setting("simulated trajectories: a file, or a run or artifact of collect", min_length=1)]
    model: Annotated[ModelConfig, setting("what to fit")]
    method: Method = "regression"
    damping: Damping = 0.2
    heldout: Annotated[float, setting("share of the trajectories that is held out", gt=0, lt=1)] = 0.2
    seed: Annotated[int, setting("of the split and of the fit", ge=0)] = 1

    def parents(self) -> Mapping[str, Path]:
        """Return the file of trajectories, or the artifact."""
        path = data_file(self.data)
        return {"data": path if path == Path(self.data) else path.parent}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        """Write the model."""
        if self.model.multi_step > 1:
            raise ConfigError("model.multi_step", "is of a forward model", given=str(self.model.multi_step))
        path = data_file(self.data)
        data = parts(path, other=REAL, share=self.heldout, seed=self.seed)
        console.status(f"fitting an inverse model to {len(data.training)} trajectories")
        if data.training.states:
            return inverse_of_states(folder, data, self.model, self.seed)
        data = data.only(self.model.joints_of_interest(data.training.joints, "model"))
        for part in data:
            checked(path, part.episodes, shortest(self.model.of_joints, self.model.horizon))
        model, choice = fitted(self.model, data, self.seed, self.method, self.damping)
        write_model(folder, model)
        errors = recovered_error(model, segments(data.heldout.episodes, self.model.of_joints, carried_out=True))
        by_joint = degrees_by_joint(errors, model.joints)
        measured = {"recovered_action_deg": degrees(errors), "recovered_action_by_joint_deg": by_joint}
        return {**summary(choice, data), "method": self.method, "heldout": measured}


def fitted(config: ModelConfig, data: Parts, seed: int, method: Method, damping: float) -> tuple[InverseModel, Choice]:
    """Return the inverse model that a configuration allows and that best recovers the actions of validation."""
    pieces = segments(data.validation.episodes, config.of_joints, carried_out=True)

    def fit(one: ModelConfig, whole: bool) -> InverseModel:
        if method == "regression":
            return _regression(one, data, seed, whole)
        return _solver(one, data, seed, damping, whole)

    return best(config, fit, lambda model: degrees(recovered_error(model, pieces)))


def _regression(config: ModelConfig, data: Parts, seed: int, whole: bool) -> InverseModel:
    n = len(data.training.joints)
    known, unseen = (_turned(_rows(config, part), n, config) for part in (data.training, data.validation))
    network = fit_network(known, unseen, config, seed=seed, whole=whole)
    return Regression(network, config.of_joints, data.training.joints, config.encoding, config.horizon)


def _solver(config: ModelConfig, data: Parts, seed: int, damping: float, whole: bool) -> InverseModel:
    joints = data.training.joints
    rows = [_rows(config, part) for part in (data.training, data.validation)]
    known, unseen = ((part.windows, encode(part.change, config.encoding)) for part in rows)
    network = fit_network(known, unseen, config, seed=seed, whole=whole)
    simulator = ForwardModel(network, config.of_joints, joints, config.encoding, config.horizon)
    plain = fit_linear(rows[0].windows, rows[0].change, ridge=config.ridge)
    sensitivity = plain.layers[0][0][:, : len(joints)].astype(float)
    return Solver(simulator, sensitivity, damping)


def _turned(data: Transitions, n: int, config: ModelConfig) -> Samples:
    """Let the wanted change take the place of the action in the inputs, and the action become the target."""
    inputs = np.concatenate([data.change, data.windows[:, n:]], axis=1)
    return inputs, encode(data.windows[:, :n], config.encoding)


def _rows(config: ModelConfig, part: Batch) -> Transitions:
    return transitions(part.episodes, config.of_joints, config.horizon, carried_out=True)
