"""Train the forward model: learn from trajectories of the real robot how it moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.console import Console
from gsl.core.interfaces import REAL, SIM
from gsl.core.region import region
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch
from gsl.errors import ConfigError, TrajectoryError
from gsl.models.config import ModelConfig
from gsl.models.forward import ForwardModel
from gsl.models.free_run import shortest
from gsl.models.inverse import Solver
from gsl.storage.models import read_inverse_model, write_model
from gsl.storage.references import resolve
from gsl.storage.trajectories import data_file, write
from gsl.training.data import (
    FALLS,
    HELDOUT,
    VALIDATION,
    aggregate,
    check_lengths,
    earlier_batch,
    of_policy,
    parts,
    summary,
)
from gsl.training.forward import fit_forward, forward_errors, long_enough, model_rows
from gsl.training.states import forward_of_states
from gsl.validation.drift import write_region


@component
class TrainForward:
    """Fits f to a part of the real trajectories and measures it on another, which it stores beside the model.

    `auto` takes the family whose own prediction, fed back to it for 0.2 s, is nearest to the validation trajectories,
    those off pi0 if there are any: the error of one tick says little, for in a gait all joints move together. A model
    with body sensors is fed the recorded ones. Of models with a distribution it takes the one that finds those
    trajectories likelier.
    """

    kind: ClassVar[str] = "train_forward"

    data: Annotated[str, setting("real trajectories: a file, or a run or artifact of collect", min_length=1)]
    model: Annotated[ModelConfig, setting("what to fit")]
    residual_to: Annotated[
        str | None,
        setting("inverse model (method=solve) whose model of the simulator f corrects; none: f corrects none"),
    ] = None
    heldout: Annotated[float, setting("share of the trajectories that is held out", gt=0, lt=1)] = 0.2
    seed: Annotated[int, setting("of the split and of the fit", ge=0)] = 1
    earlier: Annotated[
        tuple[str, ...], setting("real trajectories of earlier policies, to learn from as well; none is held out")
    ] = ()

    def parents(self) -> Mapping[str, Path]:
        """Return the files of trajectories, or the artifacts, and the inverse model."""
        below = {} if self.residual_to is None else {"residual_to": resolve(self.residual_to, kind="train_inverse")}
        named = {"data": self.data, **{f"earlier_{n}": path for n, path in enumerate(self.earlier, start=1)}}
        files = {name: data_file(reference, REAL) for name, reference in named.items()}
        if len({path.resolve() for path in files.values()}) < len(files):
            raise ConfigError("earlier", "names the same trajectories twice; what is held out would be learned from")
        return {name: path if path == Path(named[name]) else path.parent for name, path in files.items()} | below

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the model and the trajectories it has not seen."""
        path = data_file(self.data, REAL)
        newest = parts(path, other=SIM, share=self.heldout, seed=self.seed)
        before = [data_file(reference, REAL) for reference in self.earlier]
        earlier = {file: earlier_batch(file, newest.training) for file in before}
        data = aggregate(newest, list(earlier.values()))
        console.phase(f"fitting a forward model to {len(data.training)} trajectories")
        if data.training.states:
            if self.residual_to is not None:
                raise ConfigError("residual_to", "is for robots; these trajectories are of an environment's states")
            write(folder / HELDOUT, data.heldout)
            return forward_of_states(folder, data, self.model, self.seed)
        if self.model.covariance == "full":
            raise ConfigError("model.covariance", "full is for a gymnasium environment; robots' joints are drawn alone")
        for file, batches in {path: newest, **{file: [batch] for file, batch in earlier.items()}}.items():
            self._check(file, batches)
        chosen = data.only(self.model.joints_of_interest(data.training.joints, "model"))
        base = None if self.residual_to is None else self._simulator(self.residual_to, chosen.training)
        model, choice = fit_forward(self.model, chosen, self.seed, base)
        write_model(folder, model)
        own = [episode for part in chosen for episode in of_policy(part, pi0=True)]
        falls = float(np.mean([episode.ended_in_a_fall for episode in own])) if own else 0.0
        write(folder / HELDOUT, replace(data.heldout, metadata={**data.heldout.metadata, FALLS: falls}))
        write(folder / VALIDATION, data.validation)
        seen, unseen = (
            model_rows(choice.config, part.episodes).windows for part in (chosen.training, chosen.validation)
        )
        write_region(folder, region(seen, unseen))
        groups = {"pi0": of_policy(chosen.heldout, pi0=True), "off_pi0": of_policy(chosen.heldout, pi0=False)}
        measured = {
            name: forward_errors(model, long)
            for name, part in groups.items()
            if (long := long_enough(self.model, part))
        }
        return {**summary(choice, data), "heldout": measured}

    def _simulator(self, reference: str, batch: Batch) -> ForwardModel:
        """Return the model of the simulator behind an inverse model, if f can correct it."""
        inverse = read_inverse_model(reference)
        if not isinstance(inverse, Solver):
            raise ConfigError("residual_to", "holds no model of the simulator; train it with method=solve")
        base = inverse.simulator
        if base.joints != batch.joints:
            problem = "its model of the simulator knows other joints"
            raise ConfigError("residual_to", f"{problem}; train both on the same trajectories and model.variables")
        if self.model.multi_step > 1:
            raise ConfigError("model.multi_step", "is of a model that corrects none", given=str(self.model.multi_step))
        if self.model.encoding != "plain":
            raise ConfigError("model.encoding", "angles that are corrected are plain", given=self.model.encoding)
        if (self.model.history, self.model.horizon) != (base.history.ticks, base.horizon):
            problem = f"the model that is corrected looks {base.history.ticks} ticks back and {base.horizon} ahead"
            raise ConfigError("model", f"{problem}; say model.history and model.horizon alike")
        return base

    def _check(self, path: Path, batches: Sequence[Batch]) -> None:
        try:
            for part in batches:
                long = check_lengths(path, part.episodes, shortest(self.model.of_body, self.model.horizon))
                model_rows(self.model, long)
        except KeyError as error:
            raise TrajectoryError(
                path, "was not recorded; leave the sensor out of model.sensors", column=error.args[0]
            ) from error
