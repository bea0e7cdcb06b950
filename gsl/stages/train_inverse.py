"""Train the inverse model: learn from trajectories of the simulator which action makes a motion."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

from gsl.core.console import Console
from gsl.core.interfaces import REAL, SIM
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.models.config import ModelConfig
from gsl.models.free_run import recover_error, segments, shortest
from gsl.storage.models import write_model
from gsl.storage.trajectories import data_file
from gsl.training.data import check_lengths, degrees, degrees_by_joint, parts, summary
from gsl.training.inverse import Damping, Method, fit_inverse
from gsl.training.states import inverse_of_states


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
        path = data_file(self.data, SIM)
        return {"data": path if path == Path(self.data) else path.parent}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the model."""
        if self.model.multi_step > 1:
            raise ConfigError("model.multi_step", "is of a forward model", given=str(self.model.multi_step))
        path = data_file(self.data, SIM)
        data = parts(path, other=REAL, share=self.heldout, seed=self.seed)
        console.phase(f"fitting an inverse model to {len(data.training)} trajectories")
        if data.training.states:
            return inverse_of_states(folder, data, self.model, self.seed)
        data = data.only(self.model.joints_of_interest(data.training.joints, "model"))
        for part in data:
            check_lengths(path, part.episodes, shortest(self.model.of_joints, self.model.horizon))
        model, choice = fit_inverse(self.model, data, self.seed, self.method, self.damping)
        write_model(folder, model)
        errors = recover_error(model, segments(data.heldout.episodes, self.model.of_joints, carried_out=True))
        by_joint = degrees_by_joint(errors, model.joints)
        measured = {"recovered_action_deg": degrees(errors), "recovered_action_by_joint_deg": by_joint}
        return {**summary(choice, data), "method": self.method, "heldout": measured}
