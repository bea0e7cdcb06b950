"""Train the forward model: learn from trajectories of the real robot how it moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.angles import encode
from gsl.core.region import region
from gsl.core.seeds import derived_seed
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch, Trajectory
from gsl.core.transitions import Transitions, transitions, usable
from gsl.errors import ConfigError, TrajectoryError
from gsl.models.calibration import calibrated
from gsl.models.choice import Choice, best, fit_network
from gsl.models.config import ModelConfig
from gsl.models.ensemble import Forward, ensemble
from gsl.models.forward import ForwardModel
from gsl.models.free_run import Segments, predicted_error, segments, shortest, standstill_error
from gsl.models.inverse import Solver
from gsl.models.network import Samples
from gsl.stages.drift import write_region
from gsl.stages.train_states import forward_of_states
from gsl.stages.training import (
    FALLS,
    Parts,
    aggregated,
    checked,
    data_file,
    degrees,
    degrees_by_joint,
    earlier_batch,
    explained,
    of_policy,
    parts,
    summary,
)
from gsl.storage.models import read_inverse_model, write_model
from gsl.storage.references import resolve
from gsl.storage.trajectories import write
from gsl.tasks.task import SIM

HELDOUT, VALIDATION = "heldout.parquet", "validation.parquet"


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
        named = {"data": self.data, **{f"earlier_{n}": one for n, one in enumerate(self.earlier, start=1)}}
        files = {name: data_file(reference) for name, reference in named.items()}
        if len({path.resolve() for path in files.values()}) < len(files):
            raise ConfigError("earlier", "names the same trajectories twice; what is held out would be learned from")
        return {name: path if path == Path(named[name]) else path.parent for name, path in files.items()} | below

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        """Write the model and the trajectories it has not seen."""
        path = data_file(self.data)
        newest = parts(path, other=SIM, share=self.heldout, seed=self.seed)
        earlier = {one: earlier_batch(one, newest.training) for one in map(data_file, self.earlier)}
        data = aggregated(newest, list(earlier.values()))
        console.status(f"fitting a forward model to {len(data.training)} trajectories")
        if data.training.states:
            if self.residual_to is not None:
                raise ConfigError("residual_to", "is for robots; these trajectories are of an environment's states")
            write(folder / HELDOUT, data.heldout)
            return forward_of_states(folder, data, self.model, self.seed)
        if self.model.covariance == "full":
            raise ConfigError("model.covariance", "full is for a gymnasium environment; robots' joints are drawn alone")
        for file, batches in {path: newest, **{one: [batch] for one, batch in earlier.items()}}.items():
            self._check(file, batches)
        known = data.only(self.model.joints_of_interest(data.training.joints, "model"))
        base = None if self.residual_to is None else self._simulator(self.residual_to, known.training)
        model, choice = fitted(self.model, known, self.seed, base)
        write_model(folder, model)
        own = [one for part in known for one in of_policy(part, pi0=True)]
        falls = float(np.mean([one.ended_in_a_fall for one in own])) if own else 0.0
        write(folder / HELDOUT, replace(data.heldout, metadata={**data.heldout.metadata, FALLS: falls}))
        write(folder / VALIDATION, data.validation)
        seen, unseen = (_rows(choice.config, part.episodes).windows for part in (known.training, known.validation))
        write_region(folder, region(seen, unseen))
        groups = {"pi0": of_policy(known.heldout, pi0=True), "off_pi0": of_policy(known.heldout, pi0=False)}
        measured = {name: measures(model, long) for name, part in groups.items() if (long := _long(self.model, part))}
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
                long = checked(path, part.episodes, shortest(self.model.of_body, self.model.horizon))
                _rows(self.model, long)
        except KeyError as error:
            raise TrajectoryError(
                path, "was not recorded; leave the sensor out of model.sensors", column=error.args[0]
            ) from error


def fitted(config: ModelConfig, data: Parts, seed: int, base: ForwardModel | None = None) -> tuple[Forward, Choice]:
    """Return the forward model that a configuration allows and that does best on validation trajectories.

    Args:
        config: What is allowed.
        data: To learn from.
        seed: Of the fit.
        base: What is corrected, none for a robot learned from nothing.
    """
    judges = _long(config, of_policy(data.validation, pi0=False)) or _long(config, data.validation.episodes)
    return best(config, lambda one, whole: _fitted(one, data, seed, base, whole), lambda model: _score(model, judges))


def _fitted(config: ModelConfig, data: Parts, seed: int, base: ForwardModel | None, whole: bool) -> Forward:
    episodes = data.training.episodes
    if config.members == 1:
        return _member(config, episodes, data, seed, base, whole)
    rng = np.random.default_rng(derived_seed(seed, "members"))
    drawn = [rng.integers(len(episodes), size=len(episodes)) for _ in range(config.members)]
    members = [
        _member(config, [episodes[index] for index in indices], data, seed + number, base)
        for number, indices in enumerate(drawn)
    ]
    return ensemble(tuple(members), _rows(config, data.validation.episodes).windows)


def _score(model: Forward, episodes: Sequence[Trajectory]) -> float:
    measured = measures(model, episodes)
    if model.head.draws:
        return float(measured["nll"])
    return float(measured["free_run_deg"] if model.horizon == 1 else measured["one_step_deg"])


def _long(config: ModelConfig, episodes: Sequence[Trajectory]) -> tuple[Trajectory, ...]:
    needed = shortest(config.of_body, config.horizon)
    return tuple(one for one in episodes if usable(one) >= needed)


def _member(
    config: ModelConfig,
    episodes: Sequence[Trajectory],
    data: Parts,
    seed: int,
    base: ForwardModel | None,
    whole: bool = False,
) -> ForwardModel:
    """Return a model of some of the training trajectories, and of those of the validation if it is the `whole`."""
    head = config.head
    known, unseen = (_samples(config, part, base) for part in (episodes, data.validation.episodes))
    pieces = _pieces(config, episodes, data.validation.episodes) if config.multi_step > 1 else None
    network = fit_network(known, unseen, config, seed=seed, head=head, whole=whole, pieces=pieces)
    memory = np.zeros(unseen[1].shape[1])
    if head.draws and config.calibrated:
        network, memory = calibrated(network, head, [_samples(config, [one], base) for one in data.validation.episodes])
    joints = data.training.joints
    return ForwardModel(
        network, config.of_body, joints, config.encoding, config.horizon, head, memory, base, config.multi_step
    )


def _samples(config: ModelConfig, episodes: Sequence[Trajectory], base: ForwardModel | None) -> Samples:
    rows = _rows(config, episodes)
    known = 0.0 if base is None else base.effects(rows.windows[:, : base.network.inputs])
    return rows.windows, encode(rows.change - known, config.encoding)


def _pieces(config: ModelConfig, *parts: Sequence[Trajectory]) -> tuple[Segments, Segments] | None:
    """Return what the multi-step loss is of in both parts; None where all of a member's draw are over too soon."""
    needed = config.of_body.span + config.multi_step + 1
    training, validation = ([one for one in part if usable(one) >= needed] for part in parts)
    if not training or not validation:
        return None
    cut = partial(segments, history=config.of_body, carried_out=True, ticks=config.multi_step, every=1)
    return cut(training), cut(validation)


def _rows(config: ModelConfig, episodes: Sequence[Trajectory]) -> Transitions:
    return transitions(episodes, config.of_body, config.horizon, carried_out=True)


def measures(model: Forward, episodes: Sequence[Trajectory]) -> dict[str, Any]:
    """Return the errors of a forward model on trajectories, beside those of "nothing changes" [degrees]."""
    data = transitions(episodes, model.history, model.horizon, carried_out=True)
    pieces = segments(episodes, model.history, carried_out=True)
    errors = model.effects(data.windows) - data.change
    measured = {
        "trajectories": len(episodes),
        "one_step_deg": degrees(errors),
        "one_step_no_change_deg": degrees(data.change),
        "r2": explained(errors, data.change),
        "one_step_by_joint_deg": degrees_by_joint(errors, model.joints),
        "free_run_no_change_deg": degrees(standstill_error(pieces)),
    }
    if model.head.draws:
        measured["nll"] = float(model.surprise(data.windows, data.change).mean())
    if model.horizon == 1:
        ahead = predicted_error(model, pieces)
        measured |= {"free_run_deg": degrees(ahead), "free_run_by_joint_deg": degrees_by_joint(ahead, model.joints)}
    return measured
