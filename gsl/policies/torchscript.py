"""A policy as TorchScript, as Isaac Lab, rsl_rl, legged_gym and mjlab export it; it runs no Python of the file."""

from __future__ import annotations

import re
import warnings
import zipfile
import zlib
from dataclasses import field
from pathlib import Path
from typing import IO, Annotated, Any

import numpy as np

from gsl.core.budget import NETWORK_BYTES, open_file
from gsl.core.setting import component, setting
from gsl.core.words import several
from gsl.errors import ConfigError
from gsl.policies.outside import File, Joints, Network, OutsideFile, Ports, read_once
from gsl.policies.wired import Answer
from gsl.policies.wiring import Wiring

_REACHING = re.compile(rb"\b(save|from_file|rpc_\w+|print)\b|\bops\s*\.\s*(?!(aten|prim|quantized|prepacked)\b)\w+")
"""Words of a program that no policy needs: operations on files, machines and the terminal."""
_PART = re.compile(rb'\bgetattr\([\w.]+, "[^"\\\n]*"\)')  # how a program writes a layer of a sequence
_GETTING = re.compile(rb"\bgetattr\b")  # in any other way, such as with a name in two parts


@component
class TorchScriptPolicy(OutsideFile):
    """A module that maps observations, shape (1, n_inputs), to outputs, shape (1, n_outputs), in single precision.

    One with a memory has a method `reset`, which is called at the beginning of an episode.
    """

    file: File
    wiring: Annotated[Wiring, setting("what it observes, and what its outputs do")] = field(default_factory=Wiring)
    joints: Joints = ()

    def network(self) -> Network:
        """Read the module, once a process."""
        network: Network = read_once(TorchScript, self.file)
        return network


class TorchScript:
    """A module that was read."""

    def __init__(self, path: Path) -> None:
        import torch

        try:
            load: Any = torch.jit.load
            with open_file(path, NETWORK_BYTES) as file, warnings.catch_warnings():
                check_program(path, file)
                file.seek(0)
                warnings.simplefilter("ignore")  # of torch, which would like torch.export
                self._module: Any = load(file, map_location="cpu").eval()
        except (RuntimeError, ValueError, OSError) as error:
            advice = "write it with torch.jit.script(module).save(file)"
            raise ConfigError(
                "policy.file", f"is no TorchScript: {_first_line(error)}; {advice}", given=str(path)
            ) from error
        self._torch, self._where = torch, str(path)

    @property
    def ports(self) -> Ports:
        """The width of its first and last linear layer, where these can be seen."""
        matrices = [matrix for _, matrix in self._module.named_parameters() if matrix.dim() == 2]
        if self._remembers or not matrices:
            return Ports(None, None)
        return Ports(int(matrices[0].shape[1]), int(matrices[-1].shape[0]))

    @property
    def _remembers(self) -> bool:
        return hasattr(self._module, "reset")

    def begin(self) -> Answer:
        """Return it with an empty memory."""
        if self._remembers:
            self._module.reset()
        return self._answer

    def _answer(self, observation: np.ndarray) -> np.ndarray:
        with self._torch.inference_mode():
            try:
                outputs = self._module(self._torch.from_numpy(observation.astype(np.float32)[None]))
            except RuntimeError as error:
                problem = f"cannot take {several(len(observation), 'number')}: {_last_line(error)}"
                raise ConfigError("policy.wiring.observation", problem, given=self._where) from error
            return np.asarray((outputs[0] if isinstance(outputs, tuple) else outputs).numpy())


def check_program(path: Path, file: IO[bytes]) -> None:
    """Refuse a file whose program can write files, reach other machines or print: operations that no policy needs.

    Every file of its source is searched for their names, before any of it is loaded.

    Raises:
        ConfigError: It names one of them, or is no such file.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            entries = archive.infolist()
            if sum(entry.file_size for entry in entries) > NETWORK_BYTES:
                problem = f"unpacks to more than {NETWORK_BYTES / 1e9:g} GB; no policy is as large"
                raise ConfigError("policy.file", problem, given=str(path))
            sources = [archive.read(entry) for entry in entries if entry.filename.endswith(".py")]
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, NotImplementedError) as error:
        advice = "write it with torch.jit.script(module).save(file)"
        raise ConfigError("policy.file", f"is no TorchScript; {advice}", given=str(path)) from error
    searches = (_REACHING.search(source) or _GETTING.search(_PART.sub(b"", source)) for source in sources)
    if (match := next(filter(None, searches), None)) is not None:
        problem = (
            f"uses {match[0].decode()}, with which a program could reach files or the terminal; no policy needs it"
        )
        raise ConfigError("policy.file", problem, given=str(path))


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]


def _last_line(error: Exception) -> str:
    return str(error).strip().rpartition("\n")[2]
