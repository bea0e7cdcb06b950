"""What a forward or an inverse model is: family, history, sensors, encoding, and how an MLP is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import StrictInt, StrictStr

from gsl.core.angles import Encoding
from gsl.core.history import History
from gsl.core.setting import component, setting
from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError
from gsl.models.head import Head, Likelihood

Sensor = Literal["gyro", "tilt", "foot_force"]
HISTORIES = (1, 2, 3, 5, 8)  # that `auto` tries
FARTHEST = 10  # ticks ahead that a model looks, or is fed with its own answers, at most; no more than a free run has


@component
class ModelConfig:
    """The settings of a model; those of the MLP are the paper's where it names them (section 6.4).

    A ridge of 0.01 and a weight decay of 0.001 made the grounded simulator no worse in any measurement and better
    in most: both models are asked about states a little beside those they were fitted to.
    """

    family: Annotated[Literal["auto", "linear", "mlp"], setting("kind of model; auto takes the better one")] = "auto"
    history: Annotated[
        Annotated[int, setting("", ge=0, le=20)] | Literal["auto"],
        setting("past positions and actions it sees, ticks of each; auto takes what does best"),
    ] = 3
    sensors: Annotated[tuple[Sensor, ...], setting("body sensors a forward model sees besides")] = ()
    sensor_ticks: Annotated[int, setting("ticks of each sensor, the present one included", ge=1, le=20)] = 2
    horizon: Annotated[int, setting("ticks ahead it looks", ge=1, le=FARTHEST)] = 1
    encoding: Annotated[Encoding, setting("angles as they are, or as sine and cosine")] = "plain"
    ridge: Annotated[float, setting("penalty on the weights of the linear model, scaled inputs", ge=1e-9)] = 1e-2
    variables: Annotated[
        tuple[StrictInt | StrictStr, ...] | Literal["all"],
        setting("state variables of interest: a robot's joints by name, a gymnasium environment's state by index"),
    ] = "all"
    rested: Annotated[bool, setting("a robot's episodes begin at rest: their first ticks are learned from too")] = False
    likelihood: Annotated[
        Likelihood, setting("what a forward model says of the next state: a point, a Gaussian, a mixture of Gaussians")
    ] = "point"
    covariance: Annotated[
        Literal["diagonal", "full"],
        setting("of a Gaussian: variables drawn each alone, or as they err together (of environments)"),
    ] = "diagonal"
    beta: Annotated[
        float,
        setting(
            "of a Gaussian's fit: 0 is the likelihood, which neglects means where they are hard to tell; towards 1 all "
            "errors count alike",
            source="Seitzer et al. 2022, beta-NLL",
            ge=0,
            le=1,
        ),
    ] = 0.0
    components: Annotated[int, setting("Gaussians of a mixture", ge=2, le=10)] = 3
    calibrated: Annotated[
        bool,
        setting("a robot's draws are as wide, and last as long, as errors on validation trajectories; else as fitted"),
    ] = True
    multi_step: Annotated[
        int,
        setting(
            "ticks over which the fit of an MLP, a forward model, goes on with its own answers fed back to it",
            source="Venkatraman et al. 2015",
            ge=1,
            le=FARTHEST,
        ),
    ] = 1
    members: Annotated[int, setting("forward models of an ensemble, each of its own draw of trajectories", ge=1)] = 1
    hidden: Annotated[
        tuple[Annotated[int, setting("", ge=1)], ...], setting("widths of the MLP's hidden layers", min_length=1)
    ] = (200, 180)
    epochs: Annotated[int, setting("most epochs of a fit", ge=1)] = 60
    patience: Annotated[int, setting("epochs without a better validation error before it ends", ge=1)] = 8
    rate: Annotated[float, setting("step of Adam", gt=0)] = 1e-3
    batch: Annotated[int, setting("samples in a step", ge=1)] = 256
    decay: Annotated[float, setting("weight decay", ge=0)] = 1e-3

    def __post_init__(self) -> None:
        """Refuse what no family can be."""
        if self.likelihood == "mixture" and self.family == "linear":
            raise ConfigError("family", "a linear model has no mixture; take mlp or auto", given=self.family)
        if self.multi_step > 1:
            for name, only in (("likelihood", "point"), ("encoding", "plain"), ("horizon", 1)):
                if getattr(self, name) != only:
                    value = str(getattr(self, name))
                    raise ConfigError(
                        name, f"answers that are fed back are {name}={only}; or multi_step=1", given=value
                    )
            if self.family == "linear":
                raise ConfigError("multi_step", "is for an MLP; take family=mlp or auto", given=str(self.multi_step))
        if not self.variables or (self.variables != "all" and len(set(self.variables)) < len(self.variables)):
            raise ConfigError("variables", "names at least one joint or entry of the state, each once")

    def of_interest(self, states: int, where: str) -> tuple[int, ...]:
        """Return the state variables of interest, by index.

        Args:
            states: Number of state variables.
            where: Name of the setting that this configuration is.

        Raises:
            ConfigError: They are not among so many states, or what is of a robot alone is asked for.
        """
        if self.rested:
            raise ConfigError(f"{where}.rested", "is of a robot; an environment's models look no ticks back")
        if self.variables == "all":
            return tuple(range(states))
        for variable in self.variables:
            if not (isinstance(variable, int) and 0 <= variable < states):
                raise ConfigError(f"{where}.variables", f"the state has entries 0 to {states - 1}", given=str(variable))
        return tuple(map(int, self.variables))

    def joints_of_interest(self, joints: Sequence[str], where: str) -> tuple[str, ...]:
        """Return the joints of interest, in the robot's order.

        Args:
            joints: Of the robot.
            where: Name of the setting that this configuration is.

        Raises:
            ConfigError: They are not among the robot's.
        """
        if self.variables == "all":
            return tuple(joints)
        for name in self.variables:
            if name not in joints:
                hint = did_you_mean(str(name), joints)
                raise ConfigError(f"{where}.variables", f"the robot has no joint of this name{hint}", given=str(name))
        return tuple(joint for joint in joints if joint in self.variables)

    @property
    def variants(self) -> Mapping[str, ModelConfig]:
        """What to try, by name, the simpler ones first: settings in which nothing is `auto`."""
        families: tuple[Any, ...] = (self.family,)
        if self.family == "auto":
            families = ("mlp",) if self.likelihood == "mixture" else ("linear", "mlp")
        histories = HISTORIES if self.history == "auto" else (self.history,)
        return {
            family if len(histories) == 1 else f"{family}_{ticks}": replace(
                self, family=family, history=ticks, multi_step=self.multi_step if family == "mlp" else 1
            )
            for family in families
            for ticks in histories
        }

    @property
    def learns_from_all(self) -> bool:
        """Whether validation neither stops its fit, nor calibrates its spread, nor tells how members disagree."""
        return self.family == "linear" and not self.head.draws and self.members == 1

    @property
    def head(self) -> Head:
        """How the outputs of a forward model are read."""
        return Head(self.likelihood, self.components if self.likelihood == "mixture" else 1)

    @property
    def of_body(self) -> History:
        """What a forward model of the robot sees, at most."""
        return History(self._ticks, self.sensors, self.sensor_ticks, self.rested)

    @property
    def of_joints(self) -> History:
        """What a model of the simulator sees, at most: joints alone."""
        return History(self._ticks, rested=self.rested)

    @property
    def _ticks(self) -> int:
        return max(HISTORIES) if self.history == "auto" else self.history
