"""Any gymnasium environment as a world: its observation is the state, its reward stays its own.

Actions of a `Box` are given from -1 to 1 and scaled to the environment's range; where states and actions are discrete,
both are vectors of one number.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete

from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.core.table import Table
from gsl.errors import ConfigError, GslError
from gsl.worlds.control_cost import Charged, ControlCost
from gsl.worlds.environments import line, make_environment, own_code, own_module
from gsl.worlds.mujoco import change_masses

_CODE = "code of the environment"  # among what is pickled
_STREAM = 11  # sets the noise on actions apart from the environment's own randomness, whose seed is the same


@component
class GymnasiumWorld:
    """A world's configuration; `make` builds the environment."""

    env_id: Annotated[str, setting("id of a registered environment, or package.module:Class of one's own")]
    kwargs: Annotated[Mapping[str, Any], setting("arguments of the environment")] = field(default_factory=dict)
    mass: Annotated[Mapping[str, float], setting("factors of the masses of a MuJoCo model's bodies, or of `all`")] = (
        field(default_factory=dict)
    )
    action_noise: Annotated[
        float,
        setting("sd of noise on every action, in halves of its range; of choices, the chance of a random one", ge=0),
    ] = 0.0
    control_cost: Annotated[
        ControlCost | None,
        setting("what the reward charges for an action; none for what the environment's info tells"),
    ] = None

    def __post_init__(self) -> None:
        """Build it once, so that what is wrong is told by the name of the setting that it is wrong in."""
        if self.layout.choices and self.action_noise > 1.0:
            problem = "is a chance where actions are choices, 1 at most"
            raise ConfigError("action_noise", problem, given=f"{self.action_noise:g}")

    def __getstate__(self) -> dict[str, Any]:
        """Name the code of an environment of the user's own: whoever pickles the world hears of what it runs."""
        return {**vars(self), _CODE: own_code(self.env_id)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take the settings; the code came with them."""
        vars(self).update({name: value for name, value in state.items() if name != _CODE})

    @property
    def label(self) -> str:
        """The environment and what sets it apart from another of the same id, in a few words."""
        arguments = ", ".join(f"{name}={value}" for name, value in self.kwargs.items())
        return f"{self.env_id} ({arguments})" if arguments else self.env_id

    @property
    def read_files(self) -> Mapping[str, Path]:
        """The module of an environment of the user's own: a change there makes another world."""
        module = own_module(self.env_id)
        return {"env_id": module} if module else {}

    @cached_property
    def layout(self) -> Layout:
        """What an observation holds; building the environment tells."""
        env = self.make()
        env.close()
        return env.layout

    @property
    def table(self) -> Table:
        """Transitions and rewards of an environment that tells them in `P`, as gymnasium's toy texts do.

        Raises:
            ConfigError: It does not.
        """
        env = self.make()
        inside = env.unwrapped_env
        if not (env.layout.cells and env.layout.choices and hasattr(inside, "P")):
            problem = "has no table of transitions P; policy iteration needs one, as gymnasium's toy texts have"
            raise ConfigError("env_id", problem, given=self.env_id)
        start = getattr(inside, "initial_state_distrib", None)
        if start is None:
            start = np.eye(env.layout.cells)[int(env.reset(seed=0)[0][0])]
        env.close()
        return Table.of(inside.P, np.asarray(start, dtype=float)).disturb(self.action_noise)

    def make(self) -> StateEnv:
        """Build the environment."""
        return StateEnv(self)

    def try_out(self) -> None:
        """Take one step, so that an environment that fails does it before anything is learned.

        Raises:
            ConfigError: It fails.
        """
        env = self.make()
        try:
            env.reset(seed=0)
            env.step(np.zeros(len(env.layout.joints)))
        except GslError as error:
            raise ConfigError("env_id", str(error).removeprefix(f"{self.label}: "), given=self.label) from error
        finally:
            env.close()


class StateEnv(gymnasium.Env):
    """An environment whose observations and actions are vectors; `info["carried_out"]` is the action, noise and all."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  gymnasium's own name and type

    def __init__(self, world: GymnasiumWorld) -> None:
        self.world = world
        env = make_environment(world.env_id, world.kwargs)
        if world.mass:
            change_masses(env, world.mass)
        self.charged: Charged | None = None
        states, size = _state_size(world, env.observation_space), _action_size(world, env.action_space)
        cells, choices = _count(env.observation_space), _count(env.action_space)
        if choices:
            self._first = int(env.action_space.start)  # type: ignore[attr-defined]
            self.action_space = Box(0.0, choices - 1.0, (1,), dtype=np.float64)
        else:
            ends = env.action_space.low, env.action_space.high  # type: ignore[attr-defined]
            self._low, self._high = (np.asarray(end, dtype=float) for end in ends)
            self._middle, self._half = (self._low + self._high) / 2.0, (self._high - self._low) / 2.0
            self.charged = Charged(world.control_cost, self._low, self._high)
            self.action_space = Box(-1.0, 1.0, (size,), dtype=np.float64)
        self._lowest = float(env.observation_space.start) if cells else 0.0  # type: ignore[attr-defined]
        self._env = env
        self._rng = np.random.default_rng()
        self.observation_space = Box(-np.inf, np.inf, (states,), dtype=np.float64)
        names = tuple(map(str, range(size)))
        ranges = () if choices else tuple(zip(self._low.tolist(), self._high.tolist(), strict=True))
        self.layout = Layout(names, {"state": states}, _period(env), cells, choices, ranges)

    @property
    def unwrapped_env(self) -> Any:
        """The user's environment itself."""
        return self._env.unwrapped

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start anew; the environment gets the seed, and no options."""
        if seed is not None:
            self._rng = np.random.default_rng([seed, _STREAM])
        with self._name_failure():
            answer = self._env.reset(seed=seed)
        if not (isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[1], Mapping)):
            raise GslError(f"{self.world.label}: its reset() returns no (observation, info)")
        return self._state(answer[0]), dict(answer[1])

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Act: an action beyond its range counts as its end.

        Raises:
            GslError: The action or what comes of it is no finite number.
        """
        sent: Any = np.asarray(action, dtype=float)
        meant = sent
        if not np.isfinite(sent).all():
            raise GslError(f"{self.world.label}: the action {sent.tolist()} is not finite: a policy must give numbers")
        noise = self.world.action_noise
        if self.layout.choices:
            other = noise > 0.0 and self._rng.random() < noise
            number = int(self._rng.integers(self.layout.choices)) if other else round(float(sent[0]))
            own_action, sent = number + self._first, np.array([float(number)])
        else:
            shaken = sent + noise * self._rng.standard_normal(len(sent)) if noise else sent
            sent = np.clip(shaken, -1.0, 1.0)
            own_action = np.clip(self._middle + self._half * sent, self._low, self._high).astype(
                self._env.action_space.dtype
            )
        with self._name_failure():
            answer = self._env.step(own_action)
        if not (isinstance(answer, tuple) and len(answer) == 5 and isinstance(answer[4], Mapping)):
            five = "(observation, reward, terminated, truncated, info)"
            raise GslError(f"{self.world.label}: its step() returns no {five}")
        observation, value, ended, cut, info = answer
        if not np.isfinite(reward := _number(value)):
            problem = f"the reward is {line(value)}, no finite number; its dynamics or its reward are broken"
            raise GslError(f"{self.world.label}: {problem}")
        info = {**info, "carried_out": sent}
        if noise and self.charged:
            reward = self.charged.correct(reward, meant, sent, info)
        return self._state(observation), reward, bool(ended), bool(cut), info

    def close(self) -> None:
        """Free what the environment holds."""
        self._env.close()

    @contextmanager
    def _name_failure(self) -> Iterator[None]:
        """Tell what fails inside the user's environment as the environment's own failure."""
        try:
            yield
        except (KeyboardInterrupt, GslError):
            raise
        except Exception as error:
            raise GslError(f"{self.world.label}: fails by itself: {type(error).__name__}: {line(error)}") from error

    def _state(self, observation: Any) -> np.ndarray:
        state = np.array(observation, dtype=float).ravel() - self._lowest
        if len(state) != self.layout.states:
            problem = f"observes {len(state)} numbers, but its space has {self.layout.states}"
            raise GslError(f"{self.world.label}: {problem}")
        if not np.isfinite(state).all():
            place = int(np.argmin(np.isfinite(state)))
            problem = f"state.{place} is {state[place]}; its dynamics are broken, or its time step is too long"
            raise GslError(f"{self.world.label}: {problem}")
        return state


def try_out(worlds: Mapping[str, Any]) -> None:
    """Take a step in every environment among some worlds, by the setting that names them.

    Raises:
        ConfigError: One fails.
    """
    for name, world in worlds.items():
        if isinstance(world, GymnasiumWorld):
            try:
                world.try_out()
            except ConfigError as error:
                raise error.under(name) from error


def _number(reward: Any) -> float:
    try:
        return float(reward) if np.ndim(reward) == 0 else np.nan
    except (TypeError, ValueError):
        return np.nan


def _state_size(world: GymnasiumWorld, space: gymnasium.Space[Any]) -> int:
    if isinstance(space, Discrete):
        return 1
    if isinstance(space, Box) and len(space.shape) == 1:
        return int(space.shape[0])
    what = f"{type(space).__name__} of shape {space.shape}" if space.shape else type(space).__name__
    advice = "let a class of your own flatten it (images are beyond GAT, the paper's section 10.3)"
    problem = f"observes a {what}; gsl needs a vector: {advice}"
    raise ConfigError("env_id", problem, given=world.env_id)


def _count(space: gymnasium.Space[Any]) -> int:
    return int(space.n) if isinstance(space, Discrete) else 0


def _action_size(world: GymnasiumWorld, space: gymnasium.Space[Any]) -> int:
    if isinstance(space, Discrete):
        return 1
    if not isinstance(space, Box) or len(space.shape) != 1:
        problem = f"its actions are a {type(space).__name__}; gsl needs a Box that is a vector, or a Discrete"
        raise ConfigError("env_id", problem, given=world.env_id)
    if not np.issubdtype(space.dtype, np.floating) or np.any(space.low >= space.high):
        raise ConfigError("env_id", "its actions have no room: the space is of integers or empty", given=world.env_id)
    if not space.is_bounded():
        problem = "its actions have no bounds; give the space some, in a class of your own"
        raise ConfigError("env_id", problem, given=world.env_id)
    return int(space.shape[0])


def _period(env: gymnasium.Env) -> float:
    """Return the time between two actions [s], 1 where nobody says."""
    inside = env.unwrapped
    for value in (getattr(inside, "dt", None), getattr(inside, "tau", None)):
        if isinstance(value, float) and value > 0.0:
            return value
    rate = (inside.metadata or {}).get("render_fps")
    return 1.0 / rate if rate else 1.0
