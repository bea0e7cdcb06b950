"""A policy as a Python function of yours: from what it observes to its outputs, as arrays."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from gsl.core.loaded import note
from gsl.core.setting import component, setting
from gsl.errors import ConfigError, GslError
from gsl.policies.outside import Joints, Network, Outside, Ports
from gsl.policies.wired import Answer
from gsl.policies.wiring import Wiring


@component
class FunctionPolicy(Outside):
    """Calls `function(observation)`; of a class, an object is made for every episode and called likewise."""

    function: Annotated[
        str, setting("of your own, or a class whose objects are called: package.module:name", pattern=":")
    ]
    wiring: Annotated[Wiring, setting("what it observes, and what its outputs do")] = field(default_factory=Wiring)
    joints: Joints = ()

    @property
    def name(self) -> str:
        """What errors call the function."""
        return self.function

    @property
    def read_files(self) -> Mapping[str, Path]:
        """The file of the function."""
        source = inspect.getsourcefile(_import(self.function))
        return {"function": Path(source)} if source else {}

    def network(self) -> Network:
        """Import the function."""
        return Function(self.function, _import(self.function))


@dataclass(frozen=True)
class Function:
    """A function, or a class, that was imported."""

    name: str
    callee: Any

    @property
    def ports(self) -> Ports:
        """It does not say."""
        return Ports(None, None)

    def begin(self) -> Answer:
        """Return the function, or an object of the class."""
        call = self._call(self.callee) if isinstance(self.callee, type) else self.callee

        def answer(observation: np.ndarray) -> np.ndarray:
            returned = self._call(call, observation.copy())
            try:
                return np.asarray([] if returned is None else returned, dtype=float)
            except (TypeError, ValueError, RuntimeError) as error:  # the last of a tensor with gradients
                reason = " ".join(str(error).split())
                kind = type(returned).__name__
                raise GslError(f"{self.name}: returns no array of numbers but {kind}: {reason}") from error

        return answer

    def _call(self, call: Any, *arguments: Any) -> Any:
        try:
            return call(*arguments)
        except (KeyboardInterrupt, GslError):
            raise
        except Exception as error:
            reason = " ".join(str(error).split())
            raise GslError(f"{self.name}: fails by itself: {type(error).__name__}: {reason}") from error


def _import(name: str) -> Any:
    module, _, attribute = name.partition(":")
    try:
        callee = getattr(importlib.import_module(module), attribute)
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ConfigError("policy.function", f"cannot be loaded: {reason}", given=name) from error
    note(module)
    if not callable(callee):
        raise ConfigError("policy.function", "is no function", given=name)
    return callee
