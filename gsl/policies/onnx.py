"""A policy as ONNX, run by onnxruntime (gsl[onnx])."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from gsl.core.setting import component, setting
from gsl.core.words import several
from gsl.errors import ConfigError
from gsl.policies.outside import File, Joints, Network, OutsideFile, Ports, read_once
from gsl.policies.wired import Answer
from gsl.policies.wiring import Wiring


@component
class OnnxPolicy(OutsideFile):
    """A graph whose first input is the observation, shape (1, n_inputs), and whose first output are the outputs.

    Further inputs are a memory: each is zero at first, and then what the further output in its place was.
    """

    file: File
    wiring: Annotated[Wiring, setting("what it observes, and what its outputs do")] = field(default_factory=Wiring)
    joints: Joints = ()

    def network(self) -> Network:
        """Read the graph, once a process."""
        network: Network = read_once(Graph, self.file)
        return network


class Graph:
    """A graph that was read."""

    def __init__(self, path: Path) -> None:
        try:
            import onnxruntime
        except ImportError as error:
            raise ConfigError("policy", "policy=onnx needs gsl[onnx]: pip install 'gsl[onnx]'") from error
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # episodes are what is run in parallel
        options.log_severity_level = 3
        try:
            self._session: Any = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # the library's own kinds have no common base
            reason = " ".join(str(error).split())[:120]
            raise ConfigError("policy.file", f"is no ONNX that can be run: {reason}", given=str(path)) from error
        (self._input, *memory), self._where = self._session.get_inputs(), str(path)
        self._memory = {port.name: [size if isinstance(size, int) else 1 for size in port.shape] for port in memory}
        self._outputs = self._session.get_outputs()
        if len(memory) > len(self._outputs) - 1:
            problem = (
                f"has {len(memory)} inputs beside the observation, and {len(self._outputs) - 1} outputs to feed them"
            )
            raise ConfigError("policy.file", problem, given=str(path))

    @property
    def ports(self) -> Ports:
        """The last sizes of its input and output, where the graph says them."""
        sizes = [(port.shape or [None])[-1] for port in (self._input, self._outputs[0])]
        inputs, outputs = (size if isinstance(size, int) else None for size in sizes)
        return Ports(inputs, outputs)

    def begin(self) -> Answer:
        """Return it with an empty memory."""
        memory = {name: np.zeros(shape, dtype=np.float32) for name, shape in self._memory.items()}

        def answer(observation: np.ndarray) -> np.ndarray:
            try:
                outputs = self._session.run(None, {self._input.name: observation.astype(np.float32)[None], **memory})
            except Exception as error:
                problem = f"cannot take {several(len(observation), 'number')}: {' '.join(str(error).split())[:120]}"
                raise ConfigError("policy.wiring.observation", problem, given=self._where) from error
            memory.update(zip(memory, outputs[1:], strict=False))
            return np.asarray(outputs[0])

        return answer
