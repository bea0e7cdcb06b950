"""What acts in an episode of a request: a policy of gsl, its source unchanged, or a table of commands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from gsl.core.action_noise import ActionNoiseRun
from gsl.core.seeds import grounding_generator
from gsl.core.trust import TARGET, class_of
from gsl.errors import GslError
from gsl.runner.request import layout_of


class Actor:
    """A policy in one episode, with the noise that its actions get.

    Args:
        request: What is asked for.
        episode: One of its episodes.
    """

    def __init__(self, request: Mapping[str, Any], episode: Mapping[str, Any]) -> None:
        self._table = np.array(episode["commands"], dtype=float) if "commands" in episode else None
        self._episode, self._next, layout = episode, 0, layout_of(request)
        if self._table is None:
            with _name_episode(episode):
                self._run = policy_of(request).start(np.array(episode["parameters"], dtype=float), layout)
        self._noise = ActionNoiseRun(request["action_noise"], grounding_generator(episode["seed"]))

    def act(self, observation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what the policy wants and what is to be sent: with noise [rad], shape (n_joints,) each."""
        if self._table is None:
            with _name_episode(self._episode):
                action = self._run.act(observation)
        else:
            action = self._table[min(self._next, len(self._table) - 1)]
            self._next += 1
        return action, self._noise.transform(observation, action)


@contextmanager
def _name_episode(episode: Mapping[str, Any]) -> Iterator[None]:
    """Turn whatever a policy raises into one line that names its episode."""
    try:
        yield
    except GslError:
        raise
    except (Exception, SystemExit) as error:
        raise GslError(f"{episode['name']}: its policy failed: {type(error).__name__}: {error}") from error


def policy_of(request: Mapping[str, Any]) -> Any:
    """Return the policy that a checked request names, built from the modules beside it."""
    settings = dict(request["policy"])
    return class_of(settings.pop(TARGET), "policy")(**settings)
